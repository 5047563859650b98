"""What a run wanted of each measure, in words and signs; by its recipe and what it noted.

Nothing of the run is executed. `evocity.search.judging` has the same as losses of all goals
together, and refuses a run that does not tell them; here a stranger's run says what it can.
"""

import math
import sys
import tomllib
from dataclasses import dataclass, replace

import numpy as np

from evocity import fitness
from evocity.fitness.part import own_name
from evocity.store import Run

_MOST = sys.float_info.max


@dataclass(frozen=True)
class Aim:
    """A measure of the run and what was wanted of it: max, min, like, a target, bounds (for a
    constraint alone), or unknown; what it counted in if it was part of a sum; what it tells, if it
    is known here; and what it should be ``like``."""

    name: str
    unit: str
    goal: str
    target: float | None = None
    low: float | None = None
    high: float | None = None
    total: str | None = None
    meaning: str = ""
    like: str = "one city"

    @property
    def wanted(self) -> str:
        """The goal in words."""
        words = {
            "max": "more is better",
            "min": "less is better",
            "like": f"as in {self.like}",
            "bounds": "",
            "none": "recorded",
        }
        parts = [words.get(self.goal, "as its file declares")]
        if self.target is not None:
            parts = [f"{self.target:.4g} {self.unit}".rstrip() + " is wanted"]
        parts.append(self.bounds)
        if self.total is not None:
            parts.append(f"part of {self.total}")
        return ", ".join(part for part in parts if part)

    @property
    def bounds(self) -> str:
        """The bounds in words; nothing if there are none."""
        told = ("at least", self.low), ("at most", self.high)
        return ", ".join(f"{w} {b:.4g} {self.unit}".rstrip() for w, b in told if b is not None)

    @property
    def sign(self) -> str:
        """The goal as a sign: ↑ more, ↓ less, →0.35 a target, ≥ and ≤ bounds; nothing if it is
        unknown."""
        if self.target is not None:
            return f"→{self.target:.4g}"
        if self.goal == "bounds":
            bounds = ("≥", self.low), ("≤", self.high)
            return " ".join(f"{sign}{b:.4g}" for sign, b in bounds if b is not None)
        return {"max": "↑", "min": "↓"}.get(self.goal, "")

    @property
    def sought(self) -> bool:
        """Whether it is more than a constraint."""
        return self.goal != "bounds"

    @property
    def _bounds(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    def within(self, values: np.ndarray) -> np.ndarray:
        """Bool: which ``values`` keep the bounds."""
        low, high = self._bounds
        return (low <= values) & (values <= high) | ((low, high) == (-math.inf, math.inf))

    def losses(self, values: np.ndarray) -> np.ndarray:
        """Float64, lower is better, in the order of `evocity.fitness.Wanted`; that one needs the
        measure itself, which a stranger's run may not have. NaN where there is no value; of bounds
        alone the largest number, for it breaks them."""
        with np.errstate(all="ignore"):
            if self.goal == "bounds":
                low, high = self._bounds
                beyond = np.fmax(np.fmax(low - values, values - high), 0.0)
                return np.where(np.isnan(values), _MOST, np.minimum(beyond, _MOST))
            if self.target is not None:
                return np.minimum(np.abs(values - self.target), _MOST)
        return values if self.goal == "min" else -values  # of an unknown goal: an order, no more

    def loss(self, value: float) -> float:
        """As `losses`, of one value."""
        return float(self.losses(np.float64(value)))


def recipe_of(run: Run) -> dict:
    """The run's recipe as plain values; empty if its text cannot be read."""
    try:
        return tomllib.loads(run.recipe_text)
    except (ValueError, RecursionError):
        return {}


def overrides_of(run: Run) -> dict:
    """What replaced the recipe's values, as {"run.seed": 8}."""
    recipe = run.provenance.get("recipe")
    found = recipe.get("overrides") if isinstance(recipe, dict) else None
    return found if isinstance(found, dict) else {}


def aims_of(run: Run) -> list[Aim]:
    """What was wanted of each measure, one a measure in the recipe's order; what the run noted
    goes before what its recipe says."""
    stated: dict = {}
    for told in (recipe_of(run).get("fitness"), run.provenance.get("fitness")):
        entries = told if isinstance(told, list) else []
        stated |= {str(one.get("name")): one for one in entries if isinstance(one, dict)}
    return [stated_aim(name, stated.get(name, {})) for name in run.header.measures]


def recorded_of(run: Run) -> list[Aim]:
    """One a measure that is recorded besides; nothing is wanted of it."""
    told = run.provenance.get("recorded")
    entries = told if isinstance(told, list) else []
    noted = {str(one.get("name")): one for one in entries if isinstance(one, dict)}
    return [
        replace(stated_aim(name, noted.get(name, {})), goal="none") for name in run.header.recorded
    ]


def stated_aim(name: str, stated: dict) -> Aim:
    """The measure ``name``, with what is ``stated`` of it, as a recipe or provenance has it."""
    known = {measure.name: measure for measure in fitness.measures(None)}.get(own_name(name))
    target, low, high = (number_of(stated.get(key)) for key in ("target", "min", "max"))
    own = known.goal if known else None
    if (low, high) != (None, None) and stated.get("goal") is None and target is None:
        own = "bounds"
    goal = str(stated.get("goal") or ("like" if stated.get("like") else own) or "unknown")
    total = stated.get("objective")
    return Aim(
        name,
        known.unit if known else _plain(stated.get("unit")),
        goal,
        target,
        low,
        high,
        _plain(total) if isinstance(total, str) else None,
        known.summary if known else _plain(stated.get("summary")),
    )


def _plain(told: object) -> str:
    """A text of a stranger's file that can be shown; "" for what is none."""
    return "".join(filter(str.isprintable, told)) if isinstance(told, str) else ""


def number_of(value: object) -> float | None:
    """A finite number of a stranger's file, else None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None


__all__ = ["Aim", "aims_of", "number_of", "overrides_of", "recipe_of", "recorded_of", "stated_aim"]
