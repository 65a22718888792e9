"""From a lattice that was fitted to programs: the primitive cell, the phase, the extent, and a last fit."""

from p3i.search.config import FEWEST_OBJECTS
from p3i.search.extent.layout import filling_layout, found_layout, layout_fit, refitted, strict_layout
from p3i.search.extent.primitive import primitive
from p3i.search.fit.fitted import Drawn, Fit
from p3i.search.fit.grow import follow
from p3i.search.forms.lattice import Lattice
from p3i.search.forms.layout import Layout
from p3i.search.look.contrast import score_of
from p3i.search.look.session import Session


def drawn_lattice(look: Session, fit: Fit) -> Drawn | None:
    """The surest reading of a fit's ground: with its primitive cell, or either where it may be two."""
    evidence, pattern = look.evidence, fit.pattern
    # The middle of the support is where cells are measured and where the index starts.
    middle = fit.index[fit.support].median(0).values
    theta = Lattice.of(pattern, fit.theta).moved_to(middle.numpy()).theta(pattern)
    selected = fit.index[fit.support] - middle
    last = follow(evidence, pattern, theta, selected, finest=True)
    if last is None or int(last.support.sum()) < FEWEST_OBJECTS:
        return None
    readings = primitive(evidence, pattern, last)
    found = (found_layout(evidence, Lattice.of(pattern, theta), cells) for theta, cells in readings)
    drawn = (_drawn(look, *one) for one in found if one is not None)
    return max((one for one in drawn if one is not None), key=lambda one: one.sure, default=None)


def filling_picture(look: Session, fit: Fit) -> Drawn:
    """A lattice as it is, over the whole picture, as the paper draws all."""
    layout = filling_layout(look.evidence, Layout(Lattice.of(fit.pattern, fit.theta), (0, 1), (0, 1)))
    return Drawn(layout.program(from_zero=not look.config.strict), fit, 0.0)


def _drawn(look: Session, found: Layout, note: str) -> Drawn | None:
    """The program of a layout with its note, under the options that change what is drawn."""
    layout, notes = refitted(look.evidence, found), (note,) if note else ()
    if look.config.strict:
        free, (layout, moved) = layout, strict_layout(layout)
        notes = (*notes, _strict_note(free, layout, moved * look.evidence.image.size.unit_px))
    measured = layout_fit(look.evidence, layout)
    if measured is None:
        return None
    sure = score_of(measured.contrast)
    if look.config.extent_used == "image":
        layout = filling_layout(look.evidence, layout)
    return Drawn(layout.program(from_zero=not look.config.strict), measured, sure, notes, layout.readings)


def _strict_note(free: Layout, strict: Layout, moved_px: float) -> str:
    """What Table 1 cost an answer: how far its objects moved, and the outline that it cannot say."""
    note = f"Table 1 has no constants: the objects lie {moved_px:.1f} pixels from the free fit"
    lost = len(free.guards) - len(strict.guards)
    return f"{note}, and {lost} of its {len(free.guards)} guards cannot be said" if lost else note
