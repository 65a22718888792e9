"""Searches that find what a test says, whatever the photo shows."""

from dataclasses import replace

import pytest

from p3i.search import synthesize
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best, Found
from p3i.search.forms.sketches import sketches
from p3i.search.judge.bits import explained_bits
from p3i.search.look.session import Session


def finds(patch: pytest.MonkeyPatch, *answers: Answer, bits: float | None = None) -> None:
    """Let every search find these answers and nothing else, worth what they explain, or so many `bits`."""
    sketch = sketches(SearchConfig())[0]

    def told(look: Session) -> Best:
        if bits is not None:
            worth = dict.fromkeys(answers, bits)
        else:
            worth = {answer: explained_bits(look.evidence, answer) for answer in answers}
        answered = [(replace(answer, worth=worth[answer]),) for answer in answers]
        return Best([Found(sketch, None, one) for one in answered])  # pyright: ignore[reportArgumentType]

    patch.setattr(synthesize, "searched", told)
