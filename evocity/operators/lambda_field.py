"""λ-field: street blocks of the first parent get the fabric of others, by fields of numbers."""

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from evocity.genome import PROVENANCE, Genome
from evocity.operators.crossover import Draft, Drafting, check_call, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check, at_fault
from evocity.operators.quarter_fusion import filling_checks
from evocity.operators.street_blocks import Filling, Fit
from evocity.pavement import Pavement

#: The most values along a side of a field.
_MOST_SIDE = 64
#: Digits after the point that values keep, so that the log has what was laid.
DIGITS = 4

#: Sets of parents in the cache of fits.
_CACHED = 4


@dataclass(frozen=True)
class LambdaField(Drafting):
    """Fill street blocks of the first parent with the fabric of other parents, according to fields
    of λ.

    Each parent but the first has a field of ``side`` × ``side`` values λ, interpolated smoothly.
    Each street block has a threshold for each parent but the first, and takes the fabric of the
    parent whose field reaches the threshold. If several fields reach their thresholds, the parent
    with the largest excess over its threshold fills the street block. The thresholds of the street
    blocks near each value of a field are spread evenly between 0 and 1. For each parent but the
    first, the lowest threshold belongs to the street block that the parent's fabric fits best. The
    value λ of a field is the share of street blocks that the field's parent fills. If all values of
    the fields are 0, the child equals the first parent.

    A street block takes the fabric at the same place of the chosen parent. The fabric at this place
    must consist of whole buildings, and must differ from the block's present fabric. If the fabric
    at the same place is not suitable, a block takes the best fitting buildings from elsewhere in
    the chosen parent, as in `QuarterFusion`. The child cuts no building and keeps the streets of
    the first parent. Parents and values determine the child without random draws, so an optimiser
    can search the best field (``evocity refine``).

    Parameters
    ----------
    side : number of values along each side of a field, 1…64.
    values : values of the fields, 0…1, row by row from the north-west, field after field, with four
        digits. If ``values`` is None, all values are drawn evenly between 0 and 1.
    area_min, density, facades, repeats : rules for filling street blocks, as in `QuarterFusion`.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    The child's ``made`` holds the ``values``, and the number of filled ``street_blocks``. The
    result ``filled_by`` counts, for each parent, the blocks that this parent fills. The result
    ``in_place`` counts the blocks whose new fabric comes from the same place in another parent.

    Source: the λ_i of Marsault 2002 §3.5, for street blocks instead of lifs, because single lifs
    crumble.
    """

    side: int = 4
    values: Sequence[float] | None = None
    area_min: float = 300.0
    density: float = 0.5
    facades: float = 0.25
    repeats: float = 0.65

    name = "lambda_field"
    parents = (2, None)
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return {**field_checks(0, 1), **filling_checks()}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless the number of ``values`` is right for ``count`` parents."""
        check_values(self, count - 1, " for each parent but the first")

    def choice(self, parents: Sequence[Genome]) -> np.ndarray:
        """Choose a parent for each street block that may be filled, int64 ``(n,)``; the number 0
        keeps the present fabric of the block. Two fields that choose the same parents for all
        street blocks give the same child.

        Raises `OperatorError` if ``values`` are missing, or if the number of values is wrong.
        """
        check_call(self, parents, np.random.default_rng(0))
        if self.values is None:
            raise at_fault(self.name, {"values": ("none", "numbers of 0…1")})
        return self._places(parents).choose(self._round(self.values, len(parents)))

    def reason_unchanged(self, parents: Sequence[Genome]) -> str:
        """Explain why the ``values`` fill no street block; an empty text if they fill one."""
        if self.values is None or self.choice(parents).any():
            return ""
        return self._places(parents).reason_unchanged(self._round(self.values, len(parents)))

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        self.check_count(len(parents))
        values = self.values
        if values is None:
            values = rng.random((len(parents) - 1) * self.side**2)
        values = self._round(values, len(parents))
        places = self._places(parents)
        chosen = places.choose(values)
        filling = places.fill(chosen)
        filled_by = np.bincount(chosen, minlength=len(parents))[1:]
        made = {
            "side": self.side,
            "values": values.ravel().tolist(),
            "street_blocks": int(filled_by.sum()),
            "filled_by": filled_by.tolist(),
            "in_place": places.count_in_place(chosen),
        }
        return Draft(filling.genome(), filling.intended(), made)

    def _round(self, values, count: int) -> np.ndarray:
        """Round the values of all fields: ``(count − 1, side, side)``."""
        return np.round(np.asarray(values, float), DIGITS).reshape(count - 1, self.side, self.side)

    def _places(self, parents: Sequence[Genome]) -> "_Places":
        """Return the parents' places from a cache: they take as long as many children."""
        how = self.side, self.area_min, self.density, self.facades, self.repeats
        key = how, *map(_identity, parents)
        if key not in _cache:
            _cache[key] = _Places(tuple(parents), common_grid(self.name, parents, 0.0), *how)
        _cache.move_to_end(key)
        while len(_cache) > _CACHED:
            _cache.popitem(last=False)
        return _cache[key]


