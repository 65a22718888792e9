"""New photographs of annotated ones: the camera turned and zoomed where it stood, as a set for `p3i eval`.

python benchmarks/views.py PHOTOS --out SET              # a view of each photo, of seed 0
python benchmarks/views.py PHOTOS --out SET --each 3 --seed 7
p3i eval SET

A search that was tuned with a set in sight does better on it than on photos that nobody has seen. A camera
that turns about its own centre sees the same scene through another homography, so what it would have taken
follows from a photo, and so does its truth: another part of the pattern, cut elsewhere by the frame, at
another slant and scale, under another light; in half of the views mirrored. How a search does on such views,
of a seed that it has not met, is nearer to how it does on new photos.

Of a lattice at least 12 objects and 3 x 3 indices stay in sight, of a ring all; photos that allow no such
view are named and left out. As everywhere, poses are those that a 35 mm lens would see. Everything follows
from the seed.
"""

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.interp.camera import DEFAULT_FOCAL_MM, Camera
from p3i.size import Size

Array = NDArray[np.float64]
Random = np.random.Generator

ASPECTS = ((4, 3), (3, 4), (3, 2), (2, 3), (1, 1))
SPANS = (0.45, 0.95)
"""A view spans so much of the photo's longer side, where it looks."""
TRIES = 400
FEWEST, FEWEST_SHARE, FEWEST_STEPS = 12, 0.25, 2


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A view of a photo: its `size` and the homography [3, 3] from the photo's pixels to its own."""

    size: Size
    from_photo: Array

    def places(self, points: object) -> Array:
        """Where pixels of the photo [N, 2] lie on the view, [N, 2]; what is behind the camera at infinity."""
        at = np.array(points, float)
        seen = np.column_stack([at, np.ones(len(at))]) @ self.from_photo.T
        return np.where(seen[:, 2:] > 0, seen[:, :2] / seen[:, 2:], np.inf)

    def shows(self, points: object) -> NDArray[np.bool_]:
        """Which pixels of the photo [N, 2] lie on the view, [N]."""
        at = self.places(points)
        return ((at >= 0) & (at <= [self.size.width - 1, self.size.height - 1])).all(1)

    def mirrored(self) -> "View":
        """The view in a mirror."""
        swap = np.array([[-1, 0, self.size.width - 1], [0, 1, 0], [0, 0, 1.0]])
        return View(self.size, swap @ self.from_photo)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("photos", type=Path, help="an annotated set, as `p3i eval` takes it")
    parser.add_argument("--out", type=Path, required=True, help="the folder of the new set")
    parser.add_argument("--each", type=int, default=1, help="views of each photo")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args(arguments)
    random = np.random.default_rng(asked.seed)
    (asked.out / "images").mkdir(parents=True, exist_ok=True)
    annotations = []
    for entry in json.loads((asked.photos / "annotations.json").read_text()):
        photo = cv2.imread(str(asked.photos / entry["file"]), cv2.IMREAD_UNCHANGED)
        if photo is None:
            raise SystemExit(f"{entry['file']} is no picture")
        for number in range(asked.each):
            view = view_of(entry, random)
            if view is None:
                print(f"no view of {entry['file']} shows enough of its pattern")
                continue
            suffix = ".png" if photo.ndim == 3 and photo.shape[2] == 4 else ".jpg"
            file = f"images/{Path(entry['file']).stem}_{number}{suffix}"
            quality = int(random.integers(72, 94))
            cv2.imwrite(
                str(asked.out / file), taken(photo, view, random), [cv2.IMWRITE_JPEG_QUALITY, quality]
            )
            annotations.append({"file": file, **truth(entry, view)})
    (asked.out / "annotations.json").write_text(json.dumps(annotations))


def view_of(entry: Mapping[str, Any], random: Random) -> View | None:
    """A view that lies within the photo and shows enough of its pattern; None where none was met."""
    size = Size(int(entry["width"]), int(entry["height"]))
    objects = np.array(entry["centers"], float)
    whole = entry["structure"] != "lattice"
    span = random.uniform(*SPANS)
    for _ in range(TRIES):
        # Where no view will do, a closer one may, and of a ring a wider one.
        span = min(1.0, 1.002 * span) if whole else max(SPANS[0], 0.997 * span)
        middle = objects.mean(0)
        at = middle + random.uniform(0, 1) * (objects[random.integers(len(objects))] - middle)
        focal_mm = float(entry.get("focal_mm_est") or DEFAULT_FOCAL_MM)
        view = _turned_to(at, size, focal_mm, span=span, random=random)
        frame = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [view.size.width - 1, view.size.height - 1]
        back = View(size, np.linalg.inv(view.from_photo))
        if back.shows(frame).all() and _enough(entry, view.shows(objects), whole=whole):
            return view.mirrored() if random.random() < 0.5 else view
    return None


def _turned_to(at: Array, size: Size, focal_mm: float, *, span: float, random: Random) -> View:
    """The view of a camera that looks at pixel `at` [2] of a photo, and spans so much of it there."""
    lens = _lens(size, focal_mm)
    ray = np.linalg.inv(lens) @ [*at, 1.0]
    forward = ray / np.linalg.norm(ray)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = math.radians(random.normal(0, 15))
    turn = np.stack(
        [
            math.cos(roll) * right + math.sin(roll) * down,
            math.cos(roll) * down - math.sin(roll) * right,
            forward,
        ]
    )
    aspect = ASPECTS[random.integers(len(ASPECTS))]
    spanned = span * size.longer
    longer = min(900, max(360, round(spanned * random.uniform(0.8, 1.15))))
    seen = Size(*(round(longer * side / max(aspect)) for side in aspect))
    own = _lens(seen, focal_mm * size.longer / spanned / float(np.linalg.norm(ray)))
    return View(seen, own @ turn @ np.linalg.inv(lens))


