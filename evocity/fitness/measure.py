"""What a measure is: a named function from a city map to one number; how its faults are told."""

import contextlib
import functools
import hashlib
import inspect
import math
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import EvocityError, FitnessError, near_miss, told
from evocity.fitness.reference import Reference, maps_of
from evocity.genome import Genome

#: What a measure may ask for, besides the city, by naming an argument so.
EXTRAS = ("reference", "genome", "parents", "sources")
_LACKING = {
    "reference": "give the city to compare with: reference=CITY; in a recipe reference = [CITY]; "
    "evocity score --reference CITY",
}


class Undefined(float):
    """NaN that says why: what a measure returns where its formula has no meaning.

    >>> value = Undefined("no building to measure")
    >>> value, value.reason
    (nan, 'no building to measure')
    """

    reason: str

    def __new__(cls, reason: str):
        nan = super().__new__(cls, "nan")
        nan.reason = reason
        return nan


@dataclass(frozen=True, eq=False)
class Measure:
    """A named function from a city map to one number, with what is needed to search by it.

    Call it on a `CityMap`, or on what else it is ``of``: it returns a float, NaN (often an
    `Undefined`) where the measure has no meaning. It raises `FitnessError`, with file and line, if
    the function raises or returns anything but one finite real number or NaN.

    Attributes
    ----------
    name : the function's name: how recipes, logs and tables call the measure. One of several
        numbers of a function is called function.number.
    function : the plain function, ``function(city) -> float``; it may take the arguments
        ``reference``, ``genome``, ``parents`` and ``sources`` too.
    goal : "max" or "min", its own default; None if it takes a target, or a city to be like.
    unit : the unit of the number; "" for a pure number.
    range : lowest and highest value; ``inf`` where there is no bound.
    doc : the function's documentation.
    file : the file that declares it.
    line : the line in that file.
    needs : which of `EXTRAS` the function cannot do without.
    takes : which of them it takes; those not in ``needs`` have a default value.
    number : which of the function's several numbers this is; None if it returns but one.
    origin : where it comes from: "evocity", a plugin's package and version, a file, or
        "this session".
    beside : files that its file imports, or names as ``data``, from its own folder; part of its
        source.
    reference : what it compares with unless told otherwise, see `bound`; None for nothing.
    any_site : whether it is right of parts of maps that are no rectangles.
    data : files that it reads, as seen from the folder of its file.
    of : what it is a function of: "city", a map; or a form of `evocity.forms`: "shape", "curve",
        "site".
    """

    name: str
    function: Callable[..., float] = field(repr=False)
    goal: str | None
    unit: str
    range: tuple[float, float]
    doc: str = field(repr=False)
    file: str
    line: int
    needs: tuple[str, ...] = ()
    number: str | None = None
    origin: str = "this session"
    beside: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    reference: Reference | None = None
    any_site: bool = False
    data: tuple[str, ...] = ()
    of: str = "city"

    def __post_init__(self):
        object.__setattr__(self, "__doc__", self.doc)

    def __call__(
        self,
        city: CityMap,
        *given: Any,
        reference: Reference | CityMap | Sequence | None = None,
        genome: Genome | None = None,
        parents: Sequence[Genome] | None = None,
        sources: Sequence[CityMap] | None = None,
    ) -> float:
        """The number, of ``city``.

        reference : what to compare with: a map, a list of maps, or of (map, weight). genome : the
        code that was decoded to ``city``; parents : the genomes it was bred from, the genome
        itself for one that was not bred; sources : the maps of the cities it is made of, under
        the names it has for them. Only measures that take them need them; in this order those it
        takes may be ``given`` without their names.
        """
        if self.of != "city":
            if getattr(city, "kind", None) != self.of:
                raise FitnessError(
                    f"{self.name} of a {type(city).__name__}",
                    f"a {self.of}",
                    f"measure an individual of a run that breeds {self.of}s",
                )
        elif not isinstance(city, CityMap):
            raise FitnessError(
                f"{self.name} of a {type(city).__name__}",
                "a CityMap",
                "read one with evocity.read_map, or wrap heights: evocity.CityMap(heights, 2.0)",
            )
        extras = {"reference": reference, "genome": genome, "parents": parents, "sources": sources}
        order = [*self.takes, *(one for one in EXTRAS if one not in self.takes)]
        if len(given) > len(order):
            raise FitnessError(
                f"{self.name} with {len(given)} arguments besides the city",
                f"at most {len(order)}: {', '.join(order)}",
                "leave the others out",
            )
        extras |= dict(zip(order, given, strict=False))
        if "reference" in self.takes:
            told_now = extras["reference"]
            extras["reference"] = self.reference if told_now is None else Reference.of(told_now)
        if "sources" in self.takes and extras["sources"] is not None:
            extras["sources"] = maps_of(extras["sources"])
        lacking = [need for need in self.needs if extras[need] is None]
        if lacking:
            raise FitnessError(
                f"{self.name} of {city.name} without its {' and '.join(lacking)}",
                f"{self.name}(city, {', '.join(f'{need}={need}' for need in self.needs)})",
                _LACKING.get(
                    lacking[0], "measure an individual of a run: evocity score RUN --id N"
                ),
            )
        try:
            known = {one: extras[one] for one in self.takes if extras[one] is not None}
            value = self.function(city, **known)
        except EvocityError:
            raise
        except (Exception, SystemExit) as error:
            line = line_in(self.file, error) or self.line
            raise FitnessError(
                f"{self.name} ({self.file}, line {line}) raised {told(error)} on {city.name}",
                "a measure that copes with every map, the empty one too",
                _remedy(error, self.file),
            ) from error
        if self.number is not None:
            value = self._picked(value)
        if isinstance(value, Undefined):
            return value
        if isinstance(value, Real) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):
                number = float(value)
                if not math.isinf(number):
                    return number
        raise self._no_number(value, city.name)

    def bound(self, reference: Reference | CityMap | Sequence) -> "Measure":
        """The same measure, which compares with ``reference`` unless told otherwise; itself, if it
        compares with nothing."""
        if "reference" not in self.takes:
            return self
        needs = tuple(need for need in self.needs if need != "reference")
        return replace(self, reference=Reference.of(reference), needs=needs)

    def _picked(self, values):
        if isinstance(values, Mapping) and self.number in values:
            return values[self.number]
        found = f"a mapping of {', '.join(map(str, values))}" if isinstance(values, Mapping) else ""
        name = self.name.partition(".")[0]
        raise FitnessError(
            f"{name} ({self.file}, line {self.line}) returned {found or shown(values)}",
            f"a mapping of all that numbers=(…) above {name} names, {self.number} too",
            f'add "{self.number}": … to the mapping that {name} returns',
        )

    def _no_number(self, value, city: str) -> FitnessError:
        name = self.name.partition(".")[0]
        many = isinstance(value, np.ndarray) and value.size > 1
        remedy = f"end {name} with: return float(" + ("np.mean(...))" if many else "...)")
        if isinstance(value, Real) and not isinstance(value, bool):
            remedy = "return evocity.fitness.Undefined(reason) where the measure has no meaning"
        return FitnessError(
            f"{self.name} ({self.file}, line {self.line}) returned {shown(value)} for {city}",
            "one finite real number, or NaN where the measure has no meaning",
            remedy,
        )

    @property
    def summary(self) -> str:
        """The first paragraph of its documentation, as one line."""
        return " ".join(self.doc.partition("\n\n")[0].split())

    @property
    def told_range(self) -> str:
        """Its range in words, as in ``0…∞``."""
        low, high = (
            f"{bound:g}" if math.isfinite(bound) else "∞" if bound > 0 else "-∞"
            for bound in self.range
        )
        return f"{low}…{high}"

    @cached_property
    def source_hash(self) -> str:
        """Hexadecimal hash of the source that declares the measure, helpers included: of its whole
        file and those it imports from its folder, as they were when loaded; of the function alone
        if there is no file."""
        with contextlib.suppress(OSError):
            return content_hash(Path(self.file).read_bytes())
        with contextlib.suppress(OSError, TypeError):
            return content_hash(inspect.getsource(self.function).encode())
        return content_hash(self.function.__code__.co_code)


