"""How one individual is bred and evaluated, whatever an operator or a measure does."""

import math
import time
import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from evocity import fitness
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import EvocityError, FitnessError
from evocity.fitness.part import Part, own_name, part_of, within
from evocity.fitness.shipping import Shipment, unpacked
from evocity.genome import Genome
from evocity.kinds import Expressed
from evocity.pavement.levels import USUAL
from evocity.search.door import admitted
from evocity.search.looks import look_of
from evocity.store import Header

#: An error's text in the log is no longer.
MOST_LETTERS = 2000
# Of a longer text the rest is not looked at.
_ENOUGH = 10 * MOST_LETTERS
#: How the text begins in which a birth that is ok tells of measures without a value.
UNRECORDED = "not recorded: "


@dataclass(frozen=True)
class Setup:
    """What a worker must know. ``measures``: (name, file or None) in the recipe's order, those that
    are recorded besides last; ``within``: the parts of the map that measures are taken of, by
    their names;
    ``condensation``: what is locked in every genome, or None; ``shipped``: measures of the user's
    session, which another process does not know by name; ``references``: what the measures that
    compare cities compare with, by their names; ``sources``: the maps of the source cities, for
    measures that ask for them; ``sides``, ``parts``: the kernels it calls, as
    `evocity.search.warm` names them; ``bounds``: the measures that are constraints alone;
    ``moved``: folders that files of measures were brought to -> those that errors name."""

    header: Header
    measures: tuple[tuple[str, str | None], ...]
    condensation: Condensation | None = None
    shipped: tuple[Shipment, ...] = ()
    sides: int | tuple[int, int] = USUAL
    parts: tuple[str, ...] = ()
    references: Mapping[str, fitness.Reference] = field(default_factory=dict)
    sources: tuple[CityMap, ...] = ()
    within: Mapping[str, Part] = field(default_factory=dict)
    bounds: frozenset[str] = frozenset()
    moved: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """How breeding or evaluating one individual ended; ``status`` as in `evocity.store`.

    ``error`` becomes one line of at most `MOST_LETTERS`, whatever a measure raised. ``genome``: of
    one that was bred; None where breeding failed, or nothing was to be bred. ``look``: how the map
    of one looks that was evaluated well, see `evocity.search.looks`. ``thumbnail``: its small map,
    where the log has them, see `evocity.store.Thumbnails`.
    """

    status: str
    error: str | None = None
    seconds: float = 0.0
    values: Mapping[str, float] = field(default_factory=dict)
    genome: Genome | None = None
    look: np.ndarray | None = field(default=None, repr=False, compare=False)
    thumbnail: bytes | None = field(default=None, repr=False, compare=False)

    def __post_init__(self):
        if self.error is not None:
            short = self.error[:_ENOUGH]
            line = " ".join(short.split()).encode(errors="replace").decode()
            line = line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 1] + "…"
            object.__setattr__(self, "error", line)


