import io
import os
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as Pil
from PIL import ImageCms

from p3i.errors import FileError
from p3i.size import Size
from p3i.vision.image import Image, masked, read_image, read_mask, resized


def scene(height: int = 20, width: int = 32) -> np.ndarray:
    """A smooth coloured picture without any symmetry, uint8 [H, W, 3]."""
    y, x = np.mgrid[0:height, 0:width]
    red, green = 255 * x / width, 255 * y / height
    return np.stack([red, green, (red + 40) / 2], axis=-1).astype(np.uint8)


def saved(path: Path, array: np.ndarray, mode: str | None = None, **options) -> Path:
    picture = Pil.fromarray(array)
    if mode:
        picture = picture.convert(mode)
    picture.save(path, **options)
    return path


def test_a_png_is_read_in_rgb_order_between_0_and_1(tmp_path):
    image = read_image(saved(tmp_path / "a.png", scene()))
    assert image.pixels.dtype == np.float32
    assert image.size == Size(32, 20)
    np.testing.assert_allclose(image.pixels, scene() / 255, atol=1e-6)
    assert image.valid.all()
    assert image.notes == ()


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("kind", ["png8", "png16", "tiff8", "tiff16", "jpeg"])
def test_every_exif_orientation_gives_the_same_upright_picture(tmp_path, orientation, kind):
    upright = scene()
    # How a camera stores it: the inverse of the turn that the tag asks the reader for.
    stored = {
        1: upright,
        2: upright[:, ::-1],
        3: upright[::-1, ::-1],
        4: upright[::-1],
        5: np.swapaxes(upright, 0, 1),
        6: np.rot90(upright, 1),
        7: np.swapaxes(upright[::-1, ::-1], 0, 1),
        8: np.rot90(upright, -1),
    }[orientation]
    stored = np.ascontiguousarray(stored)
    exif = Pil.Exif()
    exif[0x0112] = orientation
    path = tmp_path / {"jpeg": "a.jpg", "png8": "a.png", "png16": "a.png"}.get(kind, "a.tif")
    if kind == "tiff16":
        path.write_bytes(tiff_16(stored, orientation))
    elif kind == "png16":
        path.write_bytes(png_16_with_orientation(stored, orientation))
    else:
        saved(path, stored, exif=exif, **({"quality": 100, "subsampling": 0} if kind == "jpeg" else {}))
    image = read_image(path)
    assert image.size == Size(32, 20)
    np.testing.assert_allclose(image.pixels, upright / 255, atol=0.02 if kind == "jpeg" else 1e-4)


def tiff_16(array: np.ndarray, orientation: int) -> bytes:
    """OpenCV's 16-bit TIFF with the orientation put over a tag that states a default (planar layout)."""
    done, buffer = cv2.imencode(
        ".tiff", array[:, :, ::-1].astype(np.uint16) * 257, [cv2.IMWRITE_TIFF_COMPRESSION, 1]
    )
    assert done
    data = bytearray(buffer.tobytes())
    directory = int.from_bytes(data[4:8], "little")
    for entry in range(int.from_bytes(data[directory : directory + 2], "little")):
        at = directory + 2 + 12 * entry
        if int.from_bytes(data[at : at + 2], "little") == 284:
            data[at : at + 12] = b"".join(
                number.to_bytes(size, "little")
                for number, size in ((274, 2), (3, 2), (1, 4), (orientation, 4))
            )
            return bytes(data)
    raise AssertionError("no tag to spare")


def png_16_with_orientation(array: np.ndarray, orientation: int) -> bytes:
    from p3i.vision.write import _chunk

    done, buffer = cv2.imencode(".png", array[:, :, ::-1].astype(np.uint16) * 257)
    assert done
    exif = Pil.Exif()
    exif[0x0112] = orientation
    data = buffer.tobytes()
    return data[:33] + _chunk(b"eXIf", exif.tobytes().removeprefix(b"Exif\0\0")) + data[33:]


