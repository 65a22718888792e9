"""DXF of the objects on their plane, seen straight on: cells, middles and names on a layer each.

Convention: drawing units are program units, x right, y up (so y is minus that of the program); no physical
unit is set. Needs ezdxf: the extra `cad`.
"""

import io

from p3i.errors import UsageError
from p3i.place.objects import Objects

_TEXT_SHARE = 0.2
"""The height of a name, as a share of its cell's."""


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
        drawing = new("R2010", units=0)
        for layer, colour in (("CELLS", 8), ("POINTS", 1), ("NAMES", 7)):
            drawing.layers.add(layer, color=colour)
        space = drawing.modelspace()
        for each in found.objects:
            space.add_lwpolyline([(x, -y) for x, y in each.cell], close=True, dxfattribs={"layer": "CELLS"})
            space.add_point((each.x, -each.y), dxfattribs={"layer": "POINTS"})
            heights = [y for _, y in each.cell]
            text = space.add_text(
                each.name,
                height=_TEXT_SHARE * (max(heights) - min(heights)) or 1.0,
                dxfattribs={"layer": "NAMES"},
            )
            text.set_placement((each.x, -each.y))
        stream = io.StringIO()
        drawing.write(stream)
        return stream.getvalue()
    finally:
        options.write_fixed_meta_data_for_testing = fixed
