"""Where a drawn picture carries the text of its program, for those who write it and those who read it."""

PNG_KEYWORD = "p3i-program"
"""The keyword of the PNG's text entry that holds the program."""

SVG_TAG = "{urn:p3i}program"
"""The element inside <metadata> of an SVG that holds it, as ElementTree names it."""
