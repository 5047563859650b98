"""HTML templates, escaped values, and pictures as ``data:`` addresses with few colours."""

import base64
import io
import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from PIL import Image

_COLOURS = 128  # of a picture's palette: the eye sees no difference
_ROUNDS = 8  # of k-means on counted colours: then colours are as near as Pillow's


@cache
def templates_of(folder: Path) -> Environment:
    """Return the templates in a ``folder``. All values are escaped; an unknown name raises."""
    environment = Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    return environment


def number(value: float | None, unit: str = "") -> str:
    """Return a measure's value for people; a dash where it is undefined."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.4g} {unit}".rstrip()


def data_uri(picture: Image.Image, palette: "Palette | None" = None) -> str:
    """Return a picture as PNG in a ``data:`` address, with a ``palette`` made before or its own."""
    kept = io.BytesIO()
    few = of_few_colours(picture) if palette is None else palette.drawn(picture)
    # level 6 takes 1.5 times as long for 3 % less, level 9 ten times for 7 %
    few.save(kept, "PNG", compress_level=5)
    return "data:image/png;base64," + base64.b64encode(kept.getvalue()).decode()


def of_few_colours(picture: Image.Image) -> Image.Image:
    """Return a ``picture`` with a palette of its own, which keeps rare colours."""
    return Palette([picture], _COLOURS).drawn(picture)


class Palette:
    """At most 255 ``colours`` near those of all ``pictures``, which may be examples of many
    pictures drawn with it: then a picture takes a twentieth of the time of its own palette.

    A map has thousands of pixels and hundreds of colours. Counting the colours first takes less
    than half the time of Pillow's k-means.
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
        # 1 + the place of each known colour; the system gives memory only where it is written
        self._place = np.zeros(1 << 24, np.uint8)
        self._place[_codes(all_colours)] = _nearest(all_colours, self._colours) + 1

    def drawn(self, picture: Image.Image) -> Image.Image:
        """Return the ``picture`` with this palette: of each colour, the nearest."""
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
    """The mean colour of each of ``many`` places of a palette; black for an unused place."""
    sums = [np.bincount(place, counts * channel, many) for channel in colours.T]
    return np.column_stack(sums) / np.maximum(np.bincount(place, counts, many), 1)[:, None]


def _nearest(colours: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """The place in the ``palette`` of the colour nearest to each of ``colours``."""
    squares = (palette**2).sum(axis=1)
    # few at a time fit the processor's cache, and wake no thread of BLAS
    parts = np.array_split(colours.astype(np.float64), len(colours) // 256 + 1)
    return np.concatenate([(squares - 2 * part @ palette.T).argmin(axis=1) for part in parts])


def _codes(colours: np.ndarray) -> np.ndarray:
    """Each of the ``colours``, a last axis of 3, as one number."""
    red, green, blue = np.moveaxis(colours.astype(np.int32), -1, 0)
    return red << 16 | green << 8 | blue


def _colours_of(codes: np.ndarray) -> np.ndarray:
    return np.column_stack([codes >> 16, codes >> 8 & 255, codes & 255]).astype(np.uint8)


__all__ = ["Palette", "data_uri", "number", "of_few_colours", "templates_of"]
