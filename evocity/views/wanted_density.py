"""Wanted density: GSI and FSI that a plan wants around places, and how far a map is from them."""

import csv
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from evocity.errors import MapError, check_number, reason_of, spell
from evocity.views.limit_tables import read_only

#: The most places of a field.
MOST_PLACES = 1_000_000
#: The columns of a file of places.
COLUMNS = ("x", "y", "gsi", "fsi")


class _Map(Protocol):
    """What a `WantedDensity` reads of a `CityMap`."""

    metres_per_pixel: float

    @property
    def shape(self) -> tuple[int, int]: ...

    @property
    def south_west(self) -> tuple[float, float]: ...

    def local_density_at(
        self, places: np.ndarray, radius: float
    ) -> tuple[np.ndarray, np.ndarray]: ...


@dataclass(frozen=True, eq=False)
class WantedDensity:
    """Wanted GSI and FSI within a radius around some places of a map. Arrays are read-only.

    `WantedDensity.load` reads a file of places, and `evocity.io.read_wanted_density` reads a field
    that lies on a map.

    places : float64 ``(n, 2)``, metres to the east and to the north of the map's south-west corner.
    gsi, fsi : float64 ``(n,)``, NaN where nothing is wanted.
    radius : metres.
    """

    places: np.ndarray
    gsi: np.ndarray
    fsi: np.ndarray
    radius: float = 100.0

    def __post_init__(self):
        check_number("radius", self.radius, 1e-6, 1e6, "metres above 0", MapError)
        places = np.array(self.places, np.float64).reshape(-1, 2)
        gsi, fsi = (np.array(one, np.float64).ravel() for one in (self.gsi, self.fsi))
        if not (len(places) == len(gsi) == len(fsi) <= MOST_PLACES):
            raise MapError(
                f"{len(places)} places have {len(gsi)} values of gsi and {len(fsi)} of fsi",
                f"one value of each for every place, for at most {MOST_PLACES} places",
                "write NaN where nothing is wanted",
            )
        _check_values("gsi", gsi, 1.0)
        _check_values("fsi", fsi, math.inf)
        wanted = np.isfinite(places).all(axis=1) & ~(np.isnan(gsi) & np.isnan(fsi))
        if not wanted.any():
            raise MapError(
                f"the field has no wish at any of its {len(places)} places",
                "at least one place with a value of gsi or fsi",
                "give values from 0 to 1 for gsi, or of 0 or more for fsi",
            )
        for name, array in (("places", places), ("gsi", gsi), ("fsi", fsi)):
            object.__setattr__(self, name, read_only(array[wanted]))

    def __len__(self) -> int:
        return len(self.places)

    @property
    def wishes(self) -> list[str]:
        """The densities that some place has a value of: "gsi", "fsi" or both."""
        return [name for name in ("gsi", "fsi") if not np.isnan(getattr(self, name)).all()]

    def fits(self, city: _Map) -> bool:
        """Whether all places lie on the map ``city``."""
        size = np.array(city.shape[::-1]) * city.metres_per_pixel
        return bool(((self.places >= 0) & (self.places <= size)).all())

    def differences(self, city: _Map) -> Mapping[str, np.ndarray]:
        """Compute the local density of a map minus the wanted one at each place: "gsi" and "fsi",
        float64 ``(n,)``, NaN where nothing is wanted. Raises `MapError` for a smaller map."""
        gsi, fsi = city.local_density_at(self.places + city.south_west, self.radius)
        return {"gsi": gsi - self.gsi, "fsi": fsi - self.fsi}

    def gap(self, city: _Map, density: str = "fsi") -> float:
        """Compute the root of the mean squared difference of a ``density``, "gsi" or "fsi", over
        the places with a wish; NaN without any. Raises `MapError` for a smaller map."""
        if density not in ("gsi", "fsi"):
            raise MapError(f"density = {spell(density)}", '"gsi" or "fsi"', "choose one of these")
        differences = self.differences(city)[density]
        known = differences[~np.isnan(differences)]
        return float(np.sqrt(np.mean(known**2))) if known.size else math.nan

    @classmethod
    def load(cls, path: str | os.PathLike, radius: float = 100.0) -> Self:
        """Read a CSV file with the columns x, y and gsi, fsi or both: x and y are metres from the
        south-west corner, and an empty cell wants nothing. Raises `MapError` for another file."""
        columns = read_places(path)
        return cls(
            np.stack([columns["x"], columns["y"]], 1), columns["gsi"], columns["fsi"], radius
        )

    def save(self, path: str | os.PathLike) -> None:
        """Write a CSV file that `load` reads. The file does not contain the radius."""
        with open(path, "x", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            for row in zip(*self.places.T, self.gsi, self.fsi, strict=True):
                writer.writerow(["" if math.isnan(one) else repr(float(one)) for one in row])


def read_places(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Read the `COLUMNS` of a CSV file, float64 ``(n,)`` each; NaN for an empty cell, and for a
    density without a column. Raises `MapError` for another file."""
    path = Path(path)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = csv.DictReader(file)
            names = [(name or "").strip().lower() for name in rows.fieldnames or ()]
            _check_columns(path, names)
            rows.fieldnames = names
            numbers = [list(_numbers(path, number, row)) for number, row in enumerate(rows, 2)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MapError(
            f"{path} cannot be read: {reason_of(error) if isinstance(error, OSError) else error}",
            "a CSV file in UTF-8 with the columns x, y and gsi, fsi or both",
            "check the path and the file",
        ) from None
    columns = np.array(numbers, np.float64).reshape(-1, len(COLUMNS)).T
    return dict(zip(COLUMNS, columns, strict=True))


def _check_columns(path: Path, names: list[str]) -> None:
    if not {"x", "y"} <= set(names) or not {"gsi", "fsi"} & set(names):
        raise MapError(
            f"{path.name} has the columns {', '.join(names) or 'none'}",
            "the columns x and y, and gsi, fsi or both",
            "write the names of the columns in the first line",
        )


def _numbers(path: Path, line: int, row: Mapping) -> Iterator[float]:
    if line > MOST_PLACES + 1:
        raise MapError(f"{path.name} has more than {MOST_PLACES} places", "fewer", "use a raster")
    for name in COLUMNS:
        text = (row.get(name) or "").strip()
        try:
            yield float(text) if text else math.nan
        except ValueError:
            raise MapError(
                f"{path.name}, line {line}: {name} = {spell(text)}",
                "a number, or an empty cell",
                "correct this line",
            ) from None


def _check_values(name: str, values: np.ndarray, highest: float) -> None:
    wrong = values[(values < 0) | (values > highest) | np.isinf(values)]
    if wrong.size:
        allowed = (
            f"values from 0 to {highest:g}" if math.isfinite(highest) else "values of 0 or more"
        )
        raise MapError(
            f"the field has {wrong.size} wrong values of {name}, for example {wrong[0]:g}",
            f"{allowed}, and NaN where nothing is wanted",
            "check the unit and the value of missing pixels",
        )
