"""SVG of the objects alone: cells, middles and names as shapes to work with, on the photo's canvas.

Convention: pixel centres at whole numbers, the view box begins at (-0.5, -0.5), as in `p3i render`. Each
object is a group `object-NAME`.
"""

from p3i.grammar.printer import brief, format_program, number_text
from p3i.marks import program_element
from p3i.place.objects import Objects


def svg(found: Objects) -> str:
    """`found` as an SVG document, with the text of its program in the metadata."""
    width, height = found.size.width, found.size.height
    stroke = max(1.0, found.size.longer / 800)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="-0.5 -0.5 {width} {height}">',
        program_element(format_program(found.program)),
        f'<g id="objects" fill="none" stroke="#d62839" stroke-width="{brief(stroke)}" '
        'font-family="sans-serif" text-anchor="middle">',
    ]
    for each in found.objects:
        facts = f'data-name="{each.name}" data-i="{each.i}" data-j="{each.j}"'
        if each.presence is not None:
            facts += f' data-presence="{each.presence}"'
        lines.append(f'<g id="object-{each.name}" {facts}>')
        if each.cell_px:
            corners = " ".join(f"{number_text(x)},{number_text(y)}" for x, y in each.cell_px)
            lines.append(f'<polygon points="{corners}"/>')
        x, y = number_text(each.x_px), number_text(each.y_px)
        size = brief(_text_size(each.cell_px, stroke))
        lines += [
            f'<circle cx="{x}" cy="{y}" r="{brief(1.5 * stroke)}"/>',
            f'<text x="{x}" y="{y}" dy="-0.5em" font-size="{size}" fill="#d62839" stroke="none">'
            f"{each.name}</text>",
            "</g>",
        ]
    return "\n".join([*lines, "</g>", "</svg>", ""])


def _text_size(cell: tuple[tuple[float, float], ...], stroke: float) -> float:
    """A quarter of the cell's height."""
    heights = [y for _, y in cell] or [0.0]
    return max(4 * stroke, 0.25 * (max(heights) - min(heights)))
