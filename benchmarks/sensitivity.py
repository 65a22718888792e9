"""How much hangs on each tuned number of the search: each times 0.7 and 1.4, over photos and scenes.

python benchmarks/sensitivity.py --count                         # the numbers, by file, and searches nothing
python benchmarks/sensitivity.py --set PHOTOS --out JOURNAL.jsonl          # all of them: a day on two cores
python benchmarks/sensitivity.py --set PHOTOS --fold 1/2 --photos 12 --scenes 6 --sample 15 --jobs 2 --out ...
python benchmarks/sensitivity.py --set PHOTOS --only extent/outline --out JOURNAL.jsonl

A number is every plain one in a constant of a module of p3i/search: alone, in a flat tuple, list or
dictionary, or in a call, but not in a nested list, which is geometry, and not 0. Every change is tried in a
process of its own, which reads the changed module in the place of the written one, so that what is derived
from a number follows it. Whole numbers stay whole and move by 1 at least, as long as they stay above 0.

The journal gets a line for each change; a call that finds it there does not try it again, so it may be
stopped and gone on with, over the same pictures. The report is of all its lines: how far F1 free (the mean
over all pictures, 0 where refused) and the share answered move, the farthest first, and which changes break
off.
"""

import argparse
import ast
import contextlib
import importlib.machinery
import importlib.util
import json
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

SEARCH = Path(__file__).resolve().parent.parent / "p3i" / "search"
FACTORS = (0.7, 1.4)
MOVED = 0.01
"""F1 free may move by so much for ten numbers at most."""
_NESTED = (ast.List, ast.Tuple, ast.Set)


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Constant:
    """A number of a module-level constant: `name` of `module`, its `place` among the constant's numbers.

    `column` and `line` say where in the module's text it stands; they are no part of what it is called.
    """

    module: str
    name: str
    place: int
    value: float
    line: int
    column: int

    @property
    def title(self) -> str:
        """As it is told and looked up."""
        return f"{self.module}:{self.name}" + (f"[{self.place}]" if self.place else "")


def constants_of(text: str, module: str) -> list[Constant]:
    """The numbers of a module's constants: names in capitals that stand in the module itself."""
    found = []
    for statement in ast.parse(text).body:
        for name, value in _named(statement):
            numbers = [(number, node) for number, node in _numbers(value) if number != 0]
            for place, (number, node) in enumerate(numbers):
                at = {"line": node.lineno, "column": node.col_offset}
                found.append(Constant(module=module, name=name, place=place, value=number, **at))
    return found


