"""A set in parts that are alike: to choose on one and report the other."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from p3i.errors import UsageError
from p3i.evaluation.truth import Truth


@dataclass(frozen=True, slots=True)
class Fold:
    """Part `number` of so many parts, from 1."""

    number: int
    parts: int

    @classmethod
    def parse(cls, text: str) -> "Fold":
        """The fold of a text like "1/2". Raises UsageError for any other, and for a part that is none."""
        found = re.fullmatch(r"(\d{1,3})/(\d{1,3})", text)
        number, parts = (int(found[1]), int(found[2])) if found else (0, 0)
        if not 1 <= number <= parts:
            raise UsageError(f"a fold is a part of the set, as 1/2 or 2/2, not {text!r}")
        return cls(number, parts)

    def __str__(self) -> str:
        return f"{self.number}/{self.parts}"

    def of(self, truths: Sequence[Truth]) -> list[Truth]:
        """Those of a set's photos that are in this fold, in the set's order.

        Of each structure, and of those whose pose is reliable and the others apart, the photos are dealt out
        in turn in the order of their names: every fold has as many of each kind, give or take one. A fold
        follows from the set alone, and is the same whatever is searched.
        """
        kinds: dict[tuple[str, bool], list[str]] = {}
        for truth in truths:
            kinds.setdefault((truth.structure, truth.pose_reliable), []).append(truth.file)
        mine: set[str] = set()
        for names in kinds.values():
            mine.update(sorted(names)[self.number - 1 :: self.parts])
        return [truth for truth in truths if truth.file in mine]
