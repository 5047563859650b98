"""What the heights of a map measure to: the eaves or the ridges of its buildings."""

from collections.abc import Mapping

#: Rules of heights that measure to the ridge; those of all other rules measure to the eaves.
RIDGES = ("height", "height_column", "measuredHeight", "solid")
# Part of the attribution of a source whose heights measure to the eaves.
_EAVES_BY_SOURCE = "bd topo"


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


__all__ = ["RIDGES", "heights_are_ridges"]
