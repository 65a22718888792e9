"""Where a drawn picture carries the text of its program, for those who write it and those who read it."""

from xml.sax.saxutils import escape

PNG_KEYWORD = "p3i-program"
"""The keyword of the PNG's text entry that holds the program."""

SVG_TAG = "{urn:p3i}program"
"""The element inside <metadata> of an SVG that holds it, as ElementTree names it."""


def program_element(text: str) -> str:
    """The metadata that holds a program's text, where `p3i.carried` finds it."""
    return f'<metadata><program xmlns="urn:p3i">{escape(_writable(text))}</program></metadata>'


def _writable(text: str) -> str:
    """The text without the characters that XML cannot hold (a comment might)."""
    return "".join(
        mark if mark in "\n\t" or " " <= mark < "\ufffe" or mark > "\uffff" else "\ufffd" for mark in text
    )
