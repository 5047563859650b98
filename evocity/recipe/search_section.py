"""Sections of a recipe on the search: ``[evaluation]``, ``[refine]`` and ``[search]``.

`evocity.recipe.sections` has the sections on what is bred.
"""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from evocity.recipe.values import ClusterAddress
from evocity.section import Fault, Positive, Section, fault, name_in, text_for
from evocity.selection.algorithms import DEFAULT, Algorithm, algorithms

#: Bytes of the units of memory: decimal, or binary with an i.
_UNITS = {
    f"{letter}{i}B".lower(): base**power
    for i, base in (("", 1000), ("i", 1024))
    for power, letter in enumerate("kMGT", 1)
}
#: The name of an algorithm.
AlgorithmName = Annotated[str, name_in(algorithms)]


def bytes_of(text: str) -> int | None:
    """Read bytes of memory: "512 MB", "4 GB", "1.5 GiB"; None for "none". Raises ValueError for
    anything else."""
    if text == "none":
        return None
    match = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?) ?([kmgt]i?b)", text.strip().lower(), re.ASCII)
    if match is None or not (size := int(float(match[1]) * _UNITS[match[2]])):
        raise ValueError(text)
    return size


class EvaluationSection(Section):
    """``[evaluation]``. ``workers``: the number of worker processes; 0 evaluates in the calling
    process, without deadlines. ``cluster``: the address of a Dask scheduler, or "local:N";
    ``workers`` is then the number of processes that each of its workers hosts.

    ``timeout``: seconds for one individual. ``memory``: how much more than its worker one
    individual may take, such as "4 GB", or "none". ``max_failures``: the run stops when a larger
    share of a generation's births fails.
    """

    workers: int | None = Field(None, ge=0, le=4096)
    cluster: ClusterAddress | None = None
    timeout: Positive = 60.0
    memory: Annotated[
        str, text_for(bytes_of, 'memory such as "512 MB", "4 GB" or "4 GiB", or "none"')
    ] = "4 GB"
    max_failures: float = Field(0.5, ge=0, le=1)

    @model_validator(mode="after")
    def _check_cluster(self) -> "EvaluationSection":
        if self.workers == 0 and self.cluster not in (None, "none"):
            raise fault(
                "workers = 0 is given together with a cluster",
                "workers = 1 or more, or only one of the two keys 'workers' and 'cluster'",
            )
        return self

    @property
    def memory_bytes(self) -> int | None:
        """``memory`` in bytes, None for "none"."""
        return bytes_of(self.memory)


class RefineSection(Section):
    """``[refine]``: every so many generations an optimiser improves the living. Each of the
    ``births`` improves one of them in ``budget`` evaluations, see
    `evocity.search.breeding.refinement`; 0, the default, refines nobody. ``way``: the parameters
    that it tunes; ``side``: the numbers along each side of their field; ``others``: how many other
    individuals offer their fabric.
    """

    births: int = Field(0, ge=0, le=1_000_000)
    every: int = Field(5, ge=1, le=99_999_999)
    budget: int = Field(40, ge=1, le=100_000)
    way: Literal["lambda_field", "heights"] = "lambda_field"
    algorithm: Literal["sbplx", "cobyla", "bobyqa"] = "sbplx"
    side: int = Field(4, ge=1, le=16)
    others: int = Field(2, ge=1, le=8)

    @property
    def operator(self) -> str:
        """The operator whose parameters are tuned."""
        return "height_field" if self.way == "heights" else "lambda_field"


def read_algorithm_keys(
    algorithm: type[Algorithm], given: Mapping[str, Any]
) -> tuple[Section | None, list[ErrorDetails]]:
    """Read the ``algorithm``'s own keys of ``[search]``, and pydantic's errors in them. Keys at
    fault count as not given; None if the algorithm needs one of them."""
    try:
        return algorithm.Keys.model_validate(given), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    bad = {part for details in errors for part in details["loc"][:1]}
    valid = {key: value for key, value in given.items() if key not in bad}
    try:
        return algorithm.Keys.model_validate(valid), errors
    except ValidationError:
        return None, errors


class SearchSection(BaseModel):
    """``[search]``: an ``algorithm`` of `evocity.selection.algorithms`, and its own keys.

    ``picks``: the share of births whose first parent is a pick, while there are picks. ``mates``:
    the share of crossings of plans whose parents have one plan, while some of the living have.
    ``redraws``: how often a birth is drawn again whose child equals a parent, see
    `evocity.search.breeding.redraws`; 0 keeps such a child. ``adapt``: weights of operators follow
    the success of their births, by the kind of ``credit``, see `evocity.search.breeding.credit`.
    ``births``: births of a generation; None for as many as live. ``steer``: the share of births
    whose operator follows from what their first parent misses of the targets, see
    `evocity.search.breeding.levers`. ``window``: parents of a birth are at least so many births
    older, see `evocity.search.schedules`; None breeds one whole generation after the other.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    algorithm: AlgorithmName = DEFAULT
    picks: float = Field(0.5, gt=0, le=1)
    adapt: bool = False
    credit: Literal["hypervolume", "archive"] = "hypervolume"
    births: int | None = Field(None, ge=1, le=1_000_000)
    steer: float = Field(0.0, ge=0, le=1)
    mates: float = Field(0.0, ge=0, le=1)
    redraws: int = Field(0, ge=0, le=16)
    window: int | None = Field(None, ge=1, le=100_000)

    @property
    def keys(self) -> Section:
        """The algorithm's own keys."""
        return self._kind.Keys(**(self.model_extra or {}))

    @property
    def settings(self) -> dict[str, Any]:
        """All keys with their values, defaults included."""
        common = {name: getattr(self, name) for name in SearchSection.model_fields}
        return common | self.keys.model_dump()

    @property
    def has_niches(self) -> bool:
        """Whether births need the names of their plans."""
        settings = self.settings
        return any(settings.get(key) for key in ("mates", "per_plan", "source_plans"))

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the algorithm's own keys."""
        return tuple(self._kind.Keys.model_fields)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the measures that the algorithm needs of every birth besides the goals; none if
        its keys are at fault."""
        return () if self._valid_keys is None else self._kind.described(self._valid_keys)

    def faults(self, goals: int, population: int, parents: int) -> list[Fault]:
        """List the faults of the algorithm for so many ``goals``, a ``population`` of so many and
        so many ``parents``, if its keys are valid."""
        faults = []
        if self._valid_keys is not None:
            faults += self._kind.faults(self._valid_keys, goals, population, parents)
        if self.window is not None and self.breeds_by is not None:
            found = f"{self.window}, with the algorithm {self.algorithm!r}"
            allowed = "no window: this algorithm breeds whole generations by itself"
            faults.append(("search.window", found, allowed))
        return faults

    @property
    def _kind(self) -> type[Algorithm]:
        return algorithms()[self.algorithm]

    @property
    def _valid_keys(self) -> Section | None:
        return read_algorithm_keys(self._kind, self.model_extra or {})[0]

    @property
    def breeds_by(self) -> str | None:
        """The operator that the algorithm breeds with by itself, None where the mixture does."""
        return self._kind.breeds_by

    def algorithm_of(self, size: int) -> Algorithm:
        """Make the algorithm for at most so many who live."""
        return self._kind(size, self.keys)
