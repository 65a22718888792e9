"""Places in a program's text: offsets to lines and columns."""

from bisect import bisect_right


def line_starts(source: str) -> list[int]:
    """Offsets at which the lines of `source` begin; LF, CRLF and CR end a line, as in the grammar."""
    starts = [0]
    for offset, character in enumerate(source):
        if character == "\n" or (character == "\r" and source[offset + 1 : offset + 2] != "\n"):
            starts.append(offset + 1)
    return starts


def line_and_column(offset: int, starts: list[int]) -> tuple[int, int]:
    """Line and column of an offset, both from 1, the column in characters."""
    line = bisect_right(starts, offset)
    return line, offset - starts[line - 1] + 1
