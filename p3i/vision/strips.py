"""Parts of a large picture: so many rows at a time, and windows that are a little wider.

Convention: pictures [H, W, ...]; a window is its rows and columns.
"""

from collections.abc import Iterator

Window = tuple[slice, slice]

ROWS = 256
"""So many rows are one strip, where nothing else is said."""


def strips_of(height: int, rows: int = ROWS) -> Iterator[slice]:
    """The rows of a picture, so many at a time."""
    for start in range(0, height, rows):
        yield slice(start, min(height, start + rows))


def wider_by(window: Window, by_px: int, shape: tuple[int, ...]) -> Window:
    """The window with so many pixels more on each side, as far as the picture [H, W] goes."""
    rows, columns = (
        slice(max(0, part.start - by_px), min(side, part.stop + by_px))
        for part, side in zip(window, shape[:2], strict=True)
    )
    return rows, columns


def within(window: Window, wider: Window) -> Window:
    """A window as one of a wider one."""
    rows, columns = (
        slice(part.start - more.start, part.stop - more.start)
        for part, more in zip(window, wider, strict=True)
    )
    return rows, columns


def clipped(window: Window, limits: Window) -> Window:
    """The part of a window that lies in another."""
    rows, columns = (
        slice(max(part.start, end.start), min(part.stop, end.stop))
        for part, end in zip(window, limits, strict=True)
    )
    return rows, columns
