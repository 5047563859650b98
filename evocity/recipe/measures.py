"""Entries of a recipe for measures: goals and constraints in ``[[fitness]]``, and ``record``."""

from collections.abc import Collection, Mapping
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from evocity import fitness
from evocity.errors import EvocityError, FitnessError, add_near_miss, spell
from evocity.fitness import WEIGHTED, Constraint, Measure, Objective, load_file, named
from evocity.fitness.part import check_map_alone, within
from evocity.fitness.registry import family_of
from evocity.recipe.values import (
    PARENTS,
    Cities,
    CityName,
    ExistingFile,
    FileName,
    Title,
    resolve_path,
)
from evocity.section import Finite, Section, fault


class MeasureEntry(Section):
    """A measure by name, or the measures of a file, whose values a run records.

    ``reference``: the cities that measures compare with: the run's source cities ("parents", the
    default), or a tuple of cities. ``within``: a file that marks the part of the map to measure;
    the ``label``, by default the file's name, then ends the measure's name: gsi@quarter.
    """

    name: str | None = None
    file: FileName | None = None
    reference: Cities = None
    within: ExistingFile | None = None
    label: Title | None = None

    _measures: list[Measure] = PrivateAttr(default_factory=list)
    _source: str | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _load_measures(self, info: ValidationInfo) -> "MeasureEntry":
        try:
            measures = self._find(info.context["folder"], info.context.get("kept") or {})
            if self.reference is not None and not any("reference" in m.takes for m in measures):
                names = ", ".join(measure.name for measure in measures)
                found = f"reference for {names}, which compares with no city"
                raise fault(found, "no reference here")
            if self.within is None and self.label is not None:
                found = f"label = {spell(self.label)} without within"
                raise fault(found, "a label only with within")
            if self.within is not None:
                for measure in measures:
                    check_map_alone(measure)
                measures = [within(measure, self.part) for measure in measures]
        except EvocityError as error:
            raise fault(error.found, error.expected) from None
        self._measures.extend(measures)
        return self

    @property
    def part(self) -> str | None:
        """The name of the part of the map to measure; None for the whole map."""
        return None if self.within is None else self.label or PurePath(self.within).stem

    @property
    def measures(self) -> list[Measure]:
        return self._measures

    def leave_out(self, names: Collection[str]) -> None:
        """Drop the measures of these ``names`` from those of a whole file, if others remain."""
        others = [measure for measure in self._measures if measure.name not in names]
        if self.file is not None and self.name is None and others:
            self._measures[:] = others

    @property
    def compared(self) -> str | tuple[str, ...] | None:
        """The cities that its measures compare with: "parents", or a tuple; None if they do not."""
        compares = any("reference" in measure.takes for measure in self.measures)
        return (self.reference or PARENTS) if compares else None

    @property
    def source(self) -> str | None:
        """The file that a worker must load the measures from; None for registered ones."""
        return self._source

    def _find(self, folder: Path, kept: Mapping[str, str]) -> list[Measure]:
        if self.file is None:
            if self.name is None:
                raise fault(
                    "this entry has neither a name nor a file",
                    "the name of a measure, a file of measures, or both",
                )
            try:
                return named(self.name)
            except FitnessError as error:
                known = [measure.name for measure in fitness.measures()]
                raise fault(add_near_miss(error.found, self.name, known), error.expected) from None
        path = resolve_path(folder, self.file)
        self._source = kept.get(path, path)
        measures = load_file(self._source)
        if self.name is None:
            return measures
        chosen = [measure for measure in measures if measure.name == self.name]
        chosen = chosen or family_of(self.name, measures)
        if not chosen:
            names = [measure.name for measure in measures]
            found = add_near_miss(f"name = {self.name!r}", self.name, names)
            raise fault(found, f"one of {', '.join(names)}")
        return chosen


def record_entry(value: Any) -> Any:
    """Write an item of ``record`` as the table of a `MeasureEntry`: it may be the name of a
    measure, a file of measures, or a table already."""
    if isinstance(value, str):
        return {"file" if value.endswith(".py") else "name": value}
    if not isinstance(value, dict | MeasureEntry):
        allowed = "the name of a measure, a file NAME.py, or a table with a name, a file or both"
        raise fault(spell(value), allowed)
    return value


class FitnessEntry(MeasureEntry):
    """``[[fitness]]``: a measure by name, or the measures of a file, as goals or constraints.

    With ``min`` or ``max`` it is a constraint; it is a goal too if a goal, a target, a city to be
    like or a weight is given. Measures with a ``weight``, or with one ``objective``, are summed.
    """

    goal: Literal["max", "min"] | None = None
    target: Finite | None = None
    like: CityName | None = None
    min: Finite | None = None
    max: Finite | None = None
    weight: Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)] | None = None
    objective: Title | None = None

    @model_validator(mode="after")
    def _check_aims(self) -> "FitnessEntry":
        aims = [key for key in ("goal", "target", "like") if getattr(self, key) is not None]
        if len(aims) > 1:
            raise fault(" and ".join(aims), "one of goal, target and like")
        bounds = {key: getattr(self, key) for key in ("min", "max")}
        bounds = {key: value for key, value in bounds.items() if value is not None}
        written = ", ".join(f"{key} = {value:g}" for key, value in bounds.items())
        if len(bounds) == 2 and self.min >= self.max:
            raise fault(written, "a min below the max")
        for key in ("target", "like", "min", "max"):
            if len(self.measures) > 1 and getattr(self, key) is not None:
                names = ", ".join(measure.name for measure in self.measures)
                raise fault(
                    f"the key '{key}' needs one measure, but this entry has several: {names}",
                    "the key 'name' with the name of one of these measures",
                )
        for measure in self.measures:
            if self.like is not None and measure.needs:
                needs = " and ".join(measure.needs)
                found = f"like for {measure.name}, which needs {needs}: a map has none"
                raise fault(found, "a target")
            low, high = measure.range
            if bounds.get("min", high) > high or bounds.get("max", low) < low:
                raise fault(
                    f"{written} lies outside the range of {measure.name}",
                    f"a bound from {low:g} to {high:g}",
                )
        try:
            if self.like is None and self.is_objective:
                for measure in self.measures:
                    Objective(measure, self.goal, self.target)
        except EvocityError as error:
            raise fault(error.found, error.expected) from None
        return self

    @property
    def is_objective(self) -> bool:
        """Whether it is more than a constraint."""
        keys = ("goal", "target", "like", "weight", "objective")
        return not self._is_bounded or any(getattr(self, key) is not None for key in keys)

    @property
    def _is_bounded(self) -> bool:
        return self.min is not None or self.max is not None

    @property
    def total(self) -> str | None:
        """The sum that its measures are terms of, if any."""
        return WEIGHTED if self.objective is None and self.weight is not None else self.objective

    def constraint(self, measure: Measure) -> Constraint | None:
        return Constraint(measure, self.min, self.max) if self._is_bounded else None