def test_a_16_bit_png_keeps_more_than_8_bits(tmp_path):
    ramp = np.zeros((4, 300, 3), np.uint16)
    ramp[:, :, 0] = np.arange(300) + 20000
    done, buffer = cv2.imencode(".png", ramp[:, :, ::-1])
    assert done
    path = tmp_path / "deep.png"
    path.write_bytes(buffer.tobytes())
    image = read_image(path)
    assert len(np.unique(image.pixels[0, :, 0])) == 300
    assert image.source.bits == 16
    np.testing.assert_allclose(image.pixels[0, :, 0], ramp[0, :, 0] / 65535, atol=1e-6)


def test_a_16_bit_tiff_is_read_in_rgb_order(tmp_path):
    path = tmp_path / "deep.tif"
    path.write_bytes(tiff_16(scene(), 1))
    image = read_image(path)
    np.testing.assert_allclose(image.pixels, scene() / 255, atol=1e-4)
    assert image.source.bits == 16


def test_16_bit_grey_becomes_three_equal_channels(tmp_path):
    grey = np.linspace(0, 65535, 50, dtype=np.uint16)[None].repeat(4, 0)
    Pil.fromarray(grey).save(tmp_path / "grey.png")
    image = read_image(tmp_path / "grey.png")
    np.testing.assert_allclose(image.pixels, grey[:, :, None] / 65535 * np.ones(3), atol=1e-6)


@pytest.mark.parametrize("channels", [1, 3])
def test_a_float_tiff_is_stretched_and_nan_is_unknown(tmp_path, channels):
    values = np.linspace(-2, 6, 60 * channels, dtype=np.float32).reshape(6, 10, channels)
    values[2, 3] = np.nan
    done, buffer = cv2.imencode(".tiff", values)
    assert done
    (tmp_path / "float.tif").write_bytes(buffer.tobytes())
    image = read_image(tmp_path / "float.tif")
    assert not image.valid[2, 3]
    assert image.valid.sum() == 59
    assert np.isfinite(image.pixels).all()
    assert image.pixels.min() == 0 and image.pixels.max() == 1
    assert "stretched" in image.notes[0]


def test_a_float_tiff_between_0_and_1_is_taken_as_it_is(tmp_path):
    values = np.random.default_rng(0).random((6, 10, 3), np.float32) * np.float32(0.5)
    done, buffer = cv2.imencode(".tiff", values[:, :, ::-1])
    assert done
    (tmp_path / "float.tif").write_bytes(buffer.tobytes())
    image = read_image(tmp_path / "float.tif")
    np.testing.assert_array_equal(image.pixels, values)
    assert image.notes == ()


def test_a_radiance_picture_is_read(tmp_path):
    values = np.random.default_rng(0).random((20, 30, 3), np.float32)
    done, buffer = cv2.imencode(".hdr", values[:, :, ::-1])
    assert done
    (tmp_path / "a.hdr").write_bytes(buffer.tobytes())
    np.testing.assert_allclose(read_image(tmp_path / "a.hdr").pixels, values, atol=0.01)


def test_grey_palette_and_two_valued_pictures_are_read(tmp_path):
    grey = scene()[:, :, 0]
    np.testing.assert_allclose(
        read_image(saved(tmp_path / "l.png", grey)).pixels, grey[:, :, None] / 255 * np.ones(3), atol=1e-6
    )
    palette = Pil.fromarray(scene()).quantize(16)
    palette.save(tmp_path / "p.png")
    expected = np.asarray(palette.convert("RGB")) / 255
    np.testing.assert_allclose(read_image(tmp_path / "p.png").pixels, expected, atol=1e-6)
    two = (grey > 100).astype(np.uint8) * 255
    np.testing.assert_array_equal(
        read_image(saved(tmp_path / "1.png", two, mode="1")).pixels, two[:, :, None] / 255 * np.ones(3)
    )


def test_a_cmyk_jpeg_shows_its_colours(tmp_path):
    path = saved(tmp_path / "ink.jpg", scene(), mode="CMYK", quality=100)
    image = read_image(path)
    np.testing.assert_allclose(image.pixels, scene() / 255, atol=0.06)


def test_a_jpeg_is_read_as_its_decoder_says_with_its_profile_kept(tmp_path):
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    path = saved(tmp_path / "a.jpg", scene(), quality=100, icc_profile=profile)
    image = read_image(path)
    with Pil.open(path) as picture:
        np.testing.assert_allclose(image.pixels, np.asarray(picture) / 255, atol=1e-6)
    assert image.source.icc == profile
    assert image.source.format == "JPEG"


