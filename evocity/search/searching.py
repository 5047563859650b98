"""What a recipe may say of the search: models of these sections, checked by pydantic; see
`evocity.search.sections` for what is bred."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails

from evocity.errors import shown, with_near_miss
from evocity.search.algorithms import DEFAULT, Algorithm, algorithms
from evocity.search.values import ClusterAddress, Positive, Section, fault

#: Bytes of the units of memory: decimal, or binary with an i.
_UNITS = {
    f"{letter}{i}B".lower(): base**power
    for i, base in (("", 1000), ("i", 1024))
    for power, letter in enumerate("kMGT", 1)
}


def bytes_of(text: str) -> int | None:
    """Bytes of memory in words: "512 MB", "4 GB", "1.5 GiB"; None for "none". Raises ValueError
    for anything else."""
    if text == "none":
        return None
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?) ?([kmgt]i?b)", text.strip().lower(), re.ASCII)
    if found is None or not (size := int(float(found[1]) * _UNITS[found[2]])):
        raise ValueError(text)
    return size


def _some_memory(text: str) -> str:
    try:
        bytes_of(text)
    except ValueError:
        raise fault(shown(text), 'memory such as "512 MB", "4 GB" or "4 GiB", or "none"') from None
    return text


def some_algorithm(name: str) -> str:
    """The ``name``, if it is an algorithm's; else a fault."""
    known = algorithms()
    if name not in known:
        raise fault(with_near_miss(shown(name), name, known), " or ".join(map(shown, known)))
    return name


class EvaluationSection(Section):
    """``[evaluation]``. ``workers`` 0: in the calling process, without deadlines. ``cluster``: the
    address of a Dask scheduler, or "local:N"; ``workers`` is then what each of its workers hosts.

    ``timeout``: seconds, one individual. ``memory``: what one individual may take besides what its
    worker has before, such as "4 GB", or "none". ``max_failures``: the share of a generation's
    births that may fail before the run stops.
    """

    workers: int | None = Field(None, ge=0, le=4096)
    cluster: ClusterAddress | None = None
    timeout: Positive = 60.0
    memory: Annotated[str, AfterValidator(_some_memory)] = "4 GB"
    max_failures: float = Field(0.5, ge=0, le=1)

    @model_validator(mode="after")
    def _somebody_there(self) -> "EvaluationSection":
        if self.workers == 0 and self.cluster not in (None, "none"):
            raise fault("workers = 0 beside a cluster", "1 or more, or a key less")
        return self

    @property
    def memory_bytes(self) -> int | None:
        """``memory`` in bytes, None for "none"."""
        return bytes_of(self.memory)


class RefineSection(Section):
    """``[refine]``: in every so many generations, that many ``births`` are what an optimiser makes
    of one of the living in ``budget`` evaluations, see `evocity.search.refinement`; 0 births, the
    default, refine nobody. ``way``: what it tunes; ``side``: numbers along each side of its field;
    ``others``: so many others offer their fabric.
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
        """The operator whose numbers are tuned."""
        return "height_field" if self.way == "heights" else "lambda_field"


def sound_keys(
    algorithm: type[Algorithm], given: Mapping[str, Any]
) -> tuple[Section | None, list[ErrorDetails]]:
    """What ``[search]`` gives of the ``algorithm``'s own keys, and pydantic's errors of them. Keys
    at fault are left as if they were not given; None where it cannot do without."""
    try:
        return algorithm.Keys.model_validate(given), []
    except ValidationError as error:
        errors = error.errors(include_url=False)
    bad = {part for one in errors for part in one["loc"][:1]}
    try:
        return algorithm.Keys.model_validate(
            {k: v for k, v in given.items() if k not in bad}
        ), errors
    except ValidationError:
        return None, errors


class SearchSection(BaseModel):
    """``[search]``: an ``algorithm``, see `evocity.search.algorithms`, and the keys it has.
    ``picks``: the share of births that have a pick for their first parent, while there are picks.
    ``adapt``: weights of operators follow what their births earn, see `evocity.search.credit`.
    ``window``: births have their parents among those at least so many before them, see
    `evocity.search.steady`; None for one generation after the other.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    algorithm: Annotated[str, AfterValidator(some_algorithm)] = DEFAULT
    picks: float = Field(0.5, gt=0, le=1)
    adapt: bool = False
    window: int | None = Field(None, ge=1, le=100_000)

    @property
    def keys(self) -> Section:
        """The algorithm's own keys."""
        return algorithms()[self.algorithm].Keys(**(self.model_extra or {}))

    @property
    def asked(self) -> dict[str, Any]:
        """All keys with their values, those left out too."""
        common = {name: getattr(self, name) for name in SearchSection.model_fields}
        return common | self.keys.model_dump()

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the algorithm's own keys."""
        return tuple(algorithms()[self.algorithm].Keys.model_fields)

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the measures that the algorithm needs of every birth besides the goals, as far
        as its keys are sound."""
        return () if self._sound is None else algorithms()[self.algorithm].described(self._sound)

    def faults(self, goals: int, population: int, parents: int) -> list[tuple[str, str, str]]:
        """Faults (key, found, allowed) of the algorithm for so many goals, so many who live, and so
        many parents, as far as its keys are sound."""
        faults = []
        if self._sound is not None:
            faults += algorithms()[self.algorithm].faults(self._sound, goals, population, parents)
        if self.window is not None and self.breeds_by is not None:
            found = f"{self.window}, with the algorithm {self.algorithm!r}"
            faults.append(("search.window", found, "no window, as it breeds by itself"))
        return faults

    @property
    def _sound(self) -> Section | None:
        return sound_keys(algorithms()[self.algorithm], self.model_extra or {})[0]

    @property
    def breeds_by(self) -> str | None:
        """The operator that the algorithm breeds with by itself, None where the mixture does."""
        return algorithms()[self.algorithm].breeds_by

    def algorithm_of(self, size: int) -> Algorithm:
        """The algorithm, for so many who live at most."""
        return algorithms()[self.algorithm](size, self.keys)
