"""Goals of a run's measures in words and signs, by its recipe and provenance.

Nothing of the run is executed. `evocity.search.record.aims` returns the same as losses, and refuses
a run that does not record its goals; here a stranger's run shows what it states.
"""

import math
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from evocity import fitness
from evocity.errors import is_number, is_whole
from evocity.fitness.part import own_name
from evocity.store import RunLog

_MOST = sys.float_info.max
# More planned generations than this are damage.
_MOST_GENERATIONS = 10**9


@dataclass(frozen=True)
class Aim:
    """Goal of a run for one measure: a direction, a target, or bounds.

    The field ``goal`` is one of the words "max", "min", "like", "target", "bounds", "none" and
    "unknown". The goal "bounds" means that the measure is only a constraint. The goal "none" means
    that the run only records the measure. The field ``total`` is the name of the weighted sum that
    contains the measure. The field ``meaning`` says in a sentence what the measure computes; the
    field is empty for an unknown measure. The field ``like`` names the city that the births should
    resemble.
    """

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
    def title(self) -> str:
        """Name and unit of the measure, for example "street_width, m"."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def wanted(self) -> str:
        """Goal in words."""
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
        """Bounds of the measure in words; the text is empty if the measure has no bounds."""
        bounds = ("at least", self.low), ("at most", self.high)
        return ", ".join(f"{w} {b:.4g} {self.unit}".rstrip() for w, b in bounds if b is not None)

    @property
    def sign(self) -> str:
        """Goal of the measure as a sign: ↑ for large values, ↓ for small values, →0.35 for the
        target 0.35, ≥ and ≤ for bounds. The sign is empty if the goal is unknown."""
        if self.target is not None:
            return f"→{self.target:.4g}"
        if self.goal == "bounds":
            bounds = ("≥", self.low), ("≤", self.high)
            return " ".join(f"{sign}{b:.4g}" for sign, b in bounds if b is not None)
        return {"max": "↑", "min": "↓"}.get(self.goal, "")

    @property
    def sought(self) -> bool:
        """True if the measure has a goal; false if the measure has only bounds."""
        return self.goal != "bounds"

    @property
    def _bounds(self) -> tuple[float, float]:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high

    def within(self, values: np.ndarray) -> np.ndarray:
        """Return an array of bool that is true for each value within the bounds."""
        low, high = self._bounds
        return (low <= values) & (values <= high) | ((low, high) == (-math.inf, math.inf))

    def losses(self, values: np.ndarray) -> np.ndarray:
        """Compute the losses of the ``values``, as a float64 array; a lower loss is better. The
        losses rank values in the same order as `evocity.fitness.Wanted`, but can be computed
        without the function of the measure. A missing value gets the loss NaN. If the measure has
        only bounds, a missing value breaks the bounds and has the largest possible loss."""
        with np.errstate(all="ignore"):
            if self.goal == "bounds":
                low, high = self._bounds
                beyond = np.fmax(np.fmax(low - values, values - high), 0.0)
                return np.where(np.isnan(values), _MOST, np.minimum(beyond, _MOST))
            if self.target is not None:
                return np.minimum(np.abs(values - self.target), _MOST)
        return values if self.goal == "min" else -values  # of an unknown goal: an order, no more

    def loss(self, value: float) -> float:
        """Compute the loss of one value, as the method `losses` does for several values."""
        return float(self.losses(np.float64(value)))


def recipe_of(run: RunLog) -> dict:
    """Return the run's recipe as plain values; empty if its text cannot be read."""
    try:
        return tomllib.loads(run.recipe_text)
    except (ValueError, RecursionError):
        return {}


def overrides_of(run: RunLog) -> dict:
    """Return the values that replaced the recipe's, as {"run.seed": 8}."""
    recipe = run.provenance.get("recipe")
    overrides = recipe.get("overrides") if isinstance(recipe, dict) else None
    return overrides if isinstance(overrides, dict) else {}


def aims_of(run: RunLog) -> list[Aim]:
    """Return what was wanted of each measure, by provenance, else by the recipe, in its order."""
    stated: dict = {}
    for listed in (recipe_of(run).get("fitness"), run.provenance.get("fitness")):
        stated |= _named(listed)
    return [stated_aim(name, stated.get(name, {})) for name in run.header.measures]


def recorded_of(run: RunLog) -> list[Aim]:
    """Return the measures that are only recorded."""
    noted = _named(run.provenance.get("recorded"))
    return [
        replace(stated_aim(name, noted.get(name, {})), goal="none") for name in run.header.recorded
    ]


def stated_aim(name: str, stated: dict) -> Aim:
    """Return the measure ``name`` with what a recipe or provenance ``stated`` of it."""
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


def _named(listed: object) -> dict[str, dict]:
    """Name -> table, of a list of tables in a stranger's file."""
    entries = listed if isinstance(listed, list) else []
    return {str(one.get("name")): one for one in entries if isinstance(one, dict)}


def planned_generations(run: RunLog) -> int | None:
    """Return the generations after the first population; None if the recipe is unreadable."""
    recipe = recipe_of(run)
    section = recipe.get("run", {})
    stated = section.get("generations") if isinstance(section, dict) else None
    if stated is None and recipe:
        from evocity.recipe.sections import RunSection  # slow to load

        stated = RunSection.model_fields["generations"].default
    known = overrides_of(run).get("run.generations", stated)
    return known if is_whole(known) and 0 <= known <= _MOST_GENERATIONS else None


def figure_texts(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the figures of a search algorithm for people: "qd score" and its value."""
    return [
        ("".join(filter(str.isprintable, name)).replace("_", " "), f"{value:.4g}")
        for name, value in figures.items()
    ]


def _plain(text: object) -> str:
    """A text of a stranger's file in printable letters; "" for other values."""
    return "".join(filter(str.isprintable, text)) if isinstance(text, str) else ""


def number_of(value: object) -> float | None:
    """Return a finite number of a stranger's file; None for other values."""
    if not is_number(value):
        return None
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:
        return None
