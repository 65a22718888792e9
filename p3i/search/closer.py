"""A second look, closer: where nothing convinces on all of a large photo, at the part that promises most.

The maps of the first look have 640 pixels at most, so a pattern that fills a fifth of a large photo shows few
pixels a cell, and counts little beside cars and trees. The windows of the first look say where something
repeats; the part of half the photo's sides that holds most of that is searched once more, with lattices only,
as a region of interest would be. The choice among the parts is paid in bits, and bits alone convince: a score
says how alike a few cells are, and some part of any photo has a few that are.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from p3i.search.anew import drawn_anew
from p3i.search.answer import Answer
from p3i.search.forms.asked import asks_for_itself
from p3i.search.judge.accept import beyond_noise, chosen_among
from p3i.search.judge.region import region_px
from p3i.search.look.evidence import FINE, Evidence
from p3i.search.look.part import Box
from p3i.search.look.session import Session
from p3i.search.propose.windows import window_guesses

Search = Callable[[Session], list[Answer]]

PLACES = 5
"""A part of half the sides has so many places along each: an eighth of the photo apart."""

# An answer that reaches the rim of a part is followed by this share of its own width and height beyond.
_BEYOND = 0.5


def looked_closer(session: Session, search: Search) -> tuple[Session, list[Answer]] | None:
    """A session that looks at the most promising part, and what `search` finds there; None where there is no
    closer look.

    There is none for a photo that the finest map holds as it is, nor for what was asked for by name.
    """
    config, part = session.config, session.evidence.part
    lattices = config.structure in ("auto", "lattice") and config.extent_used == "found"
    if (
        part.size.longer <= FINE
        or not lattices
        or isinstance(config.lens, float | int)
        or asks_for_itself(config)
    ):
        return None
    if not session.go_on() or (box := promising_part(session.evidence)) is None:
        return None
    session.tell("looking closer", 0.9)
    session.record("closer", window=dataclasses.astuple(box))
    closer = _through(session, box)
    found = search(closer)
    if not found:
        return closer, []
    around = _with_surroundings(session.evidence, found[0], box)
    closer = _through(session, around)
    if around != box:
        found = [drawn_anew(closer.evidence, answer) for answer in found]
    place = f"{around.width} x {around.height} pixels from ({around.left}, {around.top}) on"
    note = f"found by a closer look at {place}"
    told = [dataclasses.replace(answer, notes=(*answer.notes, note)) for answer in found]
    chosen = [chosen_among(PLACES**2, answer) for answer in told]
    return closer, [answer for answer in chosen if beyond_noise(answer.worth)]


def promising_part(evidence: Evidence) -> Box | None:
    """The part of half the sides of what is looked at in whose windows most repeats; None where nothing does.

    A window speaks by the bits that its lattice saves.
    """
    part = evidence.part
    proposals = window_guesses(evidence)
    if not proposals:
        return None
    size = evidence.image.size
    at = np.array([one.lattice.origin for one in proposals]) * size.unit_px + size.middle - part.corner
    worth = np.array([one.promise for one in proposals])
    width, height = math.ceil(part.size.width / 2), math.ceil(part.size.height / 2)
    best: tuple[float, Box] | None = None
    for top in np.linspace(0, part.size.height - height, PLACES).round().astype(int).tolist():
        for left in np.linspace(0, part.size.width - width, PLACES).round().astype(int).tolist():
            inside = ((at >= (left, top)) & (at < (left + width, top + height))).all(1)
            told = float(worth[inside].sum())
            if best is None or told > best[0]:
                x, y = left + part.corner[0], top + part.corner[1]
                best = told, Box(x, y, x + width, y + height)
    return None if best is None else best[1]


def _through(session: Session, box: Box) -> Session:
    """The session with its eyes on a part of the photo."""
    seen = session.evidence
    config = dataclasses.replace(seen.config, structure="lattice")
    evidence = Evidence(seen.image, config, seen.focal_mm, window=box)
    return dataclasses.replace(session, evidence=evidence, config=config)


def _with_surroundings(evidence: Evidence, answer: Answer, box: Box) -> Box:
    """The box, wider by half of what the answer covers on each side where that reaches its rim."""
    hull = np.array(region_px(answer.program, evidence.image, evidence.focal_mm)).reshape(-1, 2)
    if len(hull) == 0:
        return box
    (x0, y0), (x1, y1) = hull.min(0), hull.max(0)
    part, (across, down) = evidence.part, (_BEYOND * (hull.max(0) - hull.min(0)))
    (left, top), (right, bottom) = part.corner, np.add(part.corner, (part.size.width, part.size.height))
    return Box(
        max(left, math.floor(x0 - across)) if x0 <= box.left else box.left,
        max(top, math.floor(y0 - down)) if y0 <= box.top else box.top,
        min(int(right), math.ceil(x1 + across)) if x1 >= box.right - 1 else box.right,
        min(int(bottom), math.ceil(y1 + down)) if y1 >= box.bottom - 1 else box.bottom,
    )
