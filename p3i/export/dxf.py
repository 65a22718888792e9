"""DXF of the objects on their plane, seen straight on: cells, middles and names on a layer each.

Convention: x right, y up (so y is minus that of the program). Where a cell's true size is known coordinates
are lengths, and the header says their unit ($INSUNITS); else they are program units, and no unit is set.
Needs ezdxf: the extra `cad`.
"""

import io

from p3i.errors import UsageError
from p3i.place.objects import Objects

_TEXT_SHARE = 0.2
"""The height of a name, as a share of its cell's."""


_INSUNITS = {"in": 1, "ft": 2, "mm": 4, "cm": 5, "m": 6}
"""Units by their numbers in DXF; 0 is none."""


def dxf(found: Objects) -> str:
    """`found` as a DXF document of release R2010; raises UsageError where ezdxf is not installed."""
    try:
        from ezdxf import new, options  # pyright: ignore[reportPrivateImportUsage]
    except ImportError:
        raise UsageError("DXF needs ezdxf: pip install 'p3i[cad]'") from None
    fixed = options.write_fixed_meta_data_for_testing
    # No times and no random ids: the same objects give the same file.
    options.write_fixed_meta_data_for_testing = True
    try:
        drawing = new("R2010", units=0 if found.cell_size is None else _INSUNITS[found.cell_size.unit])
        for layer, colour in (("CELLS", 8), ("POINTS", 1), ("NAMES", 7)):
            drawing.layers.add(layer, color=colour)
        space = drawing.modelspace()
        for each in found.objects:
            cell = each.cell if found.cell_size is None else each.cell_true
            x, y = (each.x, each.y) if each.true is None else each.true
            outline = [(x, -y) for x, y in cell]
            space.add_lwpolyline(outline, close=True, dxfattribs={"layer": "CELLS"})
            space.add_point((x, -y), dxfattribs={"layer": "POINTS"})
            heights = [y for _, y in cell]
            text = space.add_text(
                each.name,
                height=_TEXT_SHARE * (max(heights) - min(heights)) or 1.0,
                dxfattribs={"layer": "NAMES"},
            )
            text.set_placement((x, -y))
        stream = io.StringIO()
        drawing.write(stream)
        return stream.getvalue()
    finally:
        options.write_fixed_meta_data_for_testing = fixed
