"""A search as a moving picture: each program that was weighed, drawn over the photo, with a line of words.

Whatever the step weighed (a lattice, a ring, a filled sketch) is drawn by the same code, the interpreter's.
"""

import io
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pil
from PIL import ImageDraw, ImageFont

from p3i.errors import FileError, UsageError
from p3i.files import read_text
from p3i.interp.camera import Camera
from p3i.interp.unroll import edges, points
from p3i.paint.draw.steps import Search, Step, read_steps
from p3i.paint.draw.view import camera_view, clip_to_canvas
from p3i.size import Size
from p3i.vision.image import read_image
from p3i.vision.write import encode

KINDS = (".gif", ".png")
"""A moving picture, or a contact sheet."""
LONGER = 640
"""The longer side of a frame is at most so many pixels."""
MOST_FRAMES = 60
"""Of more steps, so many are shown, evenly chosen."""

_STEP_MS, _FIT_MS, _ANSWER_MS = 180, 260, 3000
_STRIP = 22
"""The height of the words below the picture."""
_PALE = 0.55
"""How much of the photo's contrast is left under what is drawn on it."""
_MOST_POINTS = 4000
_COLOURS_IN_ALL = 96
_SHEET_FRAMES, _SHEET_WIDTH = 12, 320

Colour = tuple[int, int, int]
_COLOURS: dict[str, Colour] = {"answer": (38, 166, 91), "fit": (30, 120, 220), "candidate": (30, 120, 220)}
_TRIED: Colour = (232, 126, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """A search in pictures: frames (uint8 [H, W, 3]) with milliseconds, and remarks for the user."""

    frames: tuple[tuple[np.ndarray, int], ...]
    notes: tuple[str, ...] = ()

    def encode(self, kind: str) -> bytes:
        """The file's bytes: ".gif" moves, ".png" is a contact sheet. Raises UsageError for other kinds."""
        if kind not in KINDS:
            raise UsageError(
                f"a search is drawn as {' or '.join(KINDS)}, not as {kind or 'a file without suffix'}"
            )
        return as_gif(self.frames) if kind == ".gif" else encode(contact_sheet(self.frames), kind=kind)


def film_of(trace: Path, *, image: str | None = None) -> Film:
    """The film of the trace in a file.

    The photo is `image`, else the one that the trace names, looked for from the working folder and from the
    trace's; where it is gone the ground is blank, and `notes` says so. Of the searches of several photos
    `image` picks one by its name. Raises FileError for a trace or an `image` that cannot be read, UsageError
    where several searches leave a choice.
    """
    searches = read_steps(io.StringIO(read_text(trace)), name=str(trace))
    search = _chosen(searches, image, trace)
    notes: list[str] = []
    if not search.ended:
        notes.append("the trace holds no answer: the search was cut short")
    pixels, note = _photo(search, image, trace.parent)
    return Film(tuple(frames(search, pixels)), tuple(notes + ([note] if note else [])))


def _chosen(searches: tuple[Search, ...], image: str | None, trace: Path) -> Search:
    if len(searches) == 1:
        return searches[0]
    same = [one for one in searches if image in (one.image, Path(one.image).name)]
    same = same or [one for one in searches if image and Path(one.image).name == Path(image).name]
    if len(same) != 1:
        names = ", ".join(one.image or "(no name)" for one in searches[:4])
        more = ", ..." if len(searches) > 4 else ""
        raise UsageError(f"{trace} holds {len(searches)} searches ({names}{more}); --image says which")
    return same[0]


def _photo(search: Search, image: str | None, beside: Path) -> tuple[np.ndarray | None, str]:
    """The photo as uint8 [H, W, 3], or None with a remark."""
    places = [Path(image)] if image else [Path(search.image), beside / search.image] if search.image else []
    place = next((one for one in places if os.path.isfile(one)), None)
    if place is None and image:
        place = Path(image)  # whose reader says what is wrong
    if place is None:
        return None, f"the photo {search.image or '(without a name)'} is not here: the ground stays blank"
    photo = read_image(place)
    if photo.size != search.size:
        found, wanted = (f"{one.width} x {one.height}" for one in (photo.size, search.size))
        raise FileError(f"{place} has {found} pixels, the photo of this search had {wanted}")
    return np.rint(np.clip(photo.pixels, 0, 1) * 255).astype(np.uint8), ""


def frames(search: Search, photo: np.ndarray | None) -> list[tuple[np.ndarray, int]]:
    """The pictures (uint8 [H, W, 3]) of a search, and how long each is shown, in milliseconds.

    `photo` is uint8 [H, W, 3] with the canvas of the search; None gives a blank one. Raises ValueError for a
    photo of another size.
    """
    if photo is not None and photo.shape[:2] != (search.size.height, search.size.width):
        raise ValueError(f"a photo of {search.size} is needed, not {photo.shape[1]} x {photo.shape[0]}")
    scale = min(1.0, LONGER / search.size.longer)
    size = Size(max(1, round(search.size.width * scale)), max(1, round(search.size.height * scale)))
    ground = np.full((size.height, size.width, 3), 255, np.uint8)
    if photo is not None:
        small = cv2.resize(photo, (size.width, size.height), interpolation=cv2.INTER_AREA)
        ground = np.rint(255 + _PALE * (small.astype(np.float32) - 255)).astype(np.uint8)
    shown = [step for step in search.steps if step.program is not None or step.name == "answer"]
    chosen = evenly(len(shown), MOST_FRAMES)
    made = [
        (_frame(ground, shown[place], words=f"{place + 1}/{len(shown)}"), _duration(shown[place]))
        for place in chosen
    ]
    return made or [(_with_words(ground, "nothing was tried"), _ANSWER_MS)]


def evenly(count: int, most: int) -> list[int]:
    """Positions 0..count-1, at most `most` of them, evenly spread, the first and the last included."""
    if count <= most:
        return list(range(count))
    return [round(place * (count - 1) / (most - 1)) for place in range(most)]


def as_gif(pictures: Sequence[tuple[np.ndarray, int]]) -> bytes:
    """Frames, each uint8 [H, W, 3] with its milliseconds, as one animated GIF that runs for ever."""
    # One palette for all frames keeps the photo still while the drawing moves.
    few = [pictures[place][0] for place in evenly(len(pictures), 5)]
    palette = Pil.fromarray(np.concatenate(few)).quantize(_COLOURS_IN_ALL)
    first, *others = [
        Pil.fromarray(picture).quantize(palette=palette, dither=Pil.Dither.NONE) for picture, _ in pictures
    ]
    stream = io.BytesIO()
    durations = [duration for _, duration in pictures]
    first.save(stream, "GIF", save_all=True, append_images=others, duration=durations, loop=0, disposal=1)
    return stream.getvalue()


def contact_sheet(pictures: Sequence[tuple[np.ndarray, int]]) -> np.ndarray:
    """The frames side by side, at most a dozen of them: uint8 [H, W, 3]."""
    chosen = [pictures[place][0] for place in evenly(len(pictures), _SHEET_FRAMES)]
    width = min(_SHEET_WIDTH, chosen[0].shape[1])
    height = max(1, round(chosen[0].shape[0] * width / chosen[0].shape[1]))
    across = math.ceil(math.sqrt(len(chosen)))
    down = math.ceil(len(chosen) / across)
    sheet = np.full((down * (height + 4) + 4, across * (width + 4) + 4, 3), 255, np.uint8)
    for place, picture in enumerate(chosen):
        top, left = (
            4 + part * (side + 4) for part, side in zip(divmod(place, across), (height, width), strict=True)
        )
        small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
        sheet[top : top + height, left : left + width] = small
    return sheet


def _duration(step: Step) -> int:
    return {"answer": _ANSWER_MS, "fit": _FIT_MS, "candidate": _FIT_MS}.get(step.name, _STEP_MS)


def _frame(ground: np.ndarray, step: Step, *, words: str) -> np.ndarray:
    """One step over the photo: its objects as dots, the steps between neighbours as lines."""
    parts = [words, step.name]
    picture = ground.copy()
    if step.program is not None:
        pose = step.program.camera
        parts += [f"rx {pose.rx_deg:.1f}  ry {pose.ry_deg:.1f}"]
        _draw(picture, step, _COLOURS.get(step.name, _TRIED))
    elif step.reason:
        parts.append(step.reason)
    if step.score is not None:
        parts.append(f"score {step.score:.2f}")
    return _with_words(picture, "   ".join(parts))


def _draw(picture: np.ndarray, step: Step, colour: Colour) -> None:
    assert step.program is not None
    size = Size(picture.shape[1], picture.shape[0])
    drawn = points(step.program)[:_MOST_POINTS]
    if not drawn:
        return
    view = camera_view(Camera.of(step.program, focal_mm=step.focal_mm), size)
    plane = np.array([point[:2] for point in drawn], np.float64)
    pairs = np.array(edges([point[2:] for point in drawn]), np.int64).reshape(-1, 2)
    lines = clip_to_canvas(view.project_segments(plane[pairs]), size)
    fixed = np.rint(lines * 16).astype(np.int32)  # four bits of fractions of a pixel
    for start, end in fixed:
        cv2.line(picture, tuple(map(int, start)), tuple(map(int, end)), colour, 1, cv2.LINE_AA, shift=4)
    pixels, depth = view.project(plane)
    seen = (depth > 0) & (np.abs(np.nan_to_num(pixels, nan=1e9)) < 4 * size.longer).all(1)
    radius = 16 * (4 if step.name == "answer" else 3)
    for x, y in np.rint(pixels[seen] * 16).astype(int):
        cv2.circle(picture, (int(x), int(y)), radius, (255, 255, 255), -1, cv2.LINE_AA, shift=4)
        cv2.circle(picture, (int(x), int(y)), radius - 16, colour, -1, cv2.LINE_AA, shift=4)


def _with_words(picture: np.ndarray, words: str) -> np.ndarray:
    """The picture with a strip of words below it."""
    strip = Pil.new("RGB", (picture.shape[1], _STRIP), (25, 28, 38))
    ImageDraw.Draw(strip).text((6, 4), words, fill=(255, 255, 255), font=ImageFont.load_default())
    return np.concatenate([picture, np.asarray(strip)])
