"""`p3i tile`: photos in, seamless textures of their patterns' cells out."""

from typing import Any

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import PICTURES, Job, each_photo, made
from p3i.options.tile import TileOptions


@grouped.command("tile")
@inputs.words("PHOTO... [PROG]")
@grouped.group("The tile", options.of(TileOptions))
@targets.written(PICTURES, "Where to write the picture.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Make the smallest rectangle that the pattern of PHOTO repeats in, by the program PROG, into a texture.

    Without PROG the program is searched for. Of rings it is the sector of one object, unrolled: the angle to
    the right, the radius down; that wraps from side to side. How well the texture wraps is said on stderr.
    """
    asked = options.chosen(TileOptions, given)

    def cut(job: Job) -> batch.Answer:
        found = api.tile(job.photo, job.program, asked, progress=job.update)
        shear = found.record()["shear_deg"]
        skewed = "" if shear is None else f", skewed by {shear:.1f} degrees"
        size = f"{found.size.width} x {found.size.height} px of {len(found.used)} cells"
        return batch.Answer(
            make=lambda: made(found.paint(), job.kind),
            facts=found.record,
            notes=found.notes,
            info=[found.seam.sentence()],
            more=[f"{size}{skewed}"],
        )

    return each_photo(given, cut)
