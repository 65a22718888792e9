"""Other patterns on the same photo: the answer is the dominant one, and says where another lies.

A photo of a house's corner shows two facades, of a room floor and wall. One program has one plane, so the
others are told as a note. They come for free: fits that grew elsewhere while the answer's was looked for.
"""

import dataclasses
import math
from collections.abc import Callable

import cv2
import numpy as np
import torch

from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.fit.fitted import Fit
from p3i.search.judge.region import centers_px, region_px
from p3i.search.look.cells import sample_points
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import NEEDED

# A fit lies elsewhere where at most this share of its cells falls into the answer's region.
_MOST_INSIDE = 0.3
# Fits that explain this much of the photo (as in lattices.py) are worth working out for a note ...
_LEAST_SCORE = 0.02
# ... and planes whose normals differ by more than this are two.
_OTHER_PLANE_DEG = 8.0

Finish = Callable[[Session, Fit], Answer | None]


def with_note_of_others(
    session: Session, fits: list[Fit], answers: list[Answer], *, finish: Finish
) -> list[Answer]:
    """The answers, the best first, of which the first says whether another pattern lies beside its own.

    `fits` are all that were grown, the best first; `finish` works one out to a program. A pattern is told of
    only where its own program reaches what an answer needs.
    """
    if not answers or answers[0].score < NEEDED:
        return answers
    first, evidence = answers[0], session.evidence
    region = _polygon(evidence, first)
    for other in answers[1:]:
        if other.score >= NEEDED and _inside(region, _centers(evidence, other)) <= _MOST_INSIDE:
            return [_noted(evidence, first, other), *answers[1:]]
    for fit in fits:
        if fit.covered < _LEAST_SCORE or not session.go_on():
            break
        if _inside(region, _cells_px(evidence, fit)) > _MOST_INSIDE:
            continue
        other = finish(session, fit)
        if other is not None and other.score >= NEEDED:
            return [_noted(evidence, first, other), *answers[1:]]
    return answers


def _noted(evidence: Evidence, first: Answer, other: Answer) -> Answer:
    cosine = sum(
        a * b for a, b in zip(*(Camera.of(one.program).normal for one in (first, other)), strict=True)
    )
    turned = math.degrees(math.acos(max(-1.0, min(1.0, cosine)))) > _OTHER_PLANE_DEG
    places = evidence.on_photo(torch.from_numpy(_centers(evidence, other)))
    x, y = np.median(places.numpy(), axis=0)
    where = f"around ({x:.0f}, {y:.0f})"
    note = f"another plane carries a pattern, {where}" if turned else f"another pattern lies {where}"
    return dataclasses.replace(first, notes=(*first.notes, note))


def _polygon(evidence: Evidence, answer: Answer) -> np.ndarray:
    """The region of an answer, [M, 2] pixels of what was looked at."""
    focal_mm = answer.focal_mm or evidence.focal_mm
    return np.array(region_px(answer.program, evidence.image, focal_mm), np.float32).reshape(-1, 2)


def _centers(evidence: Evidence, answer: Answer) -> np.ndarray:
    """The objects of an answer, [N, 2] pixels of what was looked at."""
    focal_mm = answer.focal_mm or evidence.focal_mm
    return np.array(centers_px(answer.program, evidence.image, focal_mm)).reshape(-1, 4)[:, :2]


def _cells_px(evidence: Evidence, fit: Fit) -> np.ndarray:
    """The middles of the cells of a fit's support, [N, 2] pixels of what was looked at."""
    level = evidence.frame
    points, _ = sample_points(level, fit.pattern, fit.theta, fit.index[fit.support])
    back = torch.linalg.inv(level.map_from_photo)
    return (points @ back[:2, :2].T + back[:2, 2]).numpy()


def _inside(region: np.ndarray, points: np.ndarray) -> float:
    """The share of the points [N, 2] that lie in the polygon [M, 2]; 1 where either is empty."""
    if len(region) < 3 or len(points) == 0:
        return 1.0
    inside = [cv2.pointPolygonTest(region, (float(x), float(y)), False) >= 0 for x, y in points]
    return float(np.mean(inside))
