"""Frames of a film: an animated WebP, or a strip of pictures."""

from collections.abc import Iterable
from pathlib import Path

from PIL import Image

from evocity.cli.shared.checks import replace_file
from evocity.errors import EvocityError, is_whole

#: The most frames of a film.
MOST_FRAMES = 500
#: The suffixes of films: animated WebP, and a strip of all frames.
FILMS = (".webp", ".png")
#: Frames in a row of a strip, the gap between them, and the largest side of a strip, px.
_IN_A_ROW, _GAP, _MOST_SIDE = 8, 6, 16_384
_PAPER = (255, 255, 255)


def check_film(path: Path, frames: int) -> None:
    """Raise `EvocityError` unless ``frames`` is 2 to `MOST_FRAMES` and ``path`` names a film."""
    if not is_whole(frames) or not 2 <= frames <= MOST_FRAMES:
        raise EvocityError(
            f"--frames {frames}",
            f"a whole number from 2 to {MOST_FRAMES}",
            "choose for example 25 frames",
        )
    if path.suffix.lower() not in FILMS:
        raise EvocityError(
            f"{path.name}: frames cannot be written to {path.suffix or 'a file without a suffix'}",
            "a name that ends in .webp (an animation) or .png (a strip of pictures)",
            "choose another file name",
        )


def write_film(
    pictures: Iterable[Image.Image], path: Path, *, frames: int, milliseconds: int = 80
) -> None:
    """Write ``frames`` pictures of one size to ``path``: .webp shows them in a loop, each for some
    ``milliseconds``; .png shows them beside each other, eight in a row.

    Raises `EvocityError` as `check_film`, and for a strip that is too large.
    """
    check_film(path, frames)
    listed = [picture.convert("RGB") for picture in pictures]
    with replace_file(path) as temporary:
        if path.suffix.lower() == ".webp":
            listed[0].save(
                temporary, "WEBP", save_all=True, append_images=listed[1:], loop=0,
                duration=milliseconds, lossless=True, method=2,
            )  # fmt: skip
        else:
            strip(listed).save(temporary, "PNG")


def strip(pictures: list[Image.Image]) -> Image.Image:
    """Lay ``pictures`` of one size beside each other, in rows of eight from the north-west. Raises
    `EvocityError` for a strip that is too large."""
    wide, tall = pictures[0].size
    columns = min(len(pictures), _IN_A_ROW)
    rows = -(-len(pictures) // columns)
    size = columns * (wide + _GAP) - _GAP, rows * (tall + _GAP) - _GAP
    if max(size) > _MOST_SIDE:
        raise EvocityError(
            f"a strip of {len(pictures)} frames has {size[0]} × {size[1]} px",
            f"a strip of at most {_MOST_SIDE} px on each side",
            "choose fewer or smaller frames, or write an animation (.webp)",
        )
    sheet = Image.new("RGB", size, _PAPER)
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        sheet.paste(picture, (column * (wide + _GAP), row * (tall + _GAP)))
    return sheet
