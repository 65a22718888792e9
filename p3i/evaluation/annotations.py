"""The truth about a scene, written as the annotated photo sets write theirs.

Convention: plane coordinates are plane pixels, program units times `Size.unit_px`, on the plane that a 35 mm
lens would see: a scene drawn with another focal is told by its vanishing line, its rings are ellipses there.
"""

from typing import Any

import cv2
import numpy as np

from p3i.evaluation.scene import Scene
from p3i.grammar.ast import Affine, Polar
from p3i.interp.camera import DEFAULT_FOCAL_MM
from p3i.interp.unroll import affine_at, nest

_VAGUE_DEG = 0.5
"""A pose that the objects fix worse than this is not scored."""


def annotation(scene: Scene, file: str) -> dict[str, Any]:
    """The truth of a scene as a dictionary for JSON; `file` is the picture's path."""
    camera = scene.camera
    seen_at_35 = camera if camera.focal_mm == DEFAULT_FOCAL_MM else camera.refocused(DEFAULT_FOCAL_MM)
    sigma = scene.pose_sigma_deg
    said: dict[str, Any] = {
        "file": file,
        "width": scene.size.width,
        "height": scene.size.height,
        "structure": scene.structure,
        "accept_structure": [scene.structure],
        "object": scene.look,
        "centers": np.round(scene.centers_px, 2).tolist(),
        "indices": scene.index.tolist(),
        "hidden": np.flatnonzero(scene.hidden).tolist(),
        "pose": {"rx": seen_at_35.rx_deg, "ry": seen_at_35.ry_deg, "focal_mm": seen_at_35.focal_mm},
        "pose_reliable": sigma is None or sigma <= _VAGUE_DEG,
    }
    if sigma is not None:
        said["pose_sigma_deg"] = round(sigma, 3)
    if camera is not seen_at_35:
        said["camera"] = {"rx": camera.rx_deg, "ry": camera.ry_deg, "focal_mm": camera.focal_mm}
    if scene.structure == "lattice":
        said["lattice"] = _lattice(scene)
    else:
        said["rings"] = _rings(scene)
    said["roi"] = cv2.convexHull(scene.centers_px.astype(np.float32))[:, 0].round(2).tolist()
    said["source"] = f"rendered by p3i, seed {scene.seed}"
    return said


def _lattice(scene: Scene) -> dict[str, Any]:
    unit, draw = scene.size.unit_px, nest(scene.program).draw
    x, y = draw.x, draw.y
    assert isinstance(x, Affine) and isinstance(y, Affine)
    return {
        "base": [round(unit * x.constant, 4), round(unit * y.constant, 4)],
        "u": [round(unit * x.i, 4), round(unit * y.i, 4)],
        "v": [round(unit * x.j, 4), round(unit * y.j, 4)],
        "i_range": [int(scene.index[:, 0].min()), int(scene.index[:, 0].max())],
        "j_range": [int(scene.index[:, 1].min()), int(scene.index[:, 1].max())],
    }


def _rings(scene: Scene) -> list[dict[str, Any]]:
    draw = nest(scene.program).draw
    x, y = draw.x, draw.y
    assert isinstance(x, Polar) and isinstance(y, Polar)
    from_units = _plane_px_from_units(scene)
    step_deg = x.angle.j
    rings = []
    for i in sorted(set(scene.index[:, 0].tolist())):
        own = scene.index[:, 0] == i
        radius, phase_deg = affine_at(x.radius, i, 0), affine_at(x.angle, i, 0)
        center = from_units @ [affine_at(x.offset, i, 0), affine_at(y.offset, i, 0), 1]
        phase = np.radians(phase_deg)
        turned = radius * np.array([[np.cos(phase), -np.sin(phase)], [np.sin(phase), np.cos(phase)]])
        first, second = (from_units[:, :2] @ turned).T
        ring = {
            "object": scene.look,
            "n": int(own.sum()),
            "slots": round(360 / step_deg),
            "center": center.round(3).tolist(),
            "radius": round(float(np.sqrt(abs(np.linalg.det(from_units[:, :2]))) * radius), 3),
            "phase_deg": phase_deg,
            "step_deg": step_deg,
            "present": scene.index[own, 1].tolist(),
            "centers": np.round(scene.centers_px[own], 2).tolist(),
        }
        if scene.camera.focal_mm != DEFAULT_FOCAL_MM:
            ring |= {"ellipse_e1": first.round(3).tolist(), "ellipse_e2": second.round(3).tolist()}
        rings.append(ring)
    return rings


def _plane_px_from_units(scene: Scene) -> np.ndarray:
    """The affine map [2, 3] from program units to the plane pixels that a 35 mm lens would see."""
    unit, camera = scene.size.unit_px, scene.camera
    if camera.focal_mm == DEFAULT_FOCAL_MM:
        return unit * np.eye(2, 3)
    image_from_units = camera.image_from_plane(scene.size).numpy()
    image_from_units_at_35 = camera.refocused(DEFAULT_FOCAL_MM).image_from_plane(scene.size).numpy()
    matrix = np.linalg.inv(image_from_units_at_35) @ image_from_units
    return unit * matrix[:2] / matrix[2, 2]
