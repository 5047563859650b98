"""The table of street kinds: limits of width and length, and what makes a place."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from evocity.errors import MapError, near_miss, spell
from evocity.views.limit_tables import Feature, LimitTable, TableFormat, is_number, toml

#: What a table may limit.
FEATURES: Mapping[str, Feature] = {
    "width": Feature("m", math.inf, 8.0),
    "length": Feature("m", math.inf, 50.0),
}
#: What a table may limit besides, if one of its kinds does, or if it has a section [density].
DENSITIES: Mapping[str, Feature] = {
    "gsi": Feature("", 1.0, 0.3),
    "fsi": Feature("", math.inf, 1.0),
}
#: The radius within which densities count, metres, if [density] gives no other.
RADIUS = 100.0
#: Computes GSI and FSI around places, within a radius in metres.
DensityAt = Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]]
#: Names of ground that has no limits of width and length.
RESERVED = ("place", "water")
_PLACE = ("width", "longest", "filled")


@dataclass(frozen=True, eq=False)
class StreetKinds(LimitTable):
    """Kinds of streets by width and length, and what makes a place.

    `StreetKinds.read` reads a file, `StreetKinds.of` its text.

    entries : name and box of each ``[[kind]]``; rows of a box are width and length, metres.
    density_radius : kinds also depend on GSI and FSI within so many metres around the middle of an
    edge of the graph, and boxes have two further rows; None without any such kind.
    place_width : a disc of this diameter, metres, has room at the middle of a place.
    place_longest : the highest ratio of length to breadth of a place.
    place_filled : the least share of its smallest rectangle that a place fills.
    """

    FORMAT: ClassVar = TableFormat(
        *("kind", "kinds of streets", "a street", "place", FEATURES, MapError),
        'for example width = { from = 9.75, below = 20 } under [[kind]] name = "street"',
        RESERVED,
        ("density",),
    )
    place_width: float
    place_longest: float
    place_filled: float
    density_radius: float | None = None

    @classmethod
    def of(cls, text: str | bytes) -> "StreetKinds":
        """Read the table from its TOML ``text``.

        Each ``[[kind]]`` has a ``name`` and limits of ``width`` and ``length``, metres,
        ``{ from = LOWEST, below = END }``: the lowest value belongs to the kind, the end does not;
        each may be left out. ``[place]`` has ``width``, ``longest`` and ``filled``; values that it
        leaves out are those of this package. A kind may also have limits of ``gsi`` and ``fsi``,
        densities around the middle of the street; ``[density]`` has their ``radius``, metres.

        Raises `MapError` for a document that is not a table of kinds; and if some street has no
        kind, or two.
        """
        document = cls.FORMAT.document(text)
        radius = _radius(document)
        form = cls.FORMAT if radius is None else _DENSE
        entries = form.entries(document)
        form.check_overlaps(entries)
        form.check_gaps(entries)
        width, longest, filled = _place(document.get("place", {}))
        return cls(entries, width, longest, filled, radius)

    def named(
        self,
        width: np.ndarray,
        length: np.ndarray,
        densities: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> np.ndarray:
        """Name the kind of each street by its ``width`` and ``length``, metres, and by its
        ``densities``, GSI and FSI, if the table has a `density_radius`; str ``(n,)``."""
        rows = [width, length]
        if self.density_radius is not None and densities is not None:
            rows += densities
        return np.array(self.names)[self.classified(np.stack(rows))]

    def densities(
        self,
        edges: np.ndarray,
        density: DensityAt | None,
        corner: tuple[float, float],
        shape: tuple[int, int],
        pixel: float,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Compute GSI and FSI around the middle of each of the ``edges``, None if no kind depends
        on them. ``corner``, ``shape`` and ``pixel`` are those of the map. A middle outside the map
        is moved to its border; a disc without a pixel of the map has 0.

        Raises `MapError` if kinds depend on densities, and ``density`` is None."""
        if self.density_radius is None:
            return None
        if density is None:
            raise MapError(
                "the table of kinds has limits of gsi or fsi, but the open ground has no densities",
                "a function that computes densities, as CityMap.local_density_at",
                "call city.street_graph_of(kinds=…), which passes this function",
            )
        import shapely

        halfway = shapely.line_interpolate_point(edges, 0.5, normalized=True)
        (left, top), (height, width) = corner, shape
        right, bottom = left + width * pixel, top - height * pixel
        inside = np.clip(shapely.get_coordinates(halfway), (left, bottom), (right, top))
        gsi, fsi = density(inside, max(self.density_radius, pixel))
        return np.nan_to_num(gsi), np.nan_to_num(fsi)


_DENSE = replace(StreetKinds.FORMAT, features={**FEATURES, **DENSITIES})


@cache
def packaged() -> StreetKinds:
    """Read the table of this package, ``evocity/data/street-kinds.toml``."""
    return StreetKinds.read(Path(__file__).parents[2] / "data" / "street-kinds.toml")


def _radius(document: Mapping) -> float | None:
    """Read the radius of densities; None if no kind depends on them."""
    kinds = document.get("kind", [])
    kinds = [one for one in kinds if isinstance(one, Mapping)] if isinstance(kinds, list) else []
    if "density" not in document:
        return RADIUS if any(set(DENSITIES) & set(kind) for kind in kinds) else None
    density = document["density"]
    radius = density.get("radius", RADIUS) if isinstance(density, Mapping) else None
    if radius is None or set(density) - {"radius"} or not (is_number(radius) and 0 < radius <= 1e6):
        raise MapError(
            f"the section [density] is {toml(density)}",
            "a section [density] with the key radius: metres above 0, at most 1000000",
            "write for example radius = 100 under [density]",
        )
    return float(radius)


def _place(place: object) -> tuple[float, ...]:
    if not isinstance(place, Mapping):
        raise MapError(
            f"place = {spell(place)} is not a section",
            f"a section [place] with the keys {', '.join(_PLACE)}",
            "write a section [place] with these keys",
        )
    for name in place:
        if name not in _PLACE:
            raise MapError(
                f"{name} of [place]", ", ".join(_PLACE), near_miss(name, _PLACE) or "take it out"
            )
    if len(place) < len(_PLACE):
        usual = packaged()
        place = {name: getattr(usual, f"place_{name}") for name in _PLACE} | dict(place)
    lowest, highest = (0.0, 1.0, 0.0), (math.inf, math.inf, 1.0)
    for name, low, high in zip(_PLACE, lowest, highest, strict=True):
        if not (is_number(place[name]) and low <= place[name] <= high and place[name] > 0):
            raise MapError(
                f"the section [place] has the invalid value {name} = {spell(place[name])}",
                f"a number from {low:g} to {high:g}, above 0",
                f"correct the key {name}, or remove the key to use the default value",
            )
    return tuple(float(place[name]) for name in _PLACE)
