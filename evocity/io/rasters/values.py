"""Values of rasters in metres: missing pixels, and values that no building has.

A reader hands over the values of its file by rows. Missing pixels become NaN. Values outside
`HEIGHTS` (with a terrain: outside `ELEVATIONS`), and the values that programs use for missing
pixels of integer types, make an error that names the most frequent value.
"""

from collections import Counter

import numpy as np

from evocity.errors import MapError, keyword
from evocity.io.reader_types import Request

#: Heights above ground that are plausible, metres; and elevations above sea level.
HEIGHTS, ELEVATIONS = (-100.0, 1000.0), (-500.0, 9000.0)

# Number of different implausible values that are counted.
_MOST_VALUES = 64
# Integer types whose extreme values often mean missing pixels.
_FILLED = ("int16", "uint16", "int32", "uint32")
# From this number on, a nodata value is compared within 1 %: users shorten 3.4028235e+38.
_HUGE = 1e30


class RasterValues:
    """Values of a raster in metres, float32 ``(H, W)``, NaN where missing: ``metres``.

    scale, offset : metres = value of the file × scale + offset.
    filled : whether extreme values of integer types are implausible.
    """

    def __init__(
        self,
        name: str,
        shape: tuple[int, int],
        request: Request,
        scale: float = 1.0,
        offset: float = 0.0,
        filled: bool = True,
    ):
        self.metres = np.empty(shape, np.float32)
        self._name, self._nodata, self._scaled = name, request.nodata, request.height_scale
        self._low, self._high = ELEVATIONS if request.terrain else HEIGHTS
        self._scale, self._offset, self._filled = scale, offset, filled
        self._valid = self._doubted = 0
        self._values: Counter[float] = Counter()
        self._low_found = self._high_found = 0.0

    def take(self, top: int, raw: np.ndarray, missing: np.ndarray | None = None) -> None:
        """Take the ``raw`` values of some rows from row ``top`` on, and their mask of ``missing``
        pixels."""
        part = self.metres[top : top + len(raw)]
        with np.errstate(all="ignore"):
            if self._scale != 1.0 or self._offset != 0.0:
                part[:] = raw.astype(np.float64) * self._scale + self._offset
            else:
                part[:] = raw
        if missing is not None:
            part[missing] = np.nan
        if self._nodata is not None:
            part[is_value(raw, self._nodata)] = np.nan
        valid = ~np.isnan(part)
        self._valid += int(valid.sum())
        doubted = (part > self._high) | (part < self._low)
        if self._filled and raw.dtype.name in _FILLED:
            limits = np.iinfo(raw.dtype)
            doubted |= valid & (raw == limits.max)
            if limits.min:
                doubted |= valid & (raw == limits.min)
        if doubted.any():
            self._doubt(raw[doubted])

    def _doubt(self, raw: np.ndarray) -> None:
        values, counts = np.unique(raw, return_counts=True)
        if not self._doubted:
            self._low_found, self._high_found = float(values[0]), float(values[-1])
        self._low_found = min(self._low_found, float(values[0]))
        self._high_found = max(self._high_found, float(values[-1]))
        self._doubted += int(counts.sum())
        most = np.argsort(counts, kind="stable")[::-1][:_MOST_VALUES]
        for value, count in zip(values[most], counts[most], strict=True):
            self._values[_plain(value)] += int(count)
        self._values = Counter(dict(self._values.most_common(_MOST_VALUES)))

    @property
    def fault(self) -> MapError | None:
        """The error about implausible values; None without such values."""
        if not self._doubted:
            return None
        value, count = self._values.most_common(1)[0]
        low, high = f"{self._low:g}", f"{self._high:g}"
        # many values, or almost all pixels: so they are not a filler
        if 2 * count < self._doubted or self._doubted > 0.9 * self._valid:
            return MapError(
                f"{self._name}: {_share(self._doubted, self._valid)} have implausible values, "
                f"from {self._low_found:g} to {self._high_found:g}",
                f"heights in metres above ground, from {low} to {high} m",
                f"if the values are elevations above sea level, give {keyword('terrain')} with a "
                "raster of the ground; if the unit is not the metre, give "
                f"{keyword('height_scale')}",
            )
        return MapError(
            f"{self._name}: {_share(count, self._valid)} have the value {value:.9g}, which no "
            "building has",
            f"heights in metres from {low} to {high} m, and a declared value for missing pixels",
            f"if {value:.9g} means a missing pixel, give {keyword('nodata', value)}; if it is a "
            f"height in another unit, give {keyword('height_scale')}",
        )


def _share(count: int, whole: int) -> str:
    share = 100 * count / max(whole, 1)
    return f"{count} of {whole} pixels ({share:.2g} %)"


def is_value(raw: np.ndarray, nodata: float) -> np.ndarray:
    """Tell which ``raw`` values are ``nodata``, as the type of the file stores this number."""
    with np.errstate(all="ignore"):
        if abs(nodata) >= _HUGE:
            return np.isclose(raw.astype(np.float64), nodata, rtol=0.01, atol=0)
        if raw.dtype.kind == "f":
            return raw == raw.dtype.type(nodata)
        return raw == nodata


def _plain(value: np.generic) -> float:
    """Convert a value to the number that its shortest text gives."""
    return float(str(value)) if value.dtype.kind == "f" else int(value)
