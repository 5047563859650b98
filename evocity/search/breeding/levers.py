"""Levers: operators that move a measure towards its target, chosen by the sign of the miss.

A birth that is steered has one parent from the living. The lever of a measure that this parent
misses decides the operator and how far it goes: heights change by the factor that is missing, and
street blocks fill or empty by the share that is missing.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from evocity.fitness import Aims
from evocity.recipe.mixture import LEVER_OF

#: The name of an operator, and its parameters.
Move = tuple[str, dict[str, Any]]
#: Makes a move from a miss, as a share of the target: above 0 for too much.
Lever = Callable[[float, np.random.Generator], Move]

#: Shares of the street blocks, or of the buildings, whose heights one birth changes.
_SHARES = (0.15, 0.4, 1.0)
#: How much of a miss one birth makes up, at least and at most.
_PART = 0.4, 1.2
#: The least and the largest factor of heights; factors of one birth differ by so much.
_FACTORS, _SPREAD = (0.45, 2.2), 0.08
#: The largest share of the map that becomes bare ground.
_MOST_BARE = 0.5
#: Street blocks that one birth fills: so many, and more by the miss.
_FEW_BLOCKS, _MORE_BLOCKS = 4, 60
#: Groups of buildings that one birth copies, by how much each raises the built ground.
_MOST_COPIES, _BY_COPY = 30, 0.02
#: The chance that buildings are copied, in place of filling blocks with denser ones.
_COPIED = 0.6
#: How well a copy fits its new place, metres along its outline.
_TOLERANCE = 12.0
#: By how much the new buildings of a filled block are denser: least and largest factor.
_DENSER = 1.02, 1.4
#: By how many metres streets widen around filled blocks: least and most.
_WIDER = 1.0, 6.0
#: Large misses are drawn more often: the chance of a measure is this power of its miss.
_POWER = 1.5
#: A parent has no larger miss below a target: nothing is infinitely far away.
_DEEPEST = -0.8


def _heights(miss: float, rng: np.random.Generator) -> Move:
    share = _SHARES[int(rng.integers(len(_SHARES)))]
    lacking = 1 / (1 + max(miss, _DEEPEST)) - 1
    factor = float(np.clip(1 + lacking * rng.uniform(*_PART) / share, *_FACTORS))
    factors = [round(factor * (1 - _SPREAD), 4), round(factor * (1 + _SPREAD), 4)]
    what = ("quarters", "buildings")[int(rng.integers(2))]
    return "height_scaling", {"what": what, "share": share, "factors": factors}


def _ground(miss: float, rng: np.random.Generator) -> Move:
    if miss > 0:
        bare = round(float(np.clip(miss * rng.uniform(*_PART), 0.01, _MOST_BARE)), 4)
        return "quarter_fusion", {"fill": [1 - bare, 0.0, bare], "void": True}
    if rng.random() >= _COPIED:
        return "quarter_refill", _blocks(miss, rng) | {"density": _between(_DENSER, rng)}
    count = int(np.clip(round(-miss * rng.uniform(*_PART) / _BY_COPY), 1, _MOST_COPIES))
    return "relocation", {"mode": "copy", "count": count, "tolerance": _TOLERANCE}


def _widths(miss: float, rng: np.random.Generator) -> Move:
    if miss > 0:
        return "plan_change", {"kinds": ["closing", "width"]}
    return "quarter_refill", _blocks(miss, rng) | {"widened": _between(_WIDER, rng)}


def _blocks(miss: float, rng: np.random.Generator) -> dict[str, Any]:
    most = _FEW_BLOCKS + int(_MORE_BLOCKS * min(abs(miss), 1.0))
    return {"street_blocks": int(rng.integers(1, most))}


def _between(ends: tuple[float, float], rng: np.random.Generator) -> float:
    return round(float(rng.uniform(*ends)), 4)


#: The levers by measure.
LEVERS: Mapping[str, Lever] = MappingProxyType(
    {
        name: {"heights": _heights, "ground": _ground, "widths": _widths}[changed]
        for name, changed in LEVER_OF.items()
    }
)


def misses_of(aims: Aims, values: Mapping[str, float]) -> dict[str, float]:
    """Return the miss of each goal with a target, as a share of the target: below 0 for too little.
    A target of 0 counts as 1."""
    misses = {}
    for aim in aims.wanted:
        target = None if aim.objective is None else aim.objective.target
        value = values.get(aim.measure.name)
        if target is not None and value is not None:
            misses[aim.measure.name] = (value - target) / (abs(target) or 1.0)
    return misses


def draw_move(aims: Aims, values: Mapping[str, float], rng: np.random.Generator) -> Move | None:
    """Draw a measure by the misses of an individual with these ``values``, and a move that makes up
    for the miss. None for a measure without a lever, and if nothing is missed."""
    misses = misses_of(aims, values)
    chances = np.array([abs(miss) ** _POWER for miss in misses.values()])
    if not chances.sum() > 0 or not np.isfinite(chances).all():
        return None
    name = list(misses)[int(rng.choice(len(misses), p=chances / chances.sum()))]
    return LEVERS[name](misses[name], rng) if name in LEVERS else None
