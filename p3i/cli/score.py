"""`p3i score`: how well programs explain photos."""

import json
from typing import Any

import click

from p3i import api
from p3i.cli import batch, grouped, inputs, options, targets
from p3i.cli.pictures import Job, each_photo
from p3i.cli.targets import Kinds
from p3i.search.config import SearchConfig

SCORES = Kinds(
    by_suffix={".txt": "text", ".json": "json"},
    endings={"text": ".txt"},
    text=frozenset({"text", "json"}),
    lines=frozenset({"text", "json"}),
    what="form of the numbers",
)


@grouped.command("score")
@inputs.words("PHOTO... [PROG]")
@grouped.group(
    "The score",
    click.option(
        "--focal",
        "focal_mm",
        type=float,
        metavar="MM",
        help="35 mm-equivalent focal length; by default the program's, else that of the photo, else 35.",
    ),
    options.of(SearchConfig, "features", "weights", "threads"),
)
@targets.written(SCORES, "Where to write the numbers.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Compare each PHOTO with itself at the neighbouring draws of the program PROG.

    Prints the agreement: the mean over the objects of how much better the others predict them than half
    a step away, 0 to 1, more is better. It is evidence that the program is right, not how likely that is,
    which the score of `p3i synth` says. And prints equation 2 of the paper as printed there: the sum of
    squared feature differences over the edges; less is better, but a smaller pattern has less too.
    Without PROG the program is searched for.
    """
    config = options.chosen(SearchConfig, given)

    def judge(job: Job) -> batch.Answer:
        found = api.score(job.photo, job.program, config, progress=job.update)
        facts = {
            "image": job.photo,
            "program": job.program_name,
            "equation2": found.equation2,
            "edges": found.edges,
            "agreement": found.agreement,
            "features": config.features_used,
        }
        lines = (
            f"agreement   {found.agreement:.4f}   of the objects with each other; more is better",
            f"equation 2  {found.equation2:.6g}   over {found.edges} edges, as printed; less is better",
        )
        if job.one_of_many:
            lines = (f"{job.photo}:", *lines)
        text = json.dumps(facts) if job.kind == "json" else "\n".join(lines)
        return batch.Answer(
            make=lambda: batch.Made(f"{text}\n".encode()),
            facts=lambda: facts,
            notes=found.notes,
            more=[f"{found.objects} objects in sight"],
        )

    return each_photo(given, judge, kinds=SCORES)
