"""`p3i edit`: photos and two programs in, the photos with their objects laid anew out."""

from typing import Any

from p3i import api
from p3i.carried import read_program
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.inputs import photos_and_programs
from p3i.cli.pictures import PICTURES, made, prepared
from p3i.errors import UsageError
from p3i.options.edit import EditOptions


@grouped.command("edit")
@inputs.words("PHOTO... [OLD] NEW")
@grouped.group("The objects", options.of(EditOptions, "scale", "focal_mm"))
@grouped.group("What is hidden", inputs.mask(), options.of(EditOptions, "keep_transparent"))
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Lay the objects that the program OLD finds on each PHOTO anew, as the program NEW says.

    What stands where it stood keeps its pixels; the rest of OLD's objects give way to the ground, and copies
    are put where NEW draws. What is transparent or masked is filled first, where it is pattern. NEW is seen
    by OLD's camera unless it names its own. Without OLD it is searched for.
    """
    asked = options.chosen(EditOptions, given)
    found = photos_and_programs(given["words"], most=2)
    if not found.programs:
        raise UsageError("the last word is no program: name the photo, its program, and the new one")
    mask: str | None = given["mask"]
    to = prepared(given, found, alone={"--mask -": mask == "-"}, read=(mask,))
    *olds, new = map(read_program, found.programs)

    def lay_anew(photo: str, update: batch.Update) -> batch.Answer:
        edited = api.edit(photo, olds[0] if olds else None, new, asked, mask=mask, progress=update)
        size, facts = edited.photo.size, f"{int(edited.touched.sum()):,} pixels changed"
        return batch.Answer(
            make=lambda: made(edited.paint(), to.kind, keeps="the others"),
            facts=edited.record,
            notes=(*edited.photo.notes, *edited.notes),
            more=[f"{size.width} x {size.height} px, {facts}"],
        )

    return batch.run(found.photos, lay_anew, to=to, talk=batch.Talk.of(given))
