"""One extent for every fit: which objects are there, and the program that draws them."""

from dataclasses import replace

from p3i.search.extent.further_rings import with_further_rings
from p3i.search.extent.lattice import drawn_lattice, filling_picture
from p3i.search.extent.ring import drawn_ring
from p3i.search.extent.setting import drawn_as_asked
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.places import curve_score
from p3i.search.fit.settle import with_settled_numbers
from p3i.search.forms.guess import Base
from p3i.search.forms.sketches import Sketched
from p3i.search.look.session import Session


def drawn(look: Session, sketch: Sketched, fit: Fit, base: Base | None) -> Drawn | None:
    """The program that a fit of this sketch means, None where no object is seen; `base`: its start."""
    if look.config.recipe == "paper":
        return filling_picture(look, fit)
    if sketch.gridded:
        return drawn_as_asked(look, fit)
    if sketch.structure == "lattice":
        return drawn_lattice(look, fit)
    found = drawn_ring(look, fit) if base is None else _drawn_rings(look, fit, base)
    return replace(
        found, program=with_settled_numbers(look.evidence, found.program, focal_mm=found.fit.focal_mm)
    )


def _drawn_rings(look: Session, fit: Fit, base: Base) -> Drawn:
    """The program of several rings, with as many as hold."""
    whole = with_further_rings(look, fit)
    # As with rings, how surely it repeats may be told at another radius than the objects'.
    sure = max(curve_score(whole), base.sure * min(1.0, whole.quality / base.quality))
    return Drawn(whole.program(), whole, sure)
