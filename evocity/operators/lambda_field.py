"""λ-field: which street blocks of one parent get the fabric of others, told by few numbers."""

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.genome import PROVENANCE, Genome
from evocity.operators.crossing import Draft, Drafting, check_call
from evocity.operators.fields import DIGITS, MOST_SIDE, field_weights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check, at_fault
from evocity.operators.quarter_fusion import filling_checks
from evocity.operators.street_blocks import Filling, Fit
from evocity.pavement import Pavement

#: Of so many sets of parents it is remembered what fits where; the latest.
_REMEMBERED = 4


@dataclass(frozen=True)
class LambdaField(Drafting):
    """Street blocks of the first parent filled with the fabric of others, as a field of λ tells.

    For each further parent there is a field of ``side`` × ``side`` values, smooth in between. A
    street block of the first parent takes the other's fabric where the field reaches the block's
    own threshold. Of the blocks around one value the thresholds are spread evenly between 0 and 1,
    those that the other's fabric fits best first: so λ is the share of them that is the other's,
    and each step of it changes something. Where several parents reach a block, the one that
    exceeds its threshold by most has it. Values of 0 give the first parent.

    A block gets what the other has in the same place, if that is whole buildings and other than
    what stands there; else the other's buildings from where they fit best (`QuarterFusion`).
    Either way no building is cut, and streets stay where they are. Nothing of that is drawn:
    parents and values decide, so an optimiser can look for the best field (`evocity refine`).

    Parameters
    ----------
    side : values along each side of a field, 1…64.
    values : the fields' values, 0…1, row by row from the north-west, one field after another for
        each parent but the first; None draws them evenly. Four digits count.
    area_min, density, facades, repeats : as in `QuarterFusion`.
    repair, reach, domains : as in `Drafting`.

    ``made`` tells the ``values``, and how many ``street_blocks`` were filled, by which of the
    parents (``filled_by``), and how many of these from their own place (``in_place``).

    Source: the λ_i of Marsault 2002 §3.5, by street blocks in place of lifs, which crumble.
    """

    side: int = 4
    values: Sequence[float] | None = None
    area_min: float = 300.0
    density: float = 0.5
    facades: float = 0.25
    repeats: float = 0.65

    name = "lambda_field"
    parents = (2, None)
    #: Bare ground without a stone may be laid.
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        shared = filling_checks()
        return {
            "side": (lambda side: 1 <= side <= MOST_SIDE, f"1…{MOST_SIDE}"),
            "values": (
                lambda values: values is None or all(0 <= one <= 1 for one in values),
                "numbers of 0…1, or none",
            ),
            **{key: shared[key] for key in ("area_min", "density", "facades", "repeats")},
        }

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless there are as many ``values`` as ``count`` parents need."""
        wanted = (count - 1) * self.side**2
        if self.values is not None and len(self.values) != wanted:
            allowed = f"{wanted}, {self.side} × {self.side} for each parent but the first"
            raise at_fault(self.name, {"values": (f"{len(self.values)} numbers", allowed)})

    def choice(self, parents: Sequence[Genome]) -> np.ndarray:
        """Which of the ``parents`` each street block's fabric would be of, int64 ``(n,)``, of
        those that may be filled; 0 where it stays. Fields of one choice give one child.

        Raises `OperatorError` unless ``values`` are told, as many as are needed.
        """
        check_call(self, parents, np.random.default_rng(0))
        if self.values is None:
            raise at_fault(self.name, {"values": ("none", "numbers of 0…1")})
        return self._places(parents).chosen(self._rounded(self.values, len(parents)))

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        self.check_count(len(parents))
        count = (len(parents) - 1) * self.side**2
        values = self._rounded(
            rng.random(count) if self.values is None else self.values, len(parents)
        )
        places = self._places(parents)
        chosen = places.chosen(values)
        filling = places.filled(chosen)
        filled_by = np.bincount(chosen, minlength=len(parents))[1:]
        made = {
            "side": self.side,
            "values": values.ravel().tolist(),
            "street_blocks": int(filled_by.sum()),
            "filled_by": filled_by.tolist(),
            "in_place": places.kept(chosen),
        }
        return Draft(filling.genome(), filling.intended(), made)

    def _rounded(self, values, count: int) -> np.ndarray:
        """``(count − 1, side, side)``."""
        return np.round(np.asarray(values, float), DIGITS).reshape(count - 1, self.side, self.side)

    def _places(self, parents: Sequence[Genome]) -> "_Places":
        """What of the parents fits where; remembered, since it takes as long as many children."""
        how = self.side, self.area_min, self.density, self.facades, self.repeats
        key = how, *map(_identity, parents)
        if key not in _remembered:
            _remembered[key] = _Places(tuple(parents), common_grid(self.name, parents, 0.0), *how)
        _remembered.move_to_end(key)
        while len(_remembered) > _REMEMBERED:
            _remembered.popitem(last=False)
        return _remembered[key]


_remembered: OrderedDict[tuple, "_Places"] = OrderedDict()


def _identity(genome: Genome) -> tuple:
    """What tells a genome with its provenance, which is no part of its digest."""
    state = hashlib.blake2b(digest_size=16)
    for name in PROVENANCE:
        state.update(np.ascontiguousarray(getattr(genome, name)).tobytes())
    place = genome.cities, genome.attribution, genome.origin, genome.crs, genome.sigma_max
    return genome.digest, state.digest(), *place


class _Places:
    """What of other parents fits into the street blocks of the first, and at which λ it is laid."""

    def __init__(self, parents, grid: Pavement, side, area_min, density, facades, repeats):
        self._parents, self._grid = parents, grid
        self._how = {
            "spread": 0.0,
            "density": density,
            "facades": facades,
            "repeats": repeats,
        }
        first = self._filling()
        self._numbers = first.numbers(area_min)
        labels = first.host.labels
        self._weights = field_weights(labels, self._numbers, side)
        self._fits: list[list[Fit | None]] = []
        self._own: list[np.ndarray] = []
        self._thresholds = np.full((len(parents) - 1, self._numbers.size), np.inf)
        for donor in range(1, len(parents)):
            fits, own, worse = self._fitted(donor, first.host)
            self._fits.append(fits)
            self._own.append(own)
            there = np.array([fit is not None for fit in fits], bool)
            self._thresholds[donor - 1] = _thresholds(self._weights, worse, there)

    def _filling(self) -> Filling:
        return Filling(self._parents, self._grid, **self._how)

    def _fitted(self, donor: int, host) -> tuple[list[Fit | None], np.ndarray, np.ndarray]:
        """Of each block the fit, whether it is in its own place, and how badly it fits."""
        filling, rng = self._filling(), np.random.default_rng(0)  # which decides nothing
        fits: list[Fit | None] = []
        own, worse = np.zeros(self._numbers.size, bool), np.zeros(self._numbers.size)
        # the larger have fewer places to choose from
        order = np.argsort(-host.area[self._numbers], kind="stable")
        found: dict[int, Fit | None] = {}
        for at in order.tolist():
            number = int(self._numbers[at])
            fit = filling.in_place(number, donor)
            own[at] = fit is not None
            if fit is None:
                fit = filling.fit(number, donor, rng)
            found[at] = fit
            if fit is not None:
                filling.lay(number, donor, fit)
                area = host.area[number]
                worse[at] = abs(np.count_nonzero(fit.kept) - host.covered[number]) / area
        fits = [found[at] for at in range(self._numbers.size)]
        return fits, own, worse - own

    def chosen(self, values: np.ndarray) -> np.ndarray:
        """The parent of each block's fabric by fields ``(parents − 1, side, side)``."""
        fields = (self._weights[None] * values.reshape(len(values), 1, -1)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            beyond = fields - self._thresholds
        best = beyond.argmax(axis=0)
        reached = np.take_along_axis(beyond, best[None], 0)[0] >= 0
        return np.where(reached, best + 1, 0)

    def filled(self, chosen: np.ndarray) -> Filling:
        filling = self._filling()
        for at in np.flatnonzero(chosen).tolist():
            donor = int(chosen[at])
            filling.lay(int(self._numbers[at]), donor, self._fits[donor - 1][at])
        return filling

    def kept(self, chosen: np.ndarray) -> int:
        """How many of the blocks chosen are filled from their own place."""
        filled = np.flatnonzero(chosen)
        return int(sum(self._own[chosen[at] - 1][at] for at in filled.tolist()))


def _thresholds(weights: np.ndarray, worse: np.ndarray, there: np.ndarray) -> np.ndarray:
    """At which value each block changes: of those ``there`` that one value counts most in, the
    first of k at 1/(2k), and so on, in the order of how much ``worse`` they fit; others never."""
    found = np.full(len(weights), np.inf)
    nearest = weights.argmax(axis=1)
    for value in np.unique(nearest[there]):
        among = np.flatnonzero(there & (nearest == value))
        order = among[np.argsort(worse[among], kind="stable")]
        found[order] = (np.arange(order.size) + 0.5) / order.size
    return found


__all__ = ["LambdaField"]