def _lens(size: Size, focal_mm: float) -> Array:
    focal_px = Camera(focal_mm=focal_mm).focal_px(size)
    return np.array([[focal_px, 0, size.middle[0]], [0, focal_px, size.middle[1]], [0, 0, 1.0]])


def _enough(entry: Mapping[str, Any], shown: NDArray[np.bool_], *, whole: bool) -> bool:
    """Whether a view that shows these of the objects [N] shows the pattern."""
    if whole:
        return bool(shown.all())
    if shown.sum() < FEWEST or shown.mean() < FEWEST_SHARE:
        return False
    indices = np.array(entry.get("indices") or [], int)
    return len(indices) != len(shown) or bool((np.ptp(indices[shown], axis=0) >= FEWEST_STEPS).all())


def taken(photo: NDArray, view: View, random: Random) -> NDArray[np.uint8]:
    """The view of a photo [H, W, 3 or 4] or [H, W], 8 bits, under another light, with some noise."""
    size = (view.size.width, view.size.height)
    colours = cv2.cvtColor(photo, cv2.COLOR_GRAY2BGR) if photo.ndim == 2 else photo[..., :3]
    shrunk = math.sqrt(abs(float(np.linalg.det(view.from_photo / view.from_photo[2, 2]))))
    if shrunk < 0.9:
        colours = cv2.GaussianBlur(colours, (0, 0), 0.35 / shrunk)
    seen = cv2.warpPerspective(colours, view.from_photo, size, flags=cv2.INTER_CUBIC).astype(float)
    gain, gamma = np.exp(random.normal(0, 0.06, 3)), random.uniform(0.75, 1.35)
    seen = 255 * np.clip(seen * gain / 255, 0, 1) ** gamma + random.normal(0, 1.5, seen.shape)
    lit = seen.clip(0, 255).astype(np.uint8)
    if photo.ndim == 2 or photo.shape[2] == 3:
        return lit
    known = cv2.warpPerspective(photo[..., 3], view.from_photo, size, flags=cv2.INTER_NEAREST)
    return np.dstack([lit, known])


def truth(entry: Mapping[str, Any], view: View) -> dict[str, Any]:
    """The annotation of a view, in the terms of docs/evaluation.md, from that of its photo."""
    photo, pose, size = Size(int(entry["width"]), int(entry["height"])), entry["pose"], view.size
    seen_by = Camera(pose["rx"], pose["ry"], pose.get("focal_mm", DEFAULT_FOCAL_MM))
    view_from_plane = view.from_photo @ _image_from_plane(seen_by, photo)
    horizon = np.linalg.inv(view_from_plane).T @ [0, 0, 1.0]
    normal = _lens(size, DEFAULT_FOCAL_MM).T @ horizon
    camera = Camera.from_normal((float(normal[0]), float(normal[1]), float(normal[2])))
    moved = np.linalg.inv(_image_from_plane(camera, size)) @ view_from_plane
    moved = moved[:2] / moved[2, 2]  # affine: both planes have this horizon

    def on_view(points: object) -> list[list[float]]:
        return view.places(points)[view.shows(points)].round(2).tolist()

    def step(of: object) -> list[float]:
        return (moved[:, :2] @ np.array(of, float)).tolist()

    def place(of: object) -> list[float]:
        return (moved[:, :2] @ np.array(of, float) + moved[:, 2]).tolist()

    kept = ("structure", "object", "pose_reliable", "accept_index", "accept_structure", "accept_half_ring")
    told = {key: entry[key] for key in kept if key in entry}
    told |= {"width": size.width, "height": size.height, "centers": on_view(entry["centers"])}
    told["pose"] = {"rx": camera.rx_deg, "ry": camera.ry_deg, "focal_mm": DEFAULT_FOCAL_MM}
    shown = view.shows(entry["centers"])
    indices = entry.get("indices") or []
    if len(indices) == len(shown):
        told["indices"] = [index for index, seen in zip(indices, shown, strict=True) if seen]
    if entry.get("lattice"):
        lattice = entry["lattice"]
        told["lattice"] = {"base": place(lattice["base"]), "u": step(lattice["u"]), "v": step(lattice["v"])}
    told["alt_objects"] = [
        {"object": other.get("object"), "centers": on_view(other["centers"])}
        for other in entry.get("alt_objects") or []
    ]
    told["rings"] = [
        {
            **ring,
            "center": place(ring["center"]),
            "ellipse_e1": step(ring.get("ellipse_e1", [ring["radius"], 0])),
            "ellipse_e2": step(ring.get("ellipse_e2", [0, ring["radius"]])),
            "centers": on_view(ring["centers"]),
        }
        for ring in entry.get("rings") or []
    ]
    return told


def _image_from_plane(camera: Camera, size: Size) -> Array:
    """The homography [3, 3] from plane pixels, in which annotations are, to pixels."""
    return camera.image_from_plane(size).numpy() @ np.diag([1 / size.unit_px, 1 / size.unit_px, 1.0])


if __name__ == "__main__":
    main()
