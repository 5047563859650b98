"""What a recipe says of measures: those it searches by, and those it records besides."""

from collections.abc import Collection, Mapping
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from evocity import fitness
from evocity.errors import EvocityError, FitnessError, shown, with_near_miss
from evocity.fitness import WEIGHTED, Constraint, Measure, Objective, load_file, named
from evocity.fitness.part import check_map_alone, within
from evocity.fitness.registry import family_of
from evocity.search.values import (
    PARENTS,
    Cities,
    CityName,
    FileName,
    Finite,
    LockFile,
    Section,
    Title,
    fault,
    resolved,
)


class MeasureEntry(Section):
    """A measure by name, or those of a file; all that is recorded of them is their values.

    ``reference``: what measures that compare cities compare with: the run's source cities
    ("parents", the default), or a tuple of cities. ``within``: a file that marks the part of the
    map they are taken of; they are then called after it, or by the ``label``: gsi@quarter.
    """

    name: str | None = None
    file: FileName | None = None
    reference: Cities = None
    within: LockFile | None = None
    label: Title | None = None

    _measures: list[Measure] = PrivateAttr(default_factory=list)
    _source: str | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _find(self, info: ValidationInfo) -> "MeasureEntry":
        try:
            measures = self._found(info.context["folder"], info.context.get("kept") or {})
        except EvocityError as error:
            raise fault(error.found, error.expected) from None
        if self.reference is not None and not any("reference" in m.takes for m in measures):
            names = ", ".join(measure.name for measure in measures)
            raise fault(f"reference for {names}, which compares with no city", "no reference here")
        if self.within is None and self.label is not None:
            raise fault(f"label = {shown(self.label)} without within", "a label of a part alone")
        if self.within is not None:
            try:
                for one in measures:
                    check_map_alone(one)
            except FitnessError as error:
                raise fault(error.found, error.expected) from None
            measures = [within(one, self.part) for one in measures]
        self._measures.extend(measures)
        return self

    @property
    def part(self) -> str | None:
        """What the part is called that its measures are taken of; None of the whole map."""
        return None if self.within is None else self.label or PurePath(self.within).stem

    @property
    def measures(self) -> list[Measure]:
        return self._measures

    def leave_out(self, names: Collection[str]) -> None:
        """Of a whole file, drop the measures of these ``names``, unless none were left."""
        others = [one for one in self._measures if one.name not in names]
        if self.file is not None and self.name is None and others:
            self._measures[:] = others

    @property
    def compared(self) -> str | tuple[str, ...] | None:
        """What its measures compare with: "parents", or cities; None if they do not."""
        compares = any("reference" in measure.takes for measure in self.measures)
        return (self.reference or PARENTS) if compares else None

    @property
    def source(self) -> str | None:
        """The file a worker must load the measures from; None for registered ones."""
        return self._source

    def _found(self, folder: Path, kept: Mapping[str, str]) -> list[Measure]:
        if self.file is None:
            if self.name is None:
                raise fault("neither name nor file", "one of them")
            try:
                return named(self.name)
            except FitnessError as error:
                known = [measure.name for measure in fitness.measures()]
                raise fault(with_near_miss(error.found, self.name, known), error.expected) from None
        path = resolved(folder, self.file)
        self._source = kept.get(path, path)
        measures = load_file(self._source)
        if self.name is None:
            return measures
        chosen = [one for one in measures if one.name == self.name]
        chosen = chosen or family_of(self.name, measures)
        if not chosen:
            names = [measure.name for measure in measures]
            found = with_near_miss(f"name = {self.name!r}", self.name, names)
            raise fault(found, f"one of {', '.join(names)}")
        return chosen


def recorded_of(value: Any) -> Any:
    """What `MeasureEntry` is made of, from one of ``record``: the name of a measure, a file of
    measures, or a table."""
    if isinstance(value, str):
        return {"file" if value.endswith(".py") else "name": value}
    if not isinstance(value, dict | MeasureEntry):
        allowed = "the name of a measure, a file NAME.py, or a table with a name, a file or both"
        raise fault(shown(value), allowed)
    return value


class FitnessEntry(MeasureEntry):
    """``[[fitness]]``: a measure by name, or those of a file, and what is wanted of them.

    With ``min`` or ``max`` it is a constraint, and nothing else unless a goal, a target, a city
    to be like or a weight is given too. Measures with a ``weight``, or one ``objective``, are
    summed. ``reference`` as in `MeasureEntry`.
    """

    goal: Literal["max", "min"] | None = None
    target: Finite | None = None
    like: CityName | None = None
    min: Finite | None = None
    max: Finite | None = None
    weight: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] | None = None
    objective: Title | None = None

    @model_validator(mode="after")
    def _want(self) -> "FitnessEntry":
        wanted = [key for key in ("goal", "target", "like") if getattr(self, key) is not None]
        if len(wanted) > 1:
            raise fault(" and ".join(wanted), "one of goal, target and like")
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise fault(f"min = {self.min:g}, max = {self.max:g}", "a min below the max")
        measures = self.measures
        for key in ("target", "like", "min", "max"):
            if len(measures) > 1 and getattr(self, key) is not None:
                names = ", ".join(measure.name for measure in measures)
                raise fault(f"{key} for all of {names}", "name = one of them")
        asking = [one for one in measures if self.like is not None and one.needs]
        if asking:
            needs = " and ".join(asking[0].needs)
            raise fault(
                f"like for {asking[0].name}, which asks for {needs}: a map has none", "a target"
            )
        for one in measures:
            self._check_bounds(one)
        try:
            if self.like is None and self.is_objective:
                for measure in measures:
                    Objective(measure, self.goal, self.target)
        except EvocityError as error:
            raise fault(error.found, error.expected) from None
        return self

    def _check_bounds(self, measure: Measure) -> None:
        low, high = measure.range
        beyond = self.min is not None and self.min > high
        if beyond or (self.max is not None and self.max < low):
            given = {"min": self.min, "max": self.max}
            bounds = ", ".join(f"{key} = {one:g}" for key, one in given.items() if one is not None)
            raise fault(f"{bounds} of {measure.name}", f"within its range, {low:g}…{high:g}")

    @property
    def is_objective(self) -> bool:
        """Whether it is more than a constraint."""
        bounded = self.min is not None or self.max is not None
        keys = ("goal", "target", "like", "weight", "objective")
        return not bounded or any(getattr(self, key) is not None for key in keys)

    @property
    def total(self) -> str | None:
        """The sum that its measures count in, if any."""
        return WEIGHTED if self.objective is None and self.weight is not None else self.objective

    def constraint(self, measure: Measure) -> Constraint | None:
        bounded = self.min is not None or self.max is not None
        return Constraint(measure, self.min, self.max) if bounded else None


__all__ = ["FitnessEntry", "MeasureEntry", "recorded_of"]
