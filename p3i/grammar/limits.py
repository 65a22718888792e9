"""What p3i refuses by name instead of choking on it, and how to raise each limit."""

import os
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limit:
    """A number that a program must not exceed; the environment variable `variable` raises it."""

    variable: str
    default: int

    def value(self) -> int:
        """The limit in force: the environment variable where it holds a positive number, else the default."""
        written = os.environ.get(self.variable, "")
        return (
            int(written) if written.isascii() and written.isdecimal() and int(written) > 0 else self.default
        )

    def advice(self) -> str:
        """The sentence that tells a user how to raise the limit."""
        return f"set the environment variable {self.variable} to raise the limit"


SOURCE = Limit("P3I_MAX_SOURCE", 1_000_000)
"""Characters of a program's text."""

NESTING = Limit("P3I_MAX_NESTING", 100)
"""Brackets inside one another; likewise loops and guards above a draw."""

DRAWS = Limit("P3I_MAX_DRAWS", 1_000_000)
"""Turns of a program's loops, counted before guards."""
