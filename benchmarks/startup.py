"""The CPU time of `p3i --help`, `check` and `fmt`, each in fresh processes: below 0.25 s on an idle core.

python benchmarks/startup.py
"""

import resource
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROGRAM = str(ROOT / "examples" / "tiles.p3p")
FAULTY = str(ROOT / "tests" / "golden" / "errors" / "many_problems_in_one_run.p3p")
COMMANDS = (["--help"], ["check", PROGRAM], ["check", FAULTY], ["fmt", "--check", PROGRAM])
RUNS = 9


def cpu_seconds(words: list[str]) -> float:
    """User and system time of one process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = "from p3i.cli.main import main; main()"
    subprocess.run([sys.executable, "-c", start, *words], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    for words in COMMANDS:
        cpu_seconds(words)  # the first run may compile to bytecode
        seconds = [cpu_seconds(words) for _ in range(RUNS)]
        name = " ".join(Path(word).name for word in words)
        print(f"p3i {name:40} median {statistics.median(seconds):.3f} s   least {min(seconds):.3f} s")


if __name__ == "__main__":
    main()
