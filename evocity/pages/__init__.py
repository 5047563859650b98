"""HTML by templates: every value is escaped, no template runs but those of this package.

`templates_of` gives the templates of a folder, `data_uri` makes a picture fit into a page, many of
them with one `Palette`, `number` a value fit for people.
"""

import base64
import io
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image

_COLOURS = 128  # of a picture's palette: no colour is off by more than the eye can tell
_ROUNDS = 8  # of k-means on counted colours: then a map and a scene are as near as Pillow has them


@cache
def templates_of(folder: Path) -> Environment:
    """The templates in a ``folder`` of this package. What they are given is escaped, whatever it
    is called; a name that nobody gave raises."""
    found = Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["number"] = number
    return found


def number(value: float | None, unit: str = "") -> str:
    """A measure's value for people; a dash where it is undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.4g} {unit}".rstrip()


def data_uri(picture: Image.Image, palette: "Palette | None" = None) -> str:
    """A picture as PNG inside a ``data:`` address; in the colours of a ``palette`` made before, or
    in one of its own."""
    kept = io.BytesIO()
    few = of_few_colours(picture) if palette is None else palette.drawn(picture)
    # level 6 takes half as long again for 3 % less, level 9 ten times as long for 7 %
    few.save(kept, "PNG", compress_level=5)
    return "data:image/png;base64," + base64.b64encode(kept.getvalue()).decode()


def of_few_colours(picture: Image.Image) -> Image.Image:
    """A ``picture`` with a palette: rare colours have a place of their own in it, and common ones,
    by k-means, their own."""
    return Palette([picture], _COLOURS).drawn(picture)


class Palette:
    """So many ``colours``, 255 at most, that are near those of all ``pictures``, which may be a few
    of many that are drawn with it: then one costs a twentieth of what its own palette would.

    Colours are counted first, for a map has thousands of pixels and hundreds of colours: so it
    takes less than half of what Pillow's own k-means does.
    """

    def __init__(self, pictures: Sequence[Image.Image], colours: int):
        pixels = np.concatenate([np.asarray(one.convert("RGB")).reshape(-1, 3) for one in pictures])
        counted = Image.fromarray(pixels[None]).getcolors(len(pixels))
        counts = np.array([count for count, _ in counted], np.float64)
        all_colours = np.array([colour for _, colour in counted], np.uint8)
        first = Image.fromarray(all_colours[None]).quantize(
            colours, Image.Quantize.MAXCOVERAGE, 0, dither=Image.Dither.NONE
        )
        self._colours = _means(all_colours, counts, np.asarray(first)[0], colours)
        for _ in range(_ROUNDS):
            place = _nearest(all_colours, self._colours)
            self._colours = _means(all_colours, counts, place, colours)
        # 1 + its place, of each colour that was drawn before; memory is taken where it is written
        self._place = np.zeros(1 << 24, np.uint8)
        self._place[_codes(all_colours)] = _nearest(all_colours, self._colours) + 1

    def drawn(self, picture: Image.Image) -> Image.Image:
        """The ``picture`` with this palette: of each colour, the nearest."""
        codes = _codes(np.asarray(picture.convert("RGB")))
        place = self._place[codes]
        if not place.all():
            new = np.unique(codes[place == 0])
            self._place[new] = _nearest(_colours_of(new), self._colours) + 1
            place = self._place[codes]
        drawn = Image.fromarray(place - 1)
        drawn.putpalette(np.round(self._colours).astype(np.uint8).tobytes())
        return drawn


def _means(colours: np.ndarray, counts: np.ndarray, place: np.ndarray, many: int) -> np.ndarray:
    """The mean colour of each of so ``many`` places of a palette; black where there is none."""
    sums = [np.bincount(place, counts * channel, many) for channel in colours.T]
    return np.column_stack(sums) / np.maximum(np.bincount(place, counts, many), 1)[:, None]


def _nearest(colours: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """Where in the ``palette`` what is nearest to each colour stands."""
    squares = (palette**2).sum(axis=1)
    # few at a time stay near the processor, and no thread of BLAS wakes for them
    parts = np.array_split(colours.astype(np.float64), len(colours) // 256 + 1)
    return np.concatenate([(squares - 2 * part @ palette.T).argmin(axis=1) for part in parts])


def _codes(colours: np.ndarray) -> np.ndarray:
    """Each of the ``colours``, a last axis of 3, as one number."""
    red, green, blue = np.moveaxis(colours.astype(np.int32), -1, 0)
    return red << 16 | green << 8 | blue


def _colours_of(codes: np.ndarray) -> np.ndarray:
    """Uint8 ``(n, 3)``: the colours of codes."""
    return np.column_stack([codes >> 16, codes >> 8 & 255, codes & 255]).astype(np.uint8)


__all__ = ["Palette", "data_uri", "number", "of_few_colours", "templates_of"]
