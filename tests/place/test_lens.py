"""Programs with a lens in their header, drawn over the photo that the lens took."""

import numpy as np
import torch

from p3i.grammar.ast import Affine, CameraPose, Draw, For, Header, Program
from p3i.interp.lens import photo_from_straight
from p3i.paint.draw.bent import bent
from p3i.paint.draw.render import render
from p3i.paint.draw.scene import Strokes
from p3i.size import Size
from p3i.vision.image import Image

torch.set_num_threads(1)
SIZE = Size(320, 240)
PHOTO = Image(np.full((240, 320, 3), 0.5, np.float32), np.ones((240, 320), bool))


def grid(k1: float | None) -> Program:
    draw = Draw(Affine(i=18, constant=-27), Affine(j=18, constant=-27))
    loops = For("i", Affine(), Affine(constant=4), For("j", Affine(), Affine(constant=4), draw))
    return Program(CameraPose(-20, 10), loops, header=Header(canvas=(320, 240), lens_k1=k1))


def test_dots_stand_where_the_lens_shows_the_objects() -> None:
    straight, curved = render(grid(None), image=PHOTO), render(grid(-0.2), image=PHOTO)
    expected, _ = photo_from_straight(torch.from_numpy(straight.centers_px), -0.2, size=SIZE)
    np.testing.assert_allclose(curved.centers_px, expected.numpy())
    pixels = curved.pixels()
    for x, y in np.rint(curved.centers_px).astype(int):
        if 0 <= x < 320 and 0 <= y < 240:
            assert np.ptp(pixels[y, x].astype(int)) > 60, "a coloured dot"


def test_straight_lines_bend_in_short_parts() -> None:
    line = Strokes(np.array([[[20.0, 20.0], [300.0, 20.0]]]), (0, 0, 0), 1.0)
    drawn = bent(line, SIZE, -0.2)
    assert isinstance(drawn, Strokes) and len(drawn.segments) > 10
    y = drawn.segments[:, :, 1]
    assert y.max() > 25 and y.min() > 20 and abs(y[0, 0] - y[-1, 1]) < 2


def test_a_straight_view_undoes_the_lens() -> None:
    # A photo with a cross where the lens shows an object: seen straight it stands where the program says.
    point = torch.tensor(render(grid(None), image=PHOTO).centers_px[:1])
    ((x, y),) = np.rint(photo_from_straight(point, -0.2, size=SIZE)[0].numpy()).astype(int)
    pixels = PHOTO.pixels.copy()
    pixels[y - 2 : y + 3, x - 2 : x + 3] = (1.0, 0.0, 0.0)
    picture = render(grid(-0.2), image=Image(pixels, PHOTO.valid), plane=True, markers=False, cells=False)
    seen = picture.pixels().astype(int)
    row, column = np.rint(np.array(np.nonzero(seen[..., 0] - seen[..., 1] > 120)).mean(1))
    np.testing.assert_allclose([column, row], picture.centers_px[0], atol=4)