def _named(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """The constants that a statement assigns, each with its own value."""
    if isinstance(statement, ast.Assign):
        targets, value = statement.targets, statement.value
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        targets, value = [statement.target], statement.value
    else:
        return
    for target in targets:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = list(zip(target.elts, value.elts, strict=True))
        else:
            pairs = [(target, value)]
        for one, its in pairs:
            if isinstance(one, ast.Name) and one.id.isupper():
                yield one.id, its


def _numbers(value: ast.expr, *, within: bool = False) -> Iterator[tuple[float, ast.Constant]]:
    """The numbers of an expression, but for nested sequences and whole ones in arithmetic."""
    match value:
        case ast.Constant(value=int() | float()) if not isinstance(value.value, bool):
            assert isinstance(value.value, int | float)
            yield value.value, value
        case ast.UnaryOp(operand=operand):
            yield from _numbers(operand, within=within)
        case ast.BinOp(left=left, right=right):
            for side in (left, right):
                if not (isinstance(side, ast.Constant) and isinstance(side.value, int)):
                    yield from _numbers(side, within=within)
        case ast.List(elts=parts) | ast.Tuple(elts=parts) | ast.Set(elts=parts):
            if not within and not any(isinstance(part, _NESTED) for part in parts):
                for part in parts:
                    yield from _numbers(part, within=True)
        case ast.Dict(values=parts):
            for part in parts:
                yield from _numbers(part, within=within)
        case ast.Call(args=parts, keywords=named):
            for part in (*parts, *(keyword.value for keyword in named)):
                yield from _numbers(part, within=within)
        case _:
            return


def all_constants(search: Path = SEARCH) -> list[Constant]:
    """The numbers of all modules below a folder, by file and in their order."""
    found = []
    for path in sorted(search.rglob("*.py")):
        module = ".".join(("p3i", "search", *path.relative_to(search).with_suffix("").parts))
        found += constants_of(path.read_text(encoding="utf-8"), module)
    return found


def names_of(constants: Sequence[Constant]) -> set[tuple[str, str]]:
    """The constants by module and name, however many numbers each holds: what the house counts."""
    return {(one.module, one.name) for one in constants}


def changed_value(value: float, factor: float) -> float:
    """The number times a factor; a whole one stays whole, above 0 where it was, and moves by 1 if it can."""
    if not isinstance(value, int):
        return value * factor
    moved = round(value * factor)
    if moved == value:
        moved += 1 if factor > 1 else -1
    return max(moved, 1) if value > 0 else moved


def changed_text(text: str, constant: Constant, value: float) -> ast.Module:
    """A module's tree with one number replaced."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        at = isinstance(node, ast.Constant) and (node.lineno, node.col_offset)
        if at == (constant.line, constant.column) and isinstance(node, ast.Constant):
            assert node.value == constant.value
            node.value = value
            return tree
    raise ValueError(f"{constant.title} is not where it was")


def put(constant: Constant, value: float) -> None:
    """Have the module of a constant imported with another number; nothing of the search is loaded yet."""
    assert not any(name.startswith("p3i.search") for name in sys.modules), "too late"

    class Changed(importlib.machinery.SourceFileLoader):
        """Compiles the changed tree in the place of the text."""

        def get_code(self, fullname: str) -> CodeType | None:
            tree = changed_text(Path(self.path).read_text(encoding="utf-8"), constant, value)
            return compile(tree, self.path, "exec")

    class Finder:
        """Finds the changed module before any other finder does."""

        @staticmethod
        def find_spec(
            name: str, path: object = None, target: ModuleType | None = None
        ) -> importlib.machinery.ModuleSpec | None:
            if name != constant.module:
                return None
            file = str(SEARCH.joinpath(*constant.module.split(".")[2:]).with_suffix(".py"))
            return importlib.util.spec_from_file_location(name, file, loader=Changed(name, file))

    sys.meta_path.insert(0, Finder)  # pyright: ignore[reportArgumentType]


def tried(constant: Constant | None, factor: float, given: argparse.Namespace) -> dict[str, Any]:
    """Search the pictures with one number changed, in this process: F1 free and what was answered."""
    value = None
    if constant is not None:
        value = changed_value(constant.value, factor)
        put(constant, value)
    found = dict(_found(given))
    f1 = [measured for measured in found.values() if measured is not None]
    return {
        "constant": None if constant is None else constant.title,
        "factor": factor,
        "value": value,
        "f1_free": sum(f1) / max(len(found), 1),
        "answered": len(f1) / max(len(found), 1),
        "pictures": found,
    }


def _found(given: argparse.Namespace) -> Iterator[tuple[str, float | None]]:
    """F1 free of each picture's answer, by its name; None where it was refused."""
    import p3i
    from p3i.evaluation.folds import Fold
    from p3i.evaluation.measures import measure
    from p3i.evaluation.scenes import annotation, scene
    from p3i.evaluation.truth import read_truth, truth_of

    def judged(image: Any, truth: Any) -> float | None:
        program = p3i.synth(image).program
        return None if program is None else measure(program, truth).f1_free

    if given.set is not None:
        truths = read_truth(given.set)
        truths = list(truths) if given.fold is None else Fold.parse(given.fold).of(truths)
        random.Random(given.seed).shuffle(truths)
        for truth in truths[: given.photos]:
            photo = given.set / truth.file
            photo = photo if photo.is_file() else given.set / "images" / photo.name
            yield truth.file, judged(p3i.read_image(photo), truth)
    for number in range(given.scenes):
        structure = ("lattice", "circular", "hybrid")[number % 3]
        drawn = scene(structure, 800_000 + number)
        yield f"{structure} {drawn.seed}", judged(drawn.image(), truth_of(annotation(drawn, "scene")))


def run_all(given: argparse.Namespace) -> None:
    """Try every change that the journal has not, each in a process of its own, some side by side."""
    chosen = [
        one for one in all_constants() if given.only is None or given.only in one.title.replace(".", "/")
    ]
    if given.sample is not None and given.sample < len(chosen):
        chosen = sorted(random.Random(given.seed).sample(chosen, given.sample))
    wanted: list[tuple[str | None, float]] = [(None, 1.0)]
    wanted += [(one.title, factor) for one in chosen for factor in FACTORS]
    done = {(line["constant"], line["factor"]) for line in lines_of(given.out)}
    todo = [change for change in wanted if change not in done]
    print(f"{len(chosen)} numbers, {len(todo)} of {len(wanted)} runs to do", flush=True)
    with given.out.open("a", encoding="utf-8") as stream, ThreadPoolExecutor(given.jobs) as pool:
        for line in pool.map(lambda change: _alone(change[0], change[1], given), todo):
            stream.write(json.dumps(line) + "\n")
            stream.flush()
            said = line.get("error") or f"F1 free {line['f1_free']:.3f}, answered {line['answered']:.2f}"
            print(f"{line['constant'] or 'nothing'} x {line['factor']}: {said}", flush=True)


def _alone(title: str | None, factor: float, given: argparse.Namespace) -> dict[str, Any]:
    """A change tried in a fresh process; one that breaks off is a line too."""
    words = [sys.executable, __file__, "--try", json.dumps([title, factor])]
    for name in ("set", "fold", "photos", "scenes", "seed"):
        if (value := getattr(given, name)) is not None:
            words += [f"--{name}", str(value)]
    told: dict[str, Any] = {"constant": title, "factor": factor}
    try:
        ended = subprocess.run(words, capture_output=True, text=True, timeout=given.timeout, check=False)
    except subprocess.TimeoutExpired:
        return told | {"error": f"not done after {given.timeout} s"}
    if ended.returncode:
        return told | {"error": ended.stderr.strip().splitlines()[-1] if ended.stderr else "broke off"}
    return json.loads(ended.stdout.splitlines()[-1])


def lines_of(journal: Path) -> list[dict[str, Any]]:
    """The whole lines of a journal; a last one that a kill cut short is passed over."""
    found = []
    for line in journal.read_text(encoding="utf-8").splitlines() if journal.exists() else ():
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    return found


def report(lines: Sequence[dict[str, Any]]) -> str:
    """The numbers by how far F1 free moves when they change, the farthest first.

    Lines over other pictures than the line without a change are left out, and counted.
    """
    base = next((line for line in lines if line["constant"] is None and "error" not in line), None)
    if base is None:
        return "no line without a change: nothing to compare with"
    moved: dict[str, dict[float, dict[str, Any]]] = {}
    others = 0
    for line in lines:
        if line["constant"] is None:
            continue
        if "error" not in line and line["pictures"].keys() != base["pictures"].keys():
            others += 1
            continue
        moved.setdefault(line["constant"], {})[line["factor"]] = line

    def farthest(title: str) -> tuple[float, float]:
        whole = [line for line in moved[title].values() if "error" not in line]
        if len(whole) < len(moved[title]):
            return float("inf"), 0.0
        f1 = max(abs(line["f1_free"] - base["f1_free"]) for line in whole)
        return f1, max(abs(line["answered"] - base["answered"]) for line in whole)

    told = [
        f"{len(base['pictures'])} pictures: F1 free {base['f1_free']:.3f}, answered {base['answered']:.2f}",
        "| number | F1 free x 0.7 | F1 free x 1.4 | answered x 0.7 | answered x 1.4 |",
        "|---|---|---|---|---|",
    ]
    ranked = sorted(moved, key=farthest, reverse=True)
    for title in ranked:
        cells = []
        for key, form in (("f1_free", "{:+.3f}"), ("answered", "{:+.2f}")):
            for factor in FACTORS:
                line = moved[title].get(factor)
                if line is None or "error" in line:
                    cells.append("-" if line is None else line["error"][:60])
                else:
                    cells.append(form.format(line[key] - base[key]))
        told.append(f"| {title.removeprefix('p3i.search.')} | {' | '.join(cells)} |")
    far = sum(farthest(title)[0] > MOVED for title in ranked)
    told.append(f"{len(ranked)} numbers tried, {far} move F1 free by more than {MOVED} or break off")
    if others:
        told.append(f"{others} lines over other pictures left out")
    return "\n".join(told)


def count(constants: Sequence[Constant]) -> str:
    """How many constants and numbers each file has, and all of them."""
    by_file = Counter(module for module, _ in names_of(constants))
    numbers = Counter(one.module for one in constants)
    lines = [
        f"{module.removeprefix('p3i.search.'):24} {named:4} constants {numbers[module]:4} numbers"
        for module, named in by_file.most_common()
    ]
    return "\n".join([*lines, f"{'all':24} {by_file.total():4} constants {numbers.total():4} numbers"])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", action="store_true", help="say how many there are, and search nothing")
    parser.add_argument("--set", type=Path, help="a folder of annotated photos")
    parser.add_argument("--fold", help="a part of the set, as of p3i eval")
    parser.add_argument("--photos", type=int, help="so many of its photos, by the seed; default: all")
    parser.add_argument("--scenes", type=int, default=0, help="so many rendered scenes, of all structures")
    parser.add_argument("--only", metavar="TEXT", help="numbers whose module/path:NAME contains this")
    parser.add_argument("--sample", type=int, metavar="N", help="so many numbers, by the seed")
    parser.add_argument("--seed", type=int, default=0, help="of the samples")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    parser.add_argument("--timeout", type=float, default=3600, help="seconds for one change")
    parser.add_argument("--out", type=Path, help="the journal, JSON lines")
    parser.add_argument("--report", action="store_true", help="only report what the journal has")
    parser.add_argument("--try", dest="change", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.count:
        print(count(all_constants()))
    elif given.change is not None:
        title, factor = json.loads(given.change)
        constant = next((one for one in all_constants() if one.title == title), None)
        if title is not None and constant is None:
            sys.exit(f"{title} is no number of the search")
        print(json.dumps(tried(constant, factor, given)))
    elif given.out is None or (given.set is None and not given.scenes and not given.report):
        parser.error("name the journal (--out), and pictures: --set, --scenes")
    else:
        if not given.report:
            run_all(given)
        print(report(lines_of(given.out)))


if __name__ == "__main__":
    main()
