import io
import sys

import numpy as np
import pytest
from PIL import Image as Pil
from PIL import ImageCms

from p3i.errors import FileError, UsageError
from p3i.vision.image import read_image, write_image
from p3i.vision.text import png_text
from p3i.vision.write import encode


@pytest.fixture
def pixels() -> np.ndarray:
    return np.random.default_rng(0).random((12, 17, 3)).astype(np.float32)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".PNG"])
def test_what_is_written_is_read_again(tmp_path, pixels, suffix):
    path = tmp_path / f"a{suffix}"
    write_image(path, pixels)
    np.testing.assert_allclose(read_image(path).pixels, pixels, atol=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("suffix", [".jpg", ".webp"])
def test_formats_with_loss_come_close(tmp_path, suffix):
    y, x = np.mgrid[0:32, 0:48]
    smooth = np.stack([x / 48, y / 32, np.full((32, 48), 0.3)], axis=-1)
    write_image(tmp_path / f"a{suffix}", smooth)
    np.testing.assert_allclose(read_image(tmp_path / f"a{suffix}").pixels, smooth, atol=0.06)


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("with_alpha", [False, True])
def test_16_bits_alpha_and_profile_survive(tmp_path, pixels, suffix, with_alpha):
    alpha = np.linspace(0, 1, 12 * 17, dtype=np.float32).reshape(12, 17) if with_alpha else None
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    path = tmp_path / f"a{suffix}"
    write_image(path, pixels, alpha=alpha, bits=16, icc=profile)
    image = read_image(path)
    assert image.source.bits == 16
    assert image.source.icc == profile
    np.testing.assert_allclose(image.pixels, pixels, atol=1e-5)
    if alpha is None:
        assert image.source.alpha is None
    else:
        assert image.source.alpha is not None
        np.testing.assert_allclose(image.source.alpha, alpha, atol=1e-5)
    with Pil.open(path) as picture:
        picture.load()  # another reader takes it too


def camera_block() -> Pil.Exif:
    exif = Pil.Exif()
    exif[0x0112] = 6
    exif[0x010F] = "Camera works"
    exif[0x0102] = (8, 8, 8)  # of the old file: it contradicts the new one
    exif.get_ifd(0x8769)[0x920A] = 28.5
    exif.get_ifd(0x8769)[0xA405] = 52
    exif.get_ifd(0x8825)[0x001D] = "2024:05:06"
    return exif


@pytest.mark.parametrize("odd", [0, 1])
def test_a_deep_tiff_keeps_what_the_camera_wrote(tmp_path, pixels, odd):
    path = tmp_path / "a.tif"
    write_image(path, pixels[:, odd:], bits=16, exif=camera_block().tobytes(), icc=b"1234567"[odd:], dpi=300)
    again = read_image(path)
    assert again.source.bits == 16
    np.testing.assert_allclose(again.pixels, pixels[:, odd:], atol=1e-5)
    # 52 mm by the diagonal of 36 x 24, told for the diagonal of this picture
    width, height = again.size.width, again.size.height
    assert again.focal_mm == pytest.approx(
        52 * np.hypot(width, height) / 43.27 * 36 / max(width, height), rel=1e-3
    )
    with Pil.open(path) as picture:
        assert picture.info["icc_profile"] == b"1234567"[odd:]
        assert picture.info["dpi"] == (300, 300)
        found = picture.getexif()
        assert found[0x010F] == "Camera works"
        assert found.get(0x0112, 1) == 1
        assert found.get_ifd(0x8769)[0x920A] == 28.5
        assert found.get_ifd(0x8825)[0x001D] == "2024:05:06"


def test_a_deep_tiff_is_deflated_as_other_readers_see_it(tmp_path):
    smooth = np.linspace(0, 1, 64 * 64 * 4, dtype=np.float32).reshape(64, 64, 4)
    path = tmp_path / "a.tif"
    write_image(path, smooth[:, :, :3], alpha=smooth[:, :, 3], bits=16, exif=camera_block().tobytes())
    assert path.stat().st_size < 0.5 * smooth.size * 2
    tifffile = pytest.importorskip("tifffile")
    with tifffile.TiffFile(path) as file:
        (page,) = file.pages
        assert page.compression.name == "ADOBE_DEFLATE"
        assert [sample.name for sample in page.extrasamples] == ["UNASSALPHA"]
        assert list(page.tags.keys()) == sorted(page.tags.keys())
        np.testing.assert_array_equal(page.asarray(), np.rint(smooth * 65535))


def test_a_deep_tiff_too_large_for_a_plain_one_is_a_big_one_and_read_again(tmp_path, pixels, monkeypatch):
    monkeypatch.setattr("p3i.vision.tiff._LARGEST_PLAIN", 100)
    write_image(tmp_path / "a.tif", pixels, bits=16, exif=camera_block().tobytes(), icc=b"123")
    assert (tmp_path / "a.tif").read_bytes()[:4] == b"II+\0"
    again = read_image(tmp_path / "a.tif")
    assert (again.source.bits, again.source.icc) == (16, b"123")
    np.testing.assert_allclose(again.pixels, pixels, atol=1e-5)


def test_a_deep_tiff_needs_no_extra_for_its_pixels(tmp_path, pixels, monkeypatch):
    monkeypatch.setattr("p3i.vision.tiff.has_tifffile", lambda: False)
    alpha = np.linspace(0, 1, 12 * 17, dtype=np.float32).reshape(12, 17)
    write_image(tmp_path / "a.tif", pixels, alpha=alpha, bits=16, icc=b"123", exif=camera_block().tobytes())
    again = read_image(tmp_path / "a.tif")
    np.testing.assert_allclose(again.pixels, pixels, atol=1e-5)
    np.testing.assert_allclose(again.source.alpha, alpha, atol=1e-5)
    assert again.source.bits == 16


def test_exif_is_kept_and_says_upright(tmp_path, pixels):
    exif = Pil.Exif()
    exif[0x0112] = 6
    exif[0x010F] = "Camera works"
    for suffix in (".png", ".jpg", ".webp", ".tif"):
        write_image(tmp_path / f"a{suffix}", pixels, exif=exif.tobytes())
        with Pil.open(tmp_path / f"a{suffix}") as picture:
            found = picture.getexif()
        assert found[0x010F] == "Camera works", suffix
        assert found.get(0x0112, 1) == 1, suffix
        assert read_image(tmp_path / f"a{suffix}").size.width == 17


def test_a_photo_goes_round_with_all_it_holds(tmp_path, pixels):
    exif = Pil.Exif()
    exif[0x0112] = 8
    picture = Pil.fromarray((pixels * 255).astype(np.uint8))
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    picture.save(tmp_path / "a.png", exif=exif, icc_profile=profile)
    first = read_image(tmp_path / "a.png")
    source = first.source
    write_image(tmp_path / "b.png", first.pixels, icc=source.icc, exif=source.exif, bits=source.bits)
    second = read_image(tmp_path / "b.png")
    np.testing.assert_array_equal(first.pixels, second.pixels)
    assert second.source.icc == profile


def test_a_tiff_gives_its_camera_but_not_its_strips_to_a_jpeg(tmp_path, pixels):
    exif = Pil.Exif()
    exif[0x010F] = "Camera works"
    Pil.fromarray((pixels * 255).astype(np.uint8)).save(tmp_path / "a.tif", exif=exif.tobytes())
    source = read_image(tmp_path / "a.tif").source
    write_image(tmp_path / "b.jpg", pixels, exif=source.exif)
    with Pil.open(tmp_path / "b.jpg") as picture:
        found = dict(picture.getexif())
        found.pop(0x8769, None)  # an empty block of the camera's own tags
        assert found == {0x010F: "Camera works", 0x0112: 1}


def test_text_is_kept_in_a_png(pixels):
    text = {"p3i": "SetCameraPose(rx=-42, ry=-15)\nfor i …", "Comment": ""}
    data = encode(pixels, kind=".png", text=text)
    assert png_text(data) == text
    assert Pil.open(io.BytesIO(data)).text == text  # pyright: ignore
    assert png_text(b"no png") == {}


def test_text_is_found_in_a_png_of_another_writer(tmp_path, pixels):
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_text("p3i", "latin é")
    Pil.fromarray((pixels * 255).astype(np.uint8)).save(tmp_path / "a.png", pnginfo=info)
    assert png_text((tmp_path / "a.png").read_bytes()) == {"p3i": "latin é"}


def test_text_is_looked_for_in_damaged_files_without_an_error(pixels):
    data = encode(pixels, kind=".png", text={"p3i": "SetCameraPose(rx=1, ry=2)"})
    start = data.index(b"iTXt")
    for length in range(0, start + 60):
        assert set(png_text(data[:length])) <= {"p3i", "p3", "p", ""}
    for at in range(start, start + 20):
        assert isinstance(png_text(data[:at] + b"\1" + data[at + 1 :]), dict)


def test_values_beyond_the_range_are_clipped_and_nan_is_black(tmp_path):
    write_image(tmp_path / "a.png", np.array([[[-1.0, 2.0, np.nan]]]))
    np.testing.assert_array_equal(read_image(tmp_path / "a.png").pixels, [[[0, 1, 0]]])


def test_bytes_are_written_as_they_are(tmp_path):
    array = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    write_image(tmp_path / "a.png", array)
    with Pil.open(tmp_path / "a.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), array)


def test_nothing_is_overwritten_without_force(tmp_path, pixels):
    path = tmp_path / "a.png"
    path.write_text("mine")
    with pytest.raises(FileError, match=r"a.png exists already.*--force"):
        write_image(path, pixels)
    assert path.read_text() == "mine"
    write_image(path, pixels, force=True)
    assert read_image(path).size.width == 17
    assert list(tmp_path.iterdir()) == [path]


def test_places_that_cannot_be_written_are_named(tmp_path, pixels):
    with pytest.raises(FileError, match=r"no folder .*missing"):
        write_image(tmp_path / "missing" / "a.png", pixels)
    (tmp_path / "b.png").mkdir()
    with pytest.raises(FileError, match="is a folder"):
        write_image(tmp_path / "b.png", pixels, force=True)


def test_standard_output_takes_a_picture(monkeypatch, pixels):
    buffer = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(buffer))
    write_image("-", pixels, kind=".png")
    assert Pil.open(io.BytesIO(buffer.getvalue())).size == (17, 12)


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ("a.xyz", {}, r"'\.xyz'.*\.png"),
        ("a", {}, "no suffix"),
        ("a.jpg", {"alpha": np.ones((12, 17))}, "JPEG keeps no transparency"),
        ("a.jpg", {"text": {"p3i": "x"}}, "JPEG keeps no text"),
        ("a.png", {"bits": 12}, "8 or 16 bits, not 12"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(tmp_path, pixels, path, options, message):
    with pytest.raises(UsageError, match=message):
        write_image(tmp_path / path, pixels, **options)
    assert list(tmp_path.iterdir()) == []
