"""Draw the pictures of docs/inpaint.md and docs/edit.md that show what still looks wrong.

python scripts/draw_faults.py docs        # writes fault_*.png there

Each is a picture of our own, as it is and beside it as p3i leaves it: the terrace of examples/, and scenes
of `p3i examples` with their true programs.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import PIL.Image

import p3i
from p3i.evaluation.scenes import scene
from p3i.options.extend import Margins
from p3i.place.placed import placed
from p3i.vision.image import Image, read_image

EXAMPLES = Path(__file__).parent.parent / "examples"
HEIGHT, COLOURS = 200, 96
LETTERS = "ABDEFGHKLMNPRSTXYZ"


def main(folder: Path) -> None:
    fog(folder / "fault_fog.png")
    differing(folder / "fault_differing.png")
    under(folder / "fault_under.png")


def fog(path: Path) -> None:
    """What `extend --beyond continue` puts where nothing is known of the ground."""
    photo = read_image(EXAMPLES / "tiles.jpg")
    found = p3i.extend(
        photo, p3i.load(EXAMPLES / "tiles.p3p"), by=Margins(15, 15, 15, 15, "%"), beyond="continue"
    )
    side_by_side(path, photo.pixels, found.pixels)


def differing(path: Path) -> None:
    """A cell restored among cells that differ: a mixture of letters."""
    made = scene("lattice", 3, look="disc" if "disc" in looks() else None, jitter=0.2, clutter=0)
    pixels = made.pixels.copy()
    for number, (x, y) in enumerate(np.rint(made.centers_px).astype(int).tolist()):
        letter = LETTERS[number * 7 % len(LETTERS)]
        cv2.putText(
            pixels, letter, (x - 8, y + 8), cv2.FONT_HERSHEY_SIMPLEX, 0.75, (20, 20, 30), 2, cv2.LINE_AA
        )
    photo = photo_of(pixels)
    one = middle(photo, made.program)
    found = p3i.inpaint(photo, made.program, restore=[one])
    around(path, photo, found.pixels, made.program, one)


def under(path: Path) -> None:
    """An object taken away that lay upon another thing: a cable, which ends there softly."""
    made = scene("lattice", 3, jitter=0.2, clutter=0)
    before, one = photo_of(made.pixels), middle(photo_of(made.pixels), made.program)
    laid = placed(made.program, before)
    x, y = laid.centers_px()[0][[tuple(index) == one for index in laid.index.tolist()]][0]
    pixels = made.pixels.copy()
    on_top = np.zeros(pixels.shape[:2], np.uint8)
    cv2.line(on_top, (int(x) - 300, int(y) - 95), (int(x) + 300, int(y) + 95), 255, 5, cv2.LINE_AA)
    found = p3i.inpaint(before, made.program, remove=[one])
    share = np.where(found.hole, 0, on_top)[:, :, None] / 255
    photo = photo_of(np.rint(pixels * (1 - share) + np.array([190, 40, 30]) * share).astype(np.uint8))
    found = p3i.inpaint(photo, made.program, remove=[one])
    around(path, photo, found.pixels, made.program, one)


def looks() -> set[str]:
    from p3i.evaluation.looks import LOOKS

    return set(LOOKS)


def photo_of(pixels: np.ndarray) -> Image:
    return Image(pixels.astype(np.float32) / 255, np.ones(pixels.shape[:2], bool))


def middle(photo: Image, program: p3i.Program) -> tuple[int, int]:
    """The object nearest to the middle of the photo."""
    laid = placed(program, photo)
    centers = laid.centers_px()[0] - np.array([photo.size.width, photo.size.height]) / 2
    i, j = laid.index[int(np.argmin(np.hypot(*centers.T)))].tolist()
    return i, j


def around(path: Path, photo: Image, pixels: np.ndarray, program: p3i.Program, one: tuple[int, int]) -> None:
    """What lies around an object, before and after."""
    laid = placed(program, photo)
    centers = laid.centers_px()[0]
    x, y = centers[[tuple(index) == one for index in laid.index.tolist()]][0]
    reach = 2.4 * np.sort(np.hypot(*(centers - (x, y)).T))[1]
    part = (
        slice(max(0, int(y - reach)), int(y + reach)), slice(max(0, int(x - reach)), int(x + reach))
    )  # fmt: skip
    side_by_side(path, photo.pixels[part], pixels[part])


def side_by_side(path: Path, *pictures: np.ndarray) -> None:
    """Pictures in a row, few colours each, so that the file is small."""
    row = []
    for pixels in pictures:
        width = round(pixels.shape[1] * HEIGHT / pixels.shape[0])
        row += [cv2.resize(pixels, (width, HEIGHT), interpolation=cv2.INTER_AREA), np.ones((HEIGHT, 6, 3))]
    values = np.rint(np.hstack(row[:-1]).clip(0, 1) * 255).astype(np.uint8)
    PIL.Image.fromarray(values).quantize(COLOURS).save(path, optimize=True)
    print(path, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