class Several:
    """A function of several numbers, called once a map for all of them.

    What it returned is kept as long as the map lives, for one reference, one genome, one list of
    parents and one of sources.
    """

    def __init__(self, function: Callable[..., Mapping[str, float]], numbers: Sequence[str]):
        functools.update_wrapper(self, function)
        self._function, self._numbers = function, numbers
        self._known: weakref.WeakKeyDictionary[CityMap, tuple] = weakref.WeakKeyDictionary()

    def __call__(self, city: CityMap, **extras) -> Mapping[str, float]:
        parents, sources = (extras.get(one) or () for one in ("parents", "sources"))
        reference = extras.get("reference")
        # held weakly, for the city may be of it, or one of the sources
        compared = None if reference is None else weakref.ref(reference)
        asked = [compared, extras.get("genome"), *parents, *map(weakref.ref, sources)]
        given, values = self._known.get(city, (None, None))
        same = given is not None and len(given) == len(asked)
        if not same or any(a is not b for a, b in zip(given, asked, strict=True)):
            values = self._function(city, **extras)
            if not isinstance(values, Mapping):
                return values
            # the numbers alone: what else it holds may hold the map, which then never went
            values = {name: values[name] for name in self._numbers if name in values}
            self._known[city] = asked, values
        return values

    @property
    def __code__(self):
        return self._function.__code__