class Evaluator:
    """Breeds and evaluates; never raises for what an operator or a measure does."""

    def __init__(self, setup: Setup):
        self.header, self.condensation = setup.header, setup.condensation
        self.sources = setup.sources or None
        files = {file for _, file in setup.measures if file is not None}
        loaded = {file: {m.name: m for m in fitness.load_file(file)} for file in sorted(files)}
        loaded[None] = {m.name: m for one in setup.shipped for m in unpacked(one)}
        self.within, self.bounds = setup.within, setup.bounds
        self.measures = {}
        for name, file in setup.measures:
            own = own_name(name)
            found = loaded[file][own] if file or own in loaded[None] else fitness.get(own)
            self.measures[name] = within(found, part_of(name)) if name in self.within else found
        for name, reference in setup.references.items():
            self.measures[name] = self.measures[name].bound(reference)

    def born(
        self,
        operator,
        parents: Sequence[Genome],
        rng: np.random.Generator,
        measured: bool = True,
    ) -> Outcome:
        """Bred and evaluated at once: what `evaluate` says of the child, its genome in
        ``.genome``; what `breed` says where that failed, without a genome, and of one that is not
        to be ``measured``.

        Without an operator the individual is the one of ``parents``, bred from none.
        """
        if operator is None:
            return replace(self.evaluate(parents[0], small=True), genome=parents[0])
        bred = self.breed(operator, parents, rng)
        if bred.genome is None or not measured:
            return bred
        found = self.evaluate(bred.genome, parents, small=True)
        return replace(found, seconds=bred.seconds + found.seconds, genome=bred.genome)

    def breed(self, operator, parents: Sequence[Genome], rng: np.random.Generator) -> Outcome:
        """The child's genome in ``.genome``, in the terms of the run's header."""
        start = time.perf_counter()
        try:
            if hasattr(operator, "bred_within"):  # it measures while it breeds
                operator = operator.bred_within(self)
            child = self.header.chromosome.bred(operator, parents, rng)
            genome = admitted(child, self.header, self.condensation)
        except KeyboardInterrupt:  # the user's own, when everything runs in one process
            raise
        except BaseException as error:
            return Outcome(_status(error), told(error), time.perf_counter() - start)
        return Outcome("ok", None, time.perf_counter() - start, genome=genome)

    def evaluate(
        self,
        genome: Genome,
        parents: Sequence[Genome] = (),
        names: Collection[str] | None = None,
        small: bool = False,
    ) -> Outcome:
        """Decode, then every measure; the first that raises ends it, values until then kept. Of
        those that are recorded besides, none ends it: ``error`` tells why one has no value, and so
        it does of a constraint that is undefined, which is broken then.

        ``parents``: the genomes it was bred from, for measures that ask for them; none for one
        that was not bred, which is its own parent. ``names``: the measures that are taken, all
        unless they are told. ``small``: with its thumbnail, where the log has them.
        """
        start = time.perf_counter()
        parents = parents or (genome,)
        values: dict[str, float] = {}
        undefined: list[str] = []
        missing: list[str] = []

        expressed = self.header.chromosome.express(genome)
        made = self.header.thumbnails if small and expressed.city is not None else None
        packed = None if made is None else made.packed(expressed.city)

        def ended(status: str, error: str | None = None) -> Outcome:
            return Outcome(status, error, time.perf_counter() - start, values, thumbnail=packed)

        if expressed.city is None:
            return ended("invalid", expressed.problem)
        fabric = self.header.chromosome.fabric
        fabrics = {"genome": fabric(genome), "parents": tuple(map(fabric, parents))}
        extras = fabrics | {"sources": self.sources}
        wanted = [one for one in self.header.measures if names is None or one in names]
        for name in wanted:
            try:
                value = self._measured(name, expressed, extras)
            except FitnessError as error:
                # a measure that raised has a cause; one that returned no number has none
                return ended(_status(error) if error.__cause__ else "invalid", told(error))
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                return ended(_status(error), f"{name}: {told(error)}")
            if name in self.bounds and math.isnan(value):
                missing.append(f"{_undefined(name, value)}, which breaks its bound")
                continue
            values[name] = float(value)
            if not math.isfinite(value):
                undefined.append(_undefined(name, value))
        recorded = [one for one in self.header.recorded if names is None or one in names]
        missing += self._record(recorded, expressed, extras, values)
        if undefined:
            return ended("invalid", "; ".join(undefined))
        found = ended("ok", unrecorded(missing) if missing else None)
        return replace(found, look=look_of(expressed.city))

    def evaluate_within(self, genome: Genome, part: Part) -> Outcome:
        """Decode, then every measure of a ``part`` of the map; one that is of a part already stays
        of that. None that cannot be taken ends it: ``error`` tells why one has no value."""
        start = time.perf_counter()
        values: dict[str, float] = {}
        expressed = self.header.chromosome.express(genome)
        if expressed.city is None:
            return Outcome("invalid", expressed.problem, time.perf_counter() - start)
        extras = {"genome": self.header.chromosome.fabric(genome)}
        names = [*self.header.measures, *self.header.recorded]
        missing = self._record(names, expressed, extras, values, part)
        error = unrecorded(missing) if missing else None
        return Outcome("ok", error, time.perf_counter() - start, values)

    def _measured(
        self, name: str, expressed: Expressed, extras: Mapping, part: Part | None = None
    ) -> float:
        measure, part = self.measures[name], self.within.get(name, part)
        if part is None:
            return measure(expressed.of(measure.of), **extras)
        if measure.of != "city":
            raise FitnessError(
                f"{name}, of a {measure.of}, within {part.name}",
                "a measure of a city",
                "take it of the whole map",
            )
        return part.measured(measure, expressed.city, genome=extras["genome"])

    def _record(
        self,
        names: Sequence[str],
        expressed: Expressed,
        extras: Mapping,
        values: dict[str, float],
        part: Part | None = None,
    ) -> list[str]:
        """Add what is recorded besides, of a ``part`` or the whole map, to the ``values``; why
        those that have none do not."""
        missing = []
        for name in names:
            try:
                value = self._measured(name, expressed, extras, part)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                text = told(error)
                missing.append(text if text.startswith(name) else f"{name}: {text}")
                continue
            if math.isfinite(value):
                values[name] = float(value)
            else:
                missing.append(_undefined(name, value))
        return missing


def unrecorded(reasons: Sequence[str]) -> str:
    """What a birth that is ok tells of the measures that it has no value of."""
    return UNRECORDED + "; ".join(reasons)


def _undefined(name: str, value: float) -> str:
    return f"{name} is {float(value)}: {getattr(value, 'reason', 'no reason given')}"


def _status(error: BaseException) -> str:
    """Of what raised: `memory` if there was no more of it."""
    short = isinstance(error, MemoryError) or isinstance(error.__cause__, MemoryError)
    return "memory" if short else "error"


def told(error: BaseException) -> str:
    """One line: type, message, and where in the user's code; never raises."""
    try:
        return _told(error)
    except KeyboardInterrupt:
        raise
    except BaseException:  # an exception's own text may be at fault
        return f"{type(error).__name__}, whose text cannot be told"


def _told(error: BaseException) -> str:
    if isinstance(error, EvocityError):
        text = f"{error.found} (expected: {error.expected})"
    else:
        frames = traceback.extract_tb(error.__traceback__)
        place = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        text = f"{type(error).__name__}: {error}{place}"
    line = " ".join(text[:_ENOUGH].split())
    # a lone surrogate, as in the name of a strange file, cannot be written down
    return line.encode(errors="replace").decode()[:MOST_LETTERS]
