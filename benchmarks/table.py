"""Turn the results of scored photo sets into the Markdown tables of docs/benchmarks.md.

python benchmarks/table.py oriented=results.json rgb=rgb.json --annotations annotations.json

A results file is what `p3i eval --out` writes: `rows`, one a photo, with the measures that
docs/benchmarks.md explains, and the CPU seconds (`cpu`) and peak memory (`peak_mb`) of the whole run. The
annotations tell the kind of each photo: those of boards and printed grids have a `category`. The first file
gives the table by kind, all give a line each of the second table.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Row = dict[str, Any]

KINDS: tuple[tuple[str, Callable[[Row], bool]], ...] = (
    ("all lattices", lambda row: row["structure"] == "lattice"),
    ("- boards, printed grids", lambda row: row["structure"] == "lattice" and row["printed"]),
    ("- facades, floors, objects", lambda row: row["structure"] == "lattice" and not row["printed"]),
    ("rings", lambda row: row["structure"] != "lattice"),
)

MEASURES = (
    "photos | answered | pose, mean of the answered | median of all | under 2 degrees | right lattice "
    "| Chamfer of the answered | F1 | F1 free"
)


def measures(rows: Sequence[Row]) -> str:
    """The cells of one line of a table, in the order of MEASURES."""
    answered = [row for row in rows if not row.get("error")]
    reliable = [row for row in rows if row["pose_reliable"]]

    def mean(key: str, among: Sequence[Row]) -> float:
        values = [row[key] for row in among if row.get(key) is not None]
        return float(np.mean(values))

    if not answered:
        return f"{len(rows)} | 0" + " | -" * (MEASURES.count("|") - 1)
    poses = np.array([row["pose_deg"] for row in reliable])
    return " | ".join(
        (
            f"{len(rows)}",
            f"{len(answered)}",
            f"{mean('pose_deg', [row for row in reliable if row in answered]):.2f}",
            f"{np.median(poses):.2f}",
            f"{np.mean(poses < 2):.0%}",
            f"{mean('lattice_ok', rows):.0%}" if rows[0]["structure"] == "lattice" else "-",
            f"{mean('chamfer', answered):.3f}",
            f"{mean('f1', rows):.2f}",
            f"{mean('f1_free', rows):.2f}",
        )
    )


def head(first: str, more: str = "") -> str:
    """The two lines that open a table."""
    cells = f"| {first} | {MEASURES}{more} |"
    return f"{cells}\n{'|---' * (cells.count('|') - 1)}|"


def read_rows(results: Path, kinds: dict[str, bool]) -> tuple[list[Row], dict[str, Any]]:
    """The rows of a results file, each with `printed` beside it, and the whole file."""
    told = json.loads(results.read_text())
    return [{**row, "printed": kinds[row["file"]]} for row in told["rows"]], told


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", nargs="+", help="NAME=FILE of one run each")
    parser.add_argument("--annotations", type=Path, required=True, help="the truth of the photo set")
    given = parser.parse_args()
    annotations = json.loads(given.annotations.read_text())
    kinds = {photo["file"]: bool(photo.get("category")) for photo in annotations}
    runs = []
    for name, _, file in (text.partition("=") for text in given.results):
        rows, told = read_rows(Path(file), kinds)
        cost = f"{told['cpu'] / len(rows):.1f} | {told['peak_mb'] / 1000:.2f}" if told.get("cpu") else "- | -"
        runs.append((name, rows, cost))
    print(head("photos of"))
    for kind, belongs in KINDS:
        if chosen := [row for row in runs[0][1] if belongs(row)]:
            print(f"| {kind} | {measures(chosen)} |")
    print("\n" + head("features", " | CPU s a photo | peak GB"))
    for name, rows, cost in runs:
        lattices = [row for row in rows if row["structure"] == "lattice"]
        print(f"| `{name}` | {measures(lattices)} | {cost} |")


if __name__ == "__main__":
    main()
