"""Checks of the options of `read_map`."""

import math
import os
from typing import Any

from evocity.citymap import MAX_SIDE, PIXEL_SIDES
from evocity.errors import MapError, check_number, is_number, keyword, setting

#: Letters of an attribution, at most.
MOST_CREDIT = 1000


def check_line(name: str, text: object) -> str:
    """Return a ``text``, stripped; raises `MapError` for other values and long texts."""
    if not isinstance(text, str) or not text.strip() or len(text) > MOST_CREDIT:
        raise MapError(
            setting(name, text),
            f"a text of 1 to {MOST_CREDIT} letters",
            f"leave {keyword(name)} out to use the file's own",
        )
    return text.strip()


def check_column(option: str, column: object) -> str | None:
    """Return the name of a ``column``, or None; raises `MapError` for other values."""
    if column is None or (isinstance(column, str) and column.strip()):
        return column
    raise MapError(
        setting(option, column), "the name of a column", f"leave {keyword(option)} out to use rules"
    )


def check_count(pixels: Any) -> int | None:
    """Return a number of ``pixels``, or None; raises `MapError` for other values."""
    if pixels is None:
        return None
    remedy = f"give the side of the square window in pixels, for example {keyword('pixels', 256)}"
    expected = f"a whole number from 1 to {MAX_SIDE}"
    check_number("pixels", pixels, 1, MAX_SIDE, expected, MapError, remedy, whole=True)
    return int(pixels)


def check_positive(option: str, value: Any) -> float | None:
    """Return a positive ``value`` in metres, or None; raises `MapError` for other values."""
    if value is None and option != "default_height":
        return None
    low, high = PIXEL_SIDES  # heights lie within these too
    expected = f"a positive number of metres, {low:g} to {high:g}"
    check_number(option, value, low, high, expected, MapError)
    return float(value)


def check_finite(option: str, value: float | None) -> float | None:
    """Return a finite ``value``, or None; raises `MapError` for other values."""
    if value is None:
        return None
    check_number(option, value, -math.inf, math.inf, "a finite number", MapError)
    return float(value)


def check_terrain(terrain: Any) -> str | float | None:
    """Return a terrain as a path or a number; raises `MapError` for other values."""
    if terrain is None or is_number(terrain):
        return check_finite("terrain", terrain)
    if isinstance(terrain, str | os.PathLike) and os.fspath(terrain):
        return os.fspath(terrain)
    raise MapError(
        setting("terrain", terrain),
        "the path of a raster, or an elevation in metres",
        f"give for example {keyword('terrain', 'dtm.tif')}",
    )


def check_place(center: Any) -> tuple[float, float] | None:
    """Return (longitude, latitude), or None; raises `MapError` for other values."""
    if center is None:
        return None
    try:
        lon, lat = (float(value) for value in center)
        if abs(lon) <= 180 and abs(lat) < 90:
            return lon, lat
    except (TypeError, ValueError):
        pass
    raise MapError(
        setting("center", center),
        "(longitude, latitude) in degrees, longitude first, within ±180 and ±90",
        "give the place as two numbers, for example " + keyword("center", (4.8344, 45.7685)),
    )