@dataclass(frozen=True)
class Family:
    """Several measures that one function returns: ``family(city)`` gives them by their numbers'
    names; each of ``measures`` is a `Measure` of its own, called function.number, but for one
    whose number has the function's own name, which is called by that alone."""

    name: str
    measures: tuple[Measure, ...]

    def __call__(self, city: CityMap, **extras: Any) -> dict[str, float]:
        return {one.number: one(city, **extras) for one in self.measures}


def line_in(file: str, error: BaseException) -> int | None:
    """The innermost line of ``file`` that ``error`` passed through."""
    line, step = None, error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == file:
            line = step.tb_lineno
        step = step.tb_next
    return line


def shown(value) -> str:
    """What a measure returned, for a message."""
    if value is None:
        return "None"
    shape = getattr(value, "shape", None)
    if shape is not None and not isinstance(value, Real):
        return f"{type(value).__name__} of shape {shape}"
    if isinstance(value, float):  # numpy's too, which are long to read
        return f"float {float(value)!r}"
    text = repr(value)
    return f"{type(value).__name__} {text if len(text) < 60 else text[:57] + '…'}"


def content_hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _remedy(error: BaseException, file: str) -> str:
    if isinstance(error, AttributeError | ValueError) and (
        "read-only" in str(error) or "does not change" in str(error)
    ):
        return (
            "a map and its views are shared by all measures and read-only: change a copy, "
            "heights = city.heights.copy()"
        )
    if isinstance(error, FileNotFoundError):
        return (
            "give the path from the measure's own folder: "
            'pathlib.Path(__file__).parent / "name", not from where the program was started; and '
            'name it in @evocity.fitness(data="name"), so that it goes where the measure goes'
        )
    if isinstance(error, ModuleNotFoundError):
        if error.name and Path(file).with_name(f"{error.name}.py").is_file():
            return (
                f"import {error.name} at the top of the file: what lies beside it is found while "
                "it loads"
            )
        return f"install {error.name} beside evocity, or do without it"
    if isinstance(error, AttributeError) and error.name:
        offered = [name for name in dir(error.obj) if not name.startswith("_")]
        if hint := near_miss(error.name, offered):
            return hint
        if type(error.obj).__module__.startswith("evocity."):
            kind = "city" if isinstance(error.obj, CityMap) else type(error.obj).__name__
            return f"a {kind} has {', '.join(offered)}"
    return (
        "correct that line, or return evocity.fitness.Undefined(reason) where the measure has no "
        "meaning"
    )
