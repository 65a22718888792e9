"""Searches that find what a test says, whatever the photo shows."""

import pytest

from p3i.search import synthesize
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best, Found
from p3i.search.forms.sketches import sketches


def finds(patch: pytest.MonkeyPatch, *answers: Answer) -> None:
    """Let every search find these answers and nothing else."""
    sketch = sketches(SearchConfig())[0]
    found = [Found(sketch, None, (answer,)) for answer in answers]  # pyright: ignore[reportArgumentType]
    patch.setattr(synthesize, "searched", lambda _: Best(found))
