"""Levels of detail and maps that can have pitched roofs, and the meaning of a map's heights."""

from collections.abc import Mapping

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword, setting

#: Rules of heights that measure to the ridge; those of all other rules measure to the eaves.
RIDGES = ("height", "height_column", "measuredHeight", "solid")
# Part of the attribution of a source whose heights measure to the eaves.
_EAVES_BY_SOURCE = "bd topo"
#: Most height of a building with a roof, metres.
TALLEST = 1000.0


def heights_are_ridges(height_rules: Mapping[str, int], attribution: str = "") -> bool:
    """Return whether the heights of a map measure to the ridge.

    height_rules : number of buildings by the rule that gave their heights, as of
        `CityMap.height_rules`. The rule of most buildings decides. Heights without a rule, such as
        those of decoded genomes, measure to the eaves.
    attribution : that of the map. BD TOPO of the IGN measures to the eaves, under any name of its
        column.
    """
    if _EAVES_BY_SOURCE in attribution.casefold():
        return False
    counts = {rule: count for rule, count in height_rules.items() if rule != "default"}
    ridges = sum(count for rule, count in counts.items() if rule in RIDGES)
    return 2 * ridges > sum(counts.values())


def level_of(lod: str | None, roofs: bool) -> str:
    """Return the level of detail of a scene, or raise `MapError` for ``roofs`` at another level
    than 2.2."""
    if lod is None:
        return "2.2" if roofs else "1.3"
    if roofs and lod != "2.2":
        raise MapError(
            f"{setting('lod', lod)} has no pitched roofs",
            "LoD 2.2 for roofs",
            f"leave {keyword('lod')} or {keyword('roofs')} out",
        )
    return lod


def check_heights(city: CityMap) -> None:
    """Raise `MapError` for a map whose heights can have no roofs: 0, or above 1 km."""
    highest = float(city.heights.max())
    if highest <= 0:
        raise MapError(
            f"{city.name}: all heights are 0, so that no building can have a roof",
            "heights of buildings in metres",
            f"check the heights, or leave {keyword('roofs')} out",
        )
    if highest > TALLEST:
        raise MapError(
            f"{city.name}: the highest building has {highest:g} m",
            f"heights of at most {TALLEST:g} m for roofs, in metres",
            f"check the unit of the heights, or leave {keyword('roofs')} out",
        )
