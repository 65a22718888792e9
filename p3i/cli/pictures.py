"""What the commands share that take photos with a program and write a picture of each."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from p3i.carried import read_program
from p3i.cli import batch
from p3i.cli.inputs import Inputs, photos_and_programs
from p3i.cli.targets import Kinds, Targets, targets
from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.render import KINDS
from p3i.vision.picture_kinds import BY_SUFFIX, LOSSY

if TYPE_CHECKING:
    from p3i.paint.draw.render import RenderedPicture
    from p3i.vision.picture import Picture

PICTURES = Kinds(by_suffix=BY_SUFFIX)
"""Photos that were changed."""

DRAWINGS = Kinds(by_suffix={f".{kind}": kind for kind in KINDS}, text=frozenset({"svg"}))
"""Programs that were drawn."""


@dataclass(frozen=True, slots=True)
class Job:
    """One photo with the program that serves all, or none; the kind of its file; where to report progress."""

    photo: str
    program: Program | None
    kind: str
    update: batch.Update
    program_name: str | None
    one_of_many: bool
    """Whether its answer follows others in one stream."""


def each_photo(
    given: Mapping[str, Any],
    work: Callable[[Job], batch.Answer],
    *,
    kinds: Kinds = PICTURES,
    alone: Mapping[str, object] | None = None,
    read: Iterable[str | None] = (),
) -> int:
    """Do `work` on each photo of the call with its one program, or with none; returns the exit code.

    `alone` are the options that serve one photo only, with what was given for them; `read` other files that
    the call reads. The program is read once, before any photo. Raises as `targets` and `read_program`.
    """
    found = photos_and_programs(given["words"])
    to = prepared(given, found, kinds=kinds, alone=alone, read=read)
    program = None if found.program is None else read_program(found.program)
    talk = batch.Talk.of(given)

    def on_one(photo: str, update: batch.Update) -> batch.Answer:
        return work(Job(photo, program, to.kind, update, found.program, to.answers_in_one))

    return batch.run(found.photos, on_one, to=to, talk=talk)


def prepared(
    given: Mapping[str, Any],
    found: Inputs,
    *,
    kinds: Kinds = PICTURES,
    alone: Mapping[str, object] | None = None,
    read: Iterable[str | None] = (),
) -> Targets:
    """Where the answers go; raises UsageError for options of `alone` where there are several photos."""
    if len(found.photos) > 1:
        for option, value in (alone or {}).items():
            if value not in (None, (), False):
                raise UsageError(f"{option} takes one photo, not {len(found.photos)}")
    return targets(given, inputs=found.photos, kinds=kinds, read=(*found.programs, *read))


def drawn(picture: "RenderedPicture", kind: str) -> batch.Answer:
    """A drawn program as an answer in a file of `kind`."""
    size, camera = picture.size, picture.camera
    facts = f"{size.width} x {size.height} px, focal {camera.focal_mm:g} mm ({picture.focal_source})"
    return batch.Answer(
        make=lambda: batch.Made(picture.encode(kind)),
        facts=picture.record,
        notes=picture.notes,
        more=[facts],
    )


def made(picture: "Picture", kind: str, *, keeps: str = "") -> batch.Made:
    """A picture as a file of `kind`, with what such a file loses; `keeps` names pixels that should stay."""
    anew = stored_anew(kind, keeps) if keeps else ()
    return batch.Made(picture.encode(kind), (*anew, *picture.notes(kind)))


def stored_anew(kind: str, whose: str) -> Sequence[str]:
    """The note on a kind of file that keeps no pixel to the bit."""
    if kind not in LOSSY:
        return ()
    return (f"{kind.upper()} stores every pixel anew: write PNG or TIFF to keep {whose}",)
