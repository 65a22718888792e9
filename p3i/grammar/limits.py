"""What p3i refuses by name instead of choking on it, and how to raise each limit."""

import os
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limit:
    """A number that a program must not exceed; the environment variable `variable` raises it."""

    variable: str
    default: int
    ceiling: int | None = None

    def value(self) -> int:
        """The limit in force: the environment variable where it holds a positive number, else the default."""
        written = os.environ.get(self.variable, "")
        if not (written.isascii() and written.isdecimal() and len(written) < 20 and int(written) > 0):
            return self.default
        return int(written) if self.ceiling is None else min(int(written), self.ceiling)

    def advice(self) -> str:
        """The sentence that tells a user how to raise the limit."""
        most = f" (up to {self.ceiling:,})" if self.ceiling is not None else ""
        return f"set the environment variable {self.variable} to raise the limit{most}"


SOURCE = Limit("P3I_MAX_SOURCE", 100_000)
"""Characters of a program's text."""

NESTING = Limit("P3I_MAX_NESTING", 100, ceiling=200)
"""Brackets inside one another; likewise loops and guards above a draw. Python's stack sets the ceiling."""

SETTINGS = Limit("P3I_MAX_SETTINGS", 4000)
"""Numbers that one whole hole of a sketch may be, and ways to choose those in `Draw`: each is looked at."""

DRAWS = Limit("P3I_MAX_DRAWS", 1_000_000)
"""Turns of a program's loops, counted before guards."""
