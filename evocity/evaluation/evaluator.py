"""Breeding and evaluation of one individual; errors of operators and measures become outcomes."""

import json
import math
import time
import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic_core import from_json

from evocity import fitness
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import EvocityError, FitnessError, OperatorError
from evocity.fitness.part import Part, own_name, part_name, within
from evocity.fitness.source_transfer import Shipment, unpacked
from evocity.genome import Genome
from evocity.kinds import Expressed
from evocity.pavement.levels import USUAL
from evocity.selection.thumbprints import look_of
from evocity.store import Header
from evocity.store.schema import plain

#: The longest error text in the log.
MOST_LETTERS = 2000
# The measure that counts locked pixels in older runs.
_SHARE = fitness.smallest_share.name
# The rest of a longer text is ignored.
_ENOUGH = 10 * MOST_LETTERS
#: The beginning of the text in which a successful birth names its measures without a value.
UNRECORDED = "not recorded: "


@dataclass(frozen=True)
class Setup:
    """All that a worker needs to breed and evaluate.

    measures : (name, file or None) in the recipe's order, those that are only recorded last.
    condensation : the layer that is locked in every genome, or None.
    shipped : measures of the user's session, which another process does not know by name.
    sides, parts : the kernels that it calls, as `evocity.evaluation.kernel_warmup` names them.
    references : the cities that measures compare with, by the measures' names.
    sources : the maps of the source cities, for measures that take them.
    within : the parts of the map to measure, by the measures' names.
    bounds : the measures that are only constraints.
    moved : folders of copied files of measures -> the original folders, which errors name.
    """

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
    """The outcome of breeding or evaluating one individual; ``status`` as in `evocity.store`.

    ``error`` becomes one line of at most `MOST_LETTERS`, whatever a measure raised. ``genome``: the
    child; None if breeding failed, or there was nothing to breed. ``look``: the look of the map
    after a successful evaluation, see `evocity.selection.thumbprints`. ``thumbnail``: its small
    map, if the log has them, see `evocity.store.Thumbnails`.
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
            line = _one_line(self.error)
            line = line if len(line) <= MOST_LETTERS else line[: MOST_LETTERS - 1] + "…"
            object.__setattr__(self, "error", line)


class Evaluator:
    """Breeds and evaluates. It never raises an error of an operator or a measure."""

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
            measure = loaded[file][own] if file or own in loaded[None] else fitness.get(own)
            self.measures[name] = (
                within(measure, part_name(name)) if name in self.within else measure
            )
        for name, reference in setup.references.items():
            self.measures[name] = self.measures[name].bound(reference)

    def born(
        self,
        operator,
        parents: Sequence[Genome],
        rng: np.random.Generator,
        measured: bool = True,
    ) -> Outcome:
        """Breed and `evaluate` one individual; ``.genome`` is the child. Without an operator, the
        individual is the only one of ``parents``."""
        if operator is None:
            return replace(self.evaluate(parents[0], small=True), genome=parents[0])
        bred = self.breed(operator, parents, rng)
        if bred.genome is None or not measured:
            return bred
        outcome = self.evaluate(bred.genome, parents, small=True)
        return replace(outcome, seconds=bred.seconds + outcome.seconds, genome=bred.genome)

    def breed(self, operator, parents: Sequence[Genome], rng: np.random.Generator) -> Outcome:
        """Breed the child; its genome is ``.genome`` of the outcome, in the run's terms."""
        start = time.perf_counter()
        try:
            if hasattr(operator, "bred_within"):  # it measures while it breeds
                operator = operator.bred_within(self)
            child = self.header.chromosome.breed(operator, parents, rng)
            genome = admit(child, self.header, self.condensation)
        except KeyboardInterrupt:  # from the user, when everything runs in one process
            raise
        except BaseException as error:
            return Outcome(_status(error), describe_failure(error), time.perf_counter() - start)
        return Outcome("ok", None, time.perf_counter() - start, genome=genome)

    def evaluate(
        self,
        genome: Genome,
        parents: Sequence[Genome] = (),
        names: Collection[str] | None = None,
        small: bool = False,
    ) -> Outcome:
        """Decode a genome and take every measure of ``names``, by default all.

        The first error of a goal or a constraint ends the evaluation, and keeps the values so far.
        Recorded measures without a value and undefined constraints only add a reason to ``error``.
        An individual without ``parents`` is its own parent. ``small``: with its thumbnail.
        """
        start = time.perf_counter()
        parents = parents or (genome,)
        values: dict[str, float] = {}
        undefined: list[str] = []
        missing: list[str] = []

        expressed = self.header.chromosome.express(genome)
        thumbnails = self.header.thumbnails if small and expressed.city is not None else None
        thumbnail = None if thumbnails is None else thumbnails.packed(expressed.city)

        def end(status: str, error: str | None = None) -> Outcome:
            return Outcome(status, error, time.perf_counter() - start, values, thumbnail=thumbnail)

        if expressed.city is None:
            return end("invalid", expressed.problem)
        fabric = self.header.chromosome.fabric
        fabrics = {"genome": fabric(genome), "parents": tuple(map(fabric, parents))}
        extras = fabrics | {"sources": self.sources}
        for name in (one for one in self.header.measures if names is None or one in names):
            try:
                value = self._measure(name, expressed, extras)
            except FitnessError as error:
                # a measure that raised has a cause; one that returned no number has none
                status = _status(error) if error.__cause__ else "invalid"
                return end(status, describe_failure(error))
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                return end(_status(error), f"{name}: {describe_failure(error)}")
            if name in self.bounds and math.isnan(value):
                missing.append(f"{_undefined(name, value)}, which breaks its bound")
                continue
            values[name] = float(value)
            if not math.isfinite(value):
                undefined.append(_undefined(name, value))
        recorded = [one for one in self.header.recorded if names is None or one in names]
        missing += self._record(recorded, expressed, extras, values)
        if undefined:
            return end("invalid", "; ".join(undefined))
        return replace(end("ok", unrecorded(missing)), look=look_of(expressed.city))

    def evaluate_within(self, genome: Genome, part: Part) -> Outcome:
        """Decode a genome and take every measure within a ``part`` of the map, or its own part."""
        start = time.perf_counter()
        values: dict[str, float] = {}
        expressed = self.header.chromosome.express(genome)
        if expressed.city is None:
            return Outcome("invalid", expressed.problem, time.perf_counter() - start)
        extras = {"genome": self.header.chromosome.fabric(genome)}
        names = [*self.header.measures, *self.header.recorded]
        error = unrecorded(self._record(names, expressed, extras, values, part))
        return Outcome("ok", error, time.perf_counter() - start, values)

    def _measure(
        self, name: str, expressed: Expressed, extras: Mapping, part: Part | None = None
    ) -> float:
        measure, part = self.measures[name], self.within.get(name, part)
        if part is None:
            if own_name(name) == _SHARE and self.header.locked and self.header.shares == "all":
                extras = {**extras, "genome": extras["genome"].replace(condensation=None)}
            return measure(expressed.of(measure.of), **extras)
        if measure.of != "city":
            raise FitnessError(
                f"{name} is a measure of a {measure.of}, so it cannot be limited to the part "
                f"{part.name}",
                "a measure of cities, because only city maps have parts",
                "use the measure for the whole map",
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
        """Add measures that are only recorded to ``values``; returns reasons of missing values."""
        missing = []
        for name in names:
            try:
                value = self._measure(name, expressed, extras, part)
            except KeyboardInterrupt:
                raise
            except BaseException as error:
                text = describe_failure(error)
                missing.append(text if text.startswith(name) else f"{name}: {text}")
                continue
            if math.isfinite(value):
                values[name] = float(value)
            else:
                missing.append(_undefined(name, value))
        return missing


def unrecorded(reasons: Sequence[str]) -> str | None:
    """Join the ``reasons`` why measures of a successful birth have no value; None without any."""
    return UNRECORDED + "; ".join(reasons) if reasons else None


def _undefined(name: str, value: float) -> str:
    return f"{name} is {float(value)}: {getattr(value, 'reason', 'no reason given')}"


def _status(error: BaseException) -> str:
    """Return the status for an ``error``: "memory" if memory ran out."""
    short = isinstance(error, MemoryError) or isinstance(error.__cause__, MemoryError)
    return "memory" if short else "error"


def describe_failure(error: BaseException) -> str:
    """Describe an ``error`` in one line with its place in the user's code; never raises."""
    try:
        if isinstance(error, EvocityError):
            return _one_line(f"{error.found} (expected: {error.expected})")[:MOST_LETTERS]
        frames = traceback.extract_tb(error.__traceback__)
        place = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        return _one_line(f"{type(error).__name__}: {error}{place}")[:MOST_LETTERS]
    except KeyboardInterrupt:
        raise
    except BaseException:  # the exception's own text may raise
        return f"{type(error).__name__}, whose text raises an error"


def _one_line(text: str) -> str:
    # a lone surrogate, as in the name of a strange file, cannot be encoded
    return " ".join(text[:_ENOUGH].split()).encode(errors="replace").decode()


def admit(child, header: Header, condensation: Condensation | None = None) -> Genome:
    """Return the genome ``child`` in the terms of the run's ``header``, with the locked layer.

    Raises `OperatorError` for a child that does not suit the run, or whose ``made`` JSON cannot
    hold.
    """
    kind = header.chromosome
    if faults := kind.faults(child, header):
        raise OperatorError("; ".join(faults), "; ".join(faults.values()), _REMEDY)
    return kind.adopt(child, header, condensation, _written(child.made))


_REMEDY = "correct the operator: a child has the map, the cities and the bounds of its parents"


def _written(made: dict) -> dict:
    """Return ``made`` as the log returns it to a resumed run."""
    try:
        return dict(from_json(json.dumps(made, default=plain)))
    except (TypeError, ValueError, RecursionError) as error:
        raise OperatorError(
            "the record of a birth, with the key 'made', cannot be written as JSON "
            f"({type(error).__name__}: {error})",
            "a dictionary with texts as keys, and with numbers, texts, lists or dictionaries as "
            "values",
            "change the operator: record only such values, for example str(key) instead of a tuple",
        ) from error
