"""Feet of the stacked parts of a building, for CityGML and CityJSON."""

from collections.abc import Sequence

import numpy as np
import shapely

# Heights that differ by less are equal, metres.
_STEP = 0.5
# Parts that are so near touch, metres; of a part that stands on others, at least this share does.
_GAP, _LEAST_OVERLAP = 0.1, 0.01


def find_feet(
    footprints: Sequence[shapely.Geometry],
    lows: np.ndarray,
    highs: np.ndarray,
    grounded: Sequence[bool],
    unit: float,
) -> np.ndarray:
    """Find the foot of each part of a building, metres. A part has the lowest foot of the parts
    that it stands on; without a ground surface, also that of lower parts that it touches; otherwise
    its own.

    lows, highs : lowest and highest point of each part, metres; flat parts carry no others.
    grounded : whether a surface of the part says that it is on the ground.
    unit : metres in a unit of the footprints.
    """
    feet = np.array(lows, dtype=np.float64)
    if len(feet) < 2:
        return feet
    areas = np.array(footprints, dtype=object)
    west, south, east, north = shapely.bounds(areas).T
    gap = _GAP / unit
    near = shapely.box(west - gap, south - gap, east + gap, north + gap)
    tree = shapely.STRtree(areas)
    carries = highs > lows
    for at in np.argsort(lows, kind="stable").tolist():
        below = tree.query(near[at])
        below = below[carries[below] & (lows[below] < lows[at] - _STEP)]
        # from the lowest foot, so that the first part that carries this one ends the search
        below = below[np.argsort(feet[below], kind="stable")].tolist()
        least = _LEAST_OVERLAP * areas[at].area
        under = next((one for one in below if areas[one].intersection(areas[at]).area > least), -1)
        if under < 0 and not grounded[at]:
            under = next((one for one in below if areas[one].dwithin(areas[at], gap)), -1)
        if under >= 0:
            feet[at] = min(feet[at], feet[under])
    return feet
