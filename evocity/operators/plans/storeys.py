"""Ranges of heights that keep the buildings of a face in line with those around it."""

import numpy as np

from evocity.citymap import BUILT_ABOVE
from evocity.errors import MapError
from evocity.operators.plans.plan import Plan

#: The buildings around a lot are those within this distance of its window, metres.
AROUND = 30.0
#: Shares of the built ground that are lower than the range, and not higher than its upper end.
SHARES = (0.05, 0.95)


def storey_range(
    plan: Plan, face: int, heights: np.ndarray | None = None
) -> tuple[float, float] | None:
    """Find the range of the heights in a face and around it: metres, rounded to centimetres.

    The built ground of the face and of the window around it counts, up to 30 m beyond. The range
    leaves out the lowest and the highest twentieth, so a single tower does not allow others.

    Parameters
    ----------
    face : number of the face, 1…n.
    heights : float32 ``(H, W)``, heights that stand now, metres; None for those of the plan's map.

    Returns the lowest and the highest height, or None where nothing is built. Raises `MapError` for
    a number that is not a face of the plan.
    """
    if not 1 <= face <= len(plan):
        raise MapError(
            f"face = {face}", f"a face of the plan, 1…{len(plan)}", "use the number of a face"
        )
    beside = round(AROUND / plan.metres_per_pixel)
    rows, columns = (
        slice(max(one.start - beside, 0), one.stop + beside) for one in plan.window(face)
    )
    around = (plan.heights if heights is None else heights)[rows, columns]
    around = np.sort(around[around > BUILT_ABOVE])
    if not around.size:
        return None
    low, high = (float(around[int(share * (around.size - 1))]) for share in SHARES)
    return round(low, 2), max(round(high, 2), round(low, 2))


def find_lift(heights: np.ndarray, low: float, high: float) -> float:
    """Find the shortest lift that brings buildings into a range of heights, metres.

    A lift keeps the steps between neighbours, which limits would level. Where buildings differ by
    more than the range, the middle of their heights meets the middle of the range.

    heights : the heights of all built pixels, metres, one or more. The lowest and the highest
    twentieth do not count. low, high : the range, metres. Returns metres, rounded to centimetres.
    """
    heights = np.sort(heights)
    least, most = (float(heights[int(share * (heights.size - 1))]) for share in SHARES)
    below, above = low - least, high - most
    if below > above:
        return round((below + above) / 2, 2)
    return round(min(max(0.0, below), above), 2)


__all__ = ["AROUND", "SHARES", "find_lift", "storey_range"]
