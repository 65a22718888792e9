"""Grids of camera poses."""

import math

from p3i.interp.camera import Camera


def pose_grid(step_deg: float, most_tilt_deg: float) -> list[tuple[float, float]]:
    """(rx, ry) in degrees, about `step_deg` apart when seen straight on and evenly in foreshortening:
    the steps shrink as the tilt grows, up to `most_tilt_deg`.
    """
    poses = [(0.0, 0.0)]
    tilt, ring = 0.0, 0
    while True:
        tilt += step_deg * math.sqrt(math.cos(math.radians(tilt)))
        if tilt > most_tilt_deg:
            return poses
        sine, cosine = math.sin(math.radians(tilt)), math.cos(math.radians(tilt))
        count = max(6, round(2 * math.pi * sine / math.radians(step_deg)))
        for step in range(count):
            around = 2 * math.pi * (step + 0.5 * (ring % 2)) / count
            camera = Camera.from_normal((sine * math.cos(around), sine * math.sin(around), cosine))
            poses.append((camera.rx_deg, camera.ry_deg))
        ring += 1