def test_transparent_pixels_are_unknown(tmp_path):
    array = np.dstack([scene(), np.full((20, 32), 255, np.uint8)])
    array[3:6, 4:9, 3] = 0
    image = read_image(saved(tmp_path / "hole.png", array))
    expected = np.ones((20, 32), bool)
    expected[3:6, 4:9] = False
    np.testing.assert_array_equal(image.valid, expected)
    assert image.source.alpha is not None
    assert image.source.alpha[4, 5] == 0 and image.source.alpha[0, 0] == 1


def test_a_transparent_palette_entry_is_unknown(tmp_path):
    palette = Pil.fromarray(scene()).quantize(8)
    index = palette.getpixel((0, 0))
    palette.save(tmp_path / "p.png", transparency=index)
    np.testing.assert_array_equal(read_image(tmp_path / "p.png").valid, np.asarray(palette) != index)


def test_16_bit_transparency_is_unknown(tmp_path):
    array = np.full((6, 8, 4), 65535, np.uint16)
    array[:, :, 0] = 1000
    array[1, 2, 3] = 0
    done, buffer = cv2.imencode(".png", array)
    assert done
    (tmp_path / "deep.png").write_bytes(buffer.tobytes())
    image = read_image(tmp_path / "deep.png")
    assert not image.valid[1, 2] and image.valid.sum() == 47
    assert image.pixels[0, 0, 2] == pytest.approx(1000 / 65535)


def test_of_an_animation_the_first_frame_is_read_and_said(tmp_path):
    frames = [Pil.fromarray(np.full((8, 9, 3), value, np.uint8)) for value in (200, 100, 0)]
    frames[0].save(tmp_path / "a.gif", save_all=True, append_images=frames[1:])
    image = read_image(tmp_path / "a.gif")
    np.testing.assert_allclose(image.pixels, 200 / 255, atol=0.01)
    assert image.notes == ("only the first of 3 frames is used",)


def test_a_picture_of_one_pixel_is_a_picture(tmp_path):
    assert read_image(saved(tmp_path / "1.png", np.full((1, 1, 3), 7, np.uint8))).size == Size(1, 1)


def test_standard_input_is_read(tmp_path, monkeypatch):
    data = saved(tmp_path / "a.png", scene()).read_bytes()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
    np.testing.assert_allclose(read_image("-").pixels, scene() / 255, atol=1e-6)


