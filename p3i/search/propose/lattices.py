"""Where lattices may be: guesses from views and from windows, the promising ones first and in turn."""

from collections.abc import Iterator
from dataclasses import replace

from p3i.search.fit.best import Best
from p3i.search.fit.fitting import certain
from p3i.search.forms.guess import Guess
from p3i.search.look.session import Session
from p3i.search.propose.windows import SIDE, straightened_guesses, window_guesses

# So many guesses of each kind are looked at.
_MOST = 10


def lattice_rounds(look: Session, best: Best) -> Iterator[Iterator[Guess]]:
    """The guesses of views and windows; where no fit of them is certain, those of windows half as wide.

    A small pattern fills no window of the first kind, and what lies around it speaks there as well. There are
    four times as many such windows, and one of them shows something by chance in any picture: what comes of
    them counts where it is certain.
    """
    yield lattice_guesses(look)
    if look.go_on() and not any(certain(fit) for fit in best.fits):
        guesses = _beside_the_best(window_guesses(look.evidence, side=SIDE // 2)[:_MOST])
        yield (replace(guess, doubted=True) for guess in guesses)


def lattice_guesses(look: Session) -> Iterator[Guess]:
    """The guesses of both kinds in turn, each kind's best first."""
    look.tell("looking through windows", 0.02)
    windows = _beside_the_best(window_guesses(look.evidence)[:_MOST])
    look.tell("straightening", 0.1)
    views = _beside_the_best(straightened_guesses(look.evidence)[:_MOST])
    for place in range(_MOST):
        yield from views[place : place + 1]
        yield from windows[place : place + 1]


def _beside_the_best(guesses: list[Guess]) -> list[Guess]:
    """The guesses of one kind, the best first, each with its promise as a share of the best one's."""
    return [replace(guess, promise=guess.promise / guesses[0].promise) for guess in guesses]