_cache: OrderedDict[tuple, "_Places"] = OrderedDict()


def _identity(genome: Genome) -> tuple:
    """Identify a genome with its provenance, which its digest omits."""
    state = hashlib.blake2b(digest_size=16)
    for name in PROVENANCE:
        state.update(np.ascontiguousarray(getattr(genome, name)).tobytes())
    place = genome.cities, genome.attribution, genome.origin, genome.crs, genome.sigma_max
    return genome.digest, state.digest(), *place


class _Places:
    """The fits of other parents in the street blocks of the first, with their thresholds of λ."""

    def __init__(self, parents, grid: Pavement, side, area_min, density, facades, repeats):
        how = {"spread": 0.0, "density": density, "facades": facades, "repeats": repeats}
        self._begin_filling = partial(Filling, parents, grid, **how)
        first = self._begin_filling()
        self._numbers = first.numbers(area_min)
        self._labels, self._grid, self._parents = first.host.labels, grid, parents
        self._weights = field_weights(first.host.labels, self._numbers, side)
        self._fits: list[list[Fit | None]] = []
        self._in_place: list[np.ndarray] = []
        self._thresholds = np.full((len(parents) - 1, self._numbers.size), np.inf)
        for donor in range(1, len(parents)):
            fits, in_place, misfit = self._fit_blocks(donor, first.host)
            self._fits.append(fits)
            self._in_place.append(in_place)
            able = np.array([fit is not None for fit in fits], bool)
            self._thresholds[donor - 1] = _thresholds(self._weights, misfit, able)

    def _fit_blocks(self, donor: int, host) -> tuple[list[Fit | None], np.ndarray, np.ndarray]:
        """Find for each block its fit, whether that is its own place, and its misfit."""
        filling, rng = self._begin_filling(), np.random.default_rng(0)  # the draws have no effect
        count = self._numbers.size
        fits: list[Fit | None] = [None] * count
        in_place, misfit = np.zeros(count, bool), np.zeros(count)
        # the largest first: they have the fewest places to choose from
        order = np.argsort(-host.area[self._numbers], kind="stable")
        for at in order.tolist():
            number = int(self._numbers[at])
            fit = filling.in_place(number, donor)
            in_place[at] = fit is not None
            if fit is None:
                fit = filling.fit(number, donor, rng)
            fits[at] = fit
            if fit is not None:
                filling.lay(number, donor, fit)
                area = host.area[number]
                misfit[at] = abs(np.count_nonzero(fit.kept) - host.covered[number]) / area
        return fits, in_place, misfit - in_place

    def choose(self, values: np.ndarray) -> np.ndarray:
        """Choose the parent of each block's fabric by fields ``(parents − 1, side, side)``."""
        fields = (self._weights[None] * values.reshape(len(values), 1, -1)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            beyond = fields - self._thresholds
        best = beyond.argmax(axis=0)
        reached = np.take_along_axis(beyond, best[None], 0)[0] >= 0
        return np.where(reached, best + 1, 0)

    def reason_unchanged(self, values: np.ndarray) -> str:
        """Explain why fields ``(parents − 1, side, side)`` choose no parent for any block."""
        if not values.any():
            return "λ is 0 everywhere"
        if not self._numbers.size:
            return "the first parent has no large street block with buildings and without a lock"
        fields = (self._weights[None] * values.reshape(len(values), 1, -1)).sum(axis=2)
        here = fields > 0
        if not here.any():
            return "no street block of the first parent lies where λ is above 0"
        able = np.isfinite(self._thresholds) & here
        if not able.any():
            at = np.isin(self._labels, self._numbers[here.any(axis=0)])
            ours, *others = (
                self._grid.blocks(raw_heights(one))[at.ravel()] for one in self._parents
            )
            if all(np.array_equal(ours, one) for one in others):
                return "the parents are equal in the street blocks where λ is above 0"
            return "no buildings of the other parents fit the street blocks where λ is above 0"
        return (
            f"λ is at most {fields[able].max():.2f} in street blocks that first change at "
            f"{self._thresholds[able].min():.2f}"
        )

    def fill(self, chosen: np.ndarray) -> Filling:
        """Fill the blocks with the fabric of the ``chosen`` parents."""
        filling = self._begin_filling()
        for at in np.flatnonzero(chosen).tolist():
            donor = int(chosen[at])
            filling.lay(int(self._numbers[at]), donor, self._fits[donor - 1][at])
        return filling

    def count_in_place(self, chosen: np.ndarray) -> int:
        """Count the chosen blocks that are filled from their own place."""
        filled = np.flatnonzero(chosen)
        return int(sum(self._in_place[chosen[at] - 1][at] for at in filled.tolist()))


def _thresholds(weights: np.ndarray, misfit: np.ndarray, able: np.ndarray) -> np.ndarray:
    """Compute the value at which each block changes. The k ``able`` blocks nearest to a value
    change at 1/(2k), 3/(2k), and so on, by rising ``misfit``; other blocks never change."""
    thresholds = np.full(len(weights), np.inf)
    nearest = weights.argmax(axis=1)
    for value in np.unique(nearest[able]):
        among = np.flatnonzero(able & (nearest == value))
        order = among[np.argsort(misfit[among], kind="stable")]
        thresholds[order] = (np.arange(order.size) + 0.5) / order.size
    return thresholds


def field_checks(least: float, most: float) -> dict[str, Check]:
    """Return the checks of the parameters ``side`` and ``values`` of a field."""
    return {
        "side": (lambda side: 1 <= side <= _MOST_SIDE, f"1…{_MOST_SIDE}"),
        "values": (
            lambda values: values is None or all(least <= value <= most for value in values),
            f"numbers of {least:g}…{most:g}, or none",
        ),
    }


def check_values(operator, fields: int = 1, where: str = "") -> None:
    """Raise `OperatorError` unless an ``operator`` has ``side`` × ``side`` values for each of its
    ``fields``, or None."""
    side, size = operator.side, fields * operator.side**2
    if operator.values is not None and len(operator.values) != size:
        fault = f"{len(operator.values)} numbers", f"{size}, {side} × {side}{where}"
        raise at_fault(operator.name, {"values": fault})


def field_weights(labels: np.ndarray, numbers: np.ndarray, side: int) -> np.ndarray:
    """Compute the weight of each value of a field of ``side`` × ``side`` in each part of a map.

    Values lie in the middle of equal squares of the map, linear in between, level beyond the
    outermost.

    labels : int ``(H, W)``, the part of each cell.
    numbers : int ``(n,)``, the labels of the parts.

    Returns float64 ``(n, side²)``, values row by row from the north-west; rows of sum 1.
    """
    rows, columns = (_linear(length, side) for length in labels.shape)
    at = np.zeros(int(labels.max(initial=0)) + 1, np.int64)
    at[numbers] = np.arange(1, numbers.size + 1)
    of = at[labels]
    weights = np.zeros((numbers.size, side * side))
    for row in range(side):
        for column in range(side):
            weight = rows[:, row, None] * columns[None, :, column]
            total = np.bincount(of.ravel(), weight.ravel(), numbers.size + 1)
            weights[:, row * side + column] = total[1:]
    return weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)


def _linear(length: int, side: int) -> np.ndarray:
    """Compute the weights of ``side`` values in each of ``length`` cells, ``(length, side)``."""
    place = np.clip((np.arange(length) + 0.5) * side / length - 0.5, 0, side - 1)
    return np.maximum(0, 1 - np.abs(place[:, None] - np.arange(side)))