def test_empty_standard_input_is_called_by_its_name(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
    with pytest.raises(FileError, match="standard input is empty"):
        read_image("-")


def bad_files(folder: Path) -> dict[str, tuple[Path, str]]:
    """Every kind of bad input with what must be said of it."""
    rich = np.random.default_rng(0).integers(0, 255, (80, 80, 3), np.uint8)
    jpeg = saved(folder / "whole.jpg", rich).read_bytes()
    png = saved(folder / "whole.png", rich).read_bytes()
    tiff = tiff_16(rich, 1)
    contents = {
        "empty.jpg": (b"", "is empty"),
        "text.jpg": (b"Dear Sir, this is a letter.\n" * 20, "looks like text"),
        "short.jpg": (jpeg[: len(jpeg) // 2], "cut off"),
        "head.jpg": (jpeg[:30], "cut off"),
        "short.png": (png[: len(png) // 2], "cut off"),
        "head.png": (png[:20], "cut off"),
        "short.tif": (tiff[: len(tiff) // 2], "cut off"),
        "noise.png": (bytes(np.random.default_rng(1).integers(0, 255, 999, np.uint8)), "no picture"),
        "drawing.svg": (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "SVG"),
        "paper.pdf": (b"%PDF-1.7\n%\xe2\xe3\n", "PDF"),
        "old.eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "PostScript"),
    }
    for name, (data, _) in contents.items():
        (folder / name).write_bytes(data)
    found = {name: (folder / name, message) for name, (_, message) in contents.items()}
    found["missing"] = (folder / "missing.jpg", "no file")
    found["folder"] = (folder, "folder")
    found["nul"] = (Path("a\0b.jpg"), "cannot be read")
    if Path("/dev/zero").exists():
        found["device"] = (Path("/dev/zero"), "device")
    return found


def test_every_bad_file_has_its_own_one_line_reason(tmp_path):
    for name, (path, message) in bad_files(tmp_path).items():
        with pytest.raises(FileError) as caught:
            read_image(path)
        assert message in str(caught.value), name
        assert "\n" not in str(caught.value), name
        assert path.name in str(caught.value) or name == "nul", name
        assert caught.value.exit_code == 3


@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_refused_by_the_system(tmp_path):
    path = saved(tmp_path / "a.png", scene())
    path.chmod(0)
    with pytest.raises(FileError, match="no permission to read"):
        read_image(path)


def test_a_refusal_of_the_system_is_told_as_missing_permission(tmp_path, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    path = saved(tmp_path / "a.png", scene())
    monkeypatch.setattr(os, "stat", refuse)
    with pytest.raises(FileError, match="no permission to read"):
        read_image(path)


def test_any_cut_of_a_picture_is_read_or_refused(tmp_path):
    rich = np.random.default_rng(0).integers(0, 255, (40, 40, 3), np.uint8)
    for name in ("a.jpg", "a.png", "a.gif", "a.tif", "a.webp", "a.bmp"):
        data = saved(tmp_path / name, rich).read_bytes()
        refused = 0
        for length in range(1, len(data), max(1, len(data) // 23)):
            (tmp_path / name).write_bytes(data[:length])
            try:
                read_image(tmp_path / name)
            except FileError:
                refused += 1
        assert refused > 10, name


def test_a_picture_above_the_limit_is_refused_with_the_limit(tmp_path):
    path = saved(tmp_path / "a.png", scene())
    with pytest.raises(FileError, match=r"32 x 20, 0.00064 megapixels; the limit is 0.0005\..*max_px"):
        read_image(path, max_px=500)
    assert read_image(path, max_px=640).size == Size(32, 20)


@pytest.mark.parametrize("kind", ["png", "gif", "tiff", "hdr", "pfm"])
def test_a_decompression_bomb_is_refused_before_it_is_decoded(tmp_path, kind):
    path = tmp_path / f"bomb.{kind}"
    if kind == "png":
        data = bytearray(saved(path, scene()).read_bytes())
        data[16:24] = (100_000).to_bytes(4, "big") * 2
        import zlib

        data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    elif kind == "gif":
        data = bytearray(saved(path, scene()).read_bytes())
        data[6:10] = b"\xff\xff\xff\xff"
    elif kind == "tiff":
        done, buffer = cv2.imencode(".tiff", np.zeros((6, 5, 3), np.float32))
        assert done
        data = bytearray(buffer.tobytes())
        directory = int.from_bytes(data[4:8], "little")
        for entry in range(int.from_bytes(data[directory : directory + 2], "little")):
            at = directory + 2 + 12 * entry
            if int.from_bytes(data[at : at + 2], "little") in (256, 257):
                data[at + 2 : at + 12] = b"\x04\0\x01\0\0\0" + (100_000).to_bytes(4, "little")
    elif kind == "hdr":
        data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n"
    else:
        data = b"PF\n100000 100000\n-1.0\n"
    path.write_bytes(bytes(data))
    with pytest.raises(FileError, match="megapixels; the limit is 200"):
        read_image(path)


def test_heic_without_its_extra_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    path = tmp_path / "phone.heic"
    path.write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(100))
    with pytest.raises(FileError, match=r"phone.heic is a HEIC photo.*pip install 'p3i\[heic\]'"):
        read_image(path)


def test_heic_is_read_where_its_extra_is_installed(tmp_path):
    pillow_heif = pytest.importorskip("pillow_heif", reason="the extra p3i[heic] is not installed")
    pillow_heif.from_pillow(Pil.fromarray(scene(64, 96))).save(tmp_path / "phone.heic", quality=95)
    np.testing.assert_allclose(read_image(tmp_path / "phone.heic").pixels, scene(64, 96) / 255, atol=0.1)


def test_a_mask_marks_what_is_white(tmp_path):
    array = np.zeros((20, 32), np.uint8)
    array[2:5, 3:9] = 255
    for name, mode in (("l.png", None), ("rgb.png", "RGB"), ("p.gif", "P"), ("one.png", "1")):
        mask = read_mask(saved(tmp_path / name, array, mode=mode), Size(32, 20))
        np.testing.assert_array_equal(mask, array > 0)


def test_transparent_white_is_not_marked(tmp_path):
    array = np.full((6, 8, 4), 255, np.uint8)
    array[:, :, 3] = 0
    array[2, 3, 3] = 255
    mask = read_mask(saved(tmp_path / "m.png", array), Size(8, 6))
    assert mask.sum() == 1 and mask[2, 3]


@pytest.mark.parametrize(
    ("value", "size", "message"),
    [
        ((0, 0, 0), Size(8, 6), "marks nothing"),
        ((255, 255, 255), Size(8, 6), "all white"),
        ((255, 0, 0), Size(8, 6), "has colours"),
        ((255, 255, 255), Size(6, 8), "8 x 6, but the photo is 6 x 8"),
    ],
)
def test_a_mask_that_cannot_be_meant_is_refused(tmp_path, value, size, message):
    path = saved(tmp_path / "mask.png", np.full((6, 8, 3), value, np.uint8))
    with pytest.raises(FileError, match=message):
        read_mask(path, size)


def test_a_masked_image_no_longer_holds_the_masked_pixels_as_evidence():
    image = Image(np.zeros((2, 3, 3), np.float32), np.ones((2, 3), bool))
    unknown = np.zeros((2, 3), bool)
    unknown[1, 2] = True
    assert masked(image, unknown).valid.sum() == 5
    assert image.valid.all()


def test_an_image_refuses_pixels_of_another_type():
    with pytest.raises(ValueError, match="float32"):
        Image(np.zeros((2, 3, 3), np.uint8), np.ones((2, 3), bool))


@pytest.mark.parametrize("longer", [640, 333, 100])
def test_a_resized_ramp_follows_the_pixel_centre_convention(longer):
    y, x = np.mgrid[0:301, 0:1000].astype(np.float32)
    image = Image(np.stack([x, y, x + y], axis=-1) / 2000, np.ones((301, 1000), bool))
    small = resized(image, longer)
    s = 1000 / longer
    assert small.size.longer == longer
    assert small.stride == pytest.approx(s)
    u = np.arange(small.size.width)
    v = np.arange(small.size.height - 1)  # the last row may be cut
    np.testing.assert_allclose(small.pixels[0, :, 0] * 2000, (u + 0.5) * s - 0.5, atol=0.6 if s < 2 else 0.3)
    np.testing.assert_allclose(
        small.pixels[:-1, 0, 1] * 2000, (v + 0.5) * s - 0.5, atol=0.6 if s < 2 else 0.3
    )
    # Single pixels of an area mean lie off by up to a fraction of a pixel; on average there is no shift.
    assert np.mean(small.pixels[0, :, 0] * 2000 - ((u + 0.5) * s - 0.5)) == pytest.approx(0, abs=0.02)


def test_resizing_never_reads_an_unknown_pixel():
    pixels = np.full((64, 64, 3), 0.25, np.float32)
    valid = np.ones((64, 64), bool)
    valid[10:30, 20:41] = False
    pixels[~valid] = 1000
    small = resized(Image(pixels, valid), 24)
    np.testing.assert_allclose(small.pixels[small.valid], 0.25, atol=1e-5)
    assert not small.valid[7, 11]
    assert 0.8 < small.valid.mean() < 1


def test_resizing_never_enlarges_and_composes_its_stride():
    image = Image(np.zeros((50, 100, 3), np.float32), np.ones((50, 100), bool))
    assert resized(image, 100) is image
    assert resized(image, 200) is image
    assert resized(resized(image, 50), 25).stride == pytest.approx(4)


def test_a_thin_picture_keeps_a_pixel_of_height():
    image = Image(np.zeros((1, 1000, 3), np.float32), np.ones((1, 1000), bool))
    assert resized(image, 100).size == Size(100, 1)
