"""Other patterns on the same photo: the answer is the dominant one, and says where others lie.

A photo of a house's corner shows two facades, a hall a dozen boards. One program has one plane, so the others
are told beside it. They come nearly for free: fits that grew elsewhere while the answer's was looked for.
"""

import dataclasses
from collections.abc import Callable

import cv2
import numpy as np
import torch

from p3i.search.answer import Answer
from p3i.search.fit.fitted import Fit, as_large_as_seen
from p3i.search.judge.accept import beyond_noise
from p3i.search.judge.region import objects_px, region_px
from p3i.search.look.cells import sample_points
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.result import Other

Finish = Callable[[Session, Fit], Answer | None]


def with_others(session: Session, fits: list[Fit], answers: list[Answer], *, finish: Finish) -> list[Answer]:
    """The answers, the best first, of which the first knows, and says, which patterns lie beside its own.

    `fits` are all that were grown, the best first; `finish` works one out to a program. A pattern is told of
    only where its own program reaches what an answer needs, and once; one that says more than the first
    answer takes its place.
    """
    if not answers or not beyond_noise(answers[0].worth):
        return answers
    evidence = session.evidence
    met, regions = [answers[0]], [_polygon(evidence, answers[0])]

    def elsewhere(points: np.ndarray) -> bool:
        """Whether at most half of the points [N, 2] lie in the region of any pattern that was met."""
        return all(_inside(region, points) <= 1 / 2 for region in regions)

    def keep(other: Answer) -> None:
        if beyond_noise(other.worth) and elsewhere(_centers(evidence, other)):
            regions.append(_polygon(evidence, other))
            met.append(other)

    for other in answers[1:]:
        keep(other)
    for fit in fits:
        if not session.go_on():
            break
        if not elsewhere(_cells_px(evidence, fit)):
            continue
        other = finish(session, fit)
        if other is not None:
            keep(other)
    if len(met) == 1:
        return answers
    size = evidence.part.size
    shares = [cv2.contourArea(region) / (size.width * size.height) for region in regions]
    first = max(range(len(met)), key=lambda k: as_large_as_seen(met[k].worth, shares[k]))
    told = tuple(_told(evidence, met[k], regions[k]) for k in range(len(met)) if k != first)
    dominant, notes = met[first], (*met[first].notes, _note(told))
    rest = [one for one in answers if one is not dominant]
    return [dataclasses.replace(dominant, notes=notes, others=told), *rest]


def _told(evidence: Evidence, answer: Answer, region: np.ndarray) -> Other:
    """An answer on its region [M, 2] as what lies beside another, on the photo as it is."""
    centers, region = (
        evidence.on_photo(torch.from_numpy(points.astype(float))).numpy()
        for points in (_centers(evidence, answer), region)
    )
    x, y = np.median(centers, axis=0).tolist()
    return Other(
        structure=answer.structure,
        center=(x, y),
        region=tuple((float(px), float(py)) for px, py in region),
        objects=len(centers),
        score=answer.score,
    )


def _note(others: tuple[Other, ...]) -> str:
    """The sentence that tells of others."""
    where = ", ".join(f"({x:.0f}, {y:.0f})" for x, y in (other.center for other in others))
    if len(others) > 1:
        return f"{len(others)} other patterns lie around {where}: synth --all gives each its program"
    return f"another pattern lies around {where}: synth --all gives it a program too"


def _polygon(evidence: Evidence, answer: Answer) -> np.ndarray:
    """The region of an answer, [M, 2] pixels of what was looked at."""
    focal_mm = answer.focal_mm or evidence.focal_mm
    return np.array(region_px(answer.program, evidence.image, focal_mm), np.float32).reshape(-1, 2)


def _centers(evidence: Evidence, answer: Answer) -> np.ndarray:
    """The objects of an answer, [N, 2] pixels of what was looked at."""
    return objects_px(answer, evidence.image, evidence.focal_mm)[:, :2]


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
