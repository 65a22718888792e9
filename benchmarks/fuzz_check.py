"""Random bytes and damaged programs through `p3i.check`, in one process: no traceback, and the times.

python benchmarks/fuzz_check.py            # 10,000 of each
python benchmarks/fuzz_check.py 200        # a short run
"""

import random
import statistics
import sys
import time
from pathlib import Path

import p3i

SEEDS = sorted((Path(__file__).parent.parent / "tests" / "golden").rglob("*.p3p"))
SNIPPETS = [
    *"()[]{}:;,=*+-/<>~?\"'# \n\tij019e.\0é≥",
    *(
        "for",
        "if",
        "Draw",
        "    ",
        "Cos(",
        "range(0, 99999999)",
        "1e999",
        "??",
        "and",
        "or",
        "SetCameraPose(",
    ),
    *("SetCameraPose(", "# /// p3p\n", "# ///\n", "\r\n", "\ufeff", "\\", "(" * 200, "{" * 200, "-" * 200),
]


def random_bytes(chance: random.Random) -> bytes:
    """Noise: any bytes, printable bytes, or words of the language in any order."""
    kind = chance.randrange(3)
    if kind == 0:
        return chance.randbytes(chance.randint(0, 400))
    if kind == 1:
        return bytes(chance.randint(9, 126) for _ in range(chance.randint(0, 400)))
    return "".join(chance.choice(SNIPPETS) for _ in range(chance.randint(0, 60))).encode()


def damaged(text: str, chance: random.Random) -> str:
    """A program with a few characters taken out, doubled or replaced."""
    for _ in range(chance.randint(1, 6)):
        place = chance.randrange(len(text) + 1)
        length = chance.randint(0, 12)
        match chance.randrange(4):
            case 0:
                text = text[:place] + text[place + length :]
            case 1:
                text = text[: place + length] + text[place:]
            case _:
                text = text[:place] + chance.choice(SNIPPETS) + text[place + chance.randint(0, 2) :]
    return text


def measure(name: str, sources: list[bytes | str]) -> None:
    """Check every source and print the times."""
    seconds: list[float] = []
    for source in sources:
        start = time.perf_counter()
        try:
            p3i.check(source)
        except BaseException:
            print(f"failed on {source!r}", file=sys.stderr)
            raise
        seconds.append(time.perf_counter() - start)
    seconds.sort()
    median, late, worst = statistics.median(seconds), seconds[int(len(seconds) * 0.99)], seconds[-1]
    times = f"median {median * 1e3:.2f} ms   99 % {late * 1e3:.2f} ms   worst {worst:.2f} s"
    print(f"{name:16} {len(sources):6} runs   {times}")


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    chance = random.Random(0)
    programs = [path.read_bytes().decode("utf-8", errors="replace") for path in SEEDS]
    measure("random bytes", [random_bytes(chance) for _ in range(count)])
    measure("damaged programs", [damaged(chance.choice(programs), chance) for _ in range(count)])


if __name__ == "__main__":
    main()
