"""Measures: named functions from a city map to one number, and the errors they raise."""

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
from evocity.errors import EvocityError, FitnessError, describe_error, near_miss
from evocity.fitness.reference import Reference, check_sources
from evocity.genome import Genome

#: Names of the further arguments that a measure may take besides the city.
EXTRAS = ("reference", "genome", "parents", "sources")
_NO_REFERENCE = (
    "give the city to compare with: reference=CITY; in a recipe reference = [CITY]; "
    "evocity score --reference CITY"
)


class Undefined(float):
    """The value NaN with a reason: the result of a measure for a map on which the measure's formula
    has no meaning.

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
    """A named function from a city map to one number, with goal, unit and range.

    Call a measure with a `CityMap`, or with an object of the type that the attribute ``of`` names.
    The call returns a float; for a map without a meaningful value, the call returns NaN, often as
    an `Undefined`. If the function raises an error, or returns neither a finite real number nor
    NaN, the call raises `FitnessError` with file and line.

    Attributes
    ----------
    name : name of the function, which recipes, logs and tables use. If the function returns several
        numbers, the name of each measure is function.number.
    function : the Python function, ``function(city) -> float``. Besides the city, the function may
        take the arguments ``reference``, ``genome``, ``parents`` and ``sources``.
    goal : default goal of a search, "max" or "min"; None if the recipe must give a goal, a target
        value, or a city to resemble.
    unit : the unit of the number; "" for a pure number.
    range : lowest and highest possible value; ``inf`` means no bound.
    doc : documentation of the function.
    file : path of the file that declares the measure.
    line : number of the line in ``file`` where the function begins.
    needs : names of the arguments that the function requires, all from the list `EXTRAS`.
    takes : names of the arguments from the list `EXTRAS` that the function accepts; an argument
        that is not in ``needs`` has a default value.
    number : key of this measure's number in the mapping that the function returns; None if the
        function returns one number.
    origin : where the measure comes from: "evocity", a plugin's package and version, a file, or
        "this session".
    beside : paths of files in the folder of the measure's file: the Python files that this file
        imports, and its ``data`` files. The content of the files in ``beside`` is part of the
        measure's source.
    reference : default cities for the comparison with a map, or None; the method `bound` sets this
        reference.
    any_site : whether the measure is correct for a part of a map, even if this part is not a
        rectangle.
    data : names of the files that the function reads, relative to the folder of its Python file.
    of : type of the argument: "city" for a map, or one of the types of `evocity.kinds`: "shape",
        "curve", "site".
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
        """Measure ``city``, and return the number.

        reference : the cities to compare with: a map, a list of maps, or a list of (map, weight).
        genome : the code that decodes to ``city``. parents : the genomes it was bred from; a
        founder has itself. sources : the maps of its source cities, under the names in the genome.
        Only measures that take these arguments need them. ``given`` holds arguments without
        names, in the order of those that the measure takes.
        """
        of_map = self.of == "city"
        if not (isinstance(city, CityMap) if of_map else getattr(city, "kind", None) == self.of):
            raise FitnessError(
                f"{self.name} cannot measure a {type(city).__name__}",
                "a CityMap" if of_map else f"a {self.of}",
                "read one with evocity.read_map, or wrap heights: evocity.CityMap(heights, 2.0)"
                if of_map
                else f"measure an individual of a run that breeds {self.of}s",
            )
        extras = {"reference": reference, "genome": genome, "parents": parents, "sources": sources}
        order = [*self.takes, *(name for name in EXTRAS if name not in self.takes)]
        if len(given) > len(order):
            raise FitnessError(
                f"{self.name} received {len(given)} arguments besides the city",
                f"only these arguments after the city: {', '.join(order)}",
                "remove all other arguments",
            )
        extras |= dict(zip(order, given, strict=False))
        if "reference" in self.takes:
            cities = extras["reference"]
            extras["reference"] = self.reference if cities is None else Reference.of(cities)
        if "sources" in self.takes and extras["sources"] is not None:
            extras["sources"] = check_sources(extras["sources"])
        lacking = [need for need in self.needs if extras[need] is None]
        if lacking:
            raise FitnessError(
                f"{self.name} of {city.name} without its {' and '.join(lacking)}",
                f"{self.name}(city, {', '.join(f'{need}={need}' for need in self.needs)})",
                _NO_REFERENCE
                if lacking[0] == "reference"
                else "measure an individual of a run: evocity score RUN --id N",
            )
        try:
            known = {name: extras[name] for name in self.takes if extras[name] is not None}
            value = self.function(city, **known)
        except EvocityError:
            raise
        except (Exception, SystemExit) as error:
            line = line_in(self.file, error) or self.line
            raise FitnessError(
                f"{self.name} ({self.file}, line {line}) raised {describe_error(error)} "
                f"on {city.name}",
                "a number, or Undefined, for every map, the empty one too",
                _remedy(error, self.file),
            ) from error
        if self.number is not None:
            value = self._pick_number(value)
        if isinstance(value, Undefined):
            return value
        if isinstance(value, Real) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):
                number = float(value)
                if not math.isinf(number):
                    return number
        raise self._result_error(value, city.name)

    def bound(self, reference: Reference | CityMap | Sequence) -> "Measure":
        """Return this measure with a default ``reference``; a measure that takes no ``reference``
        is returned unchanged."""
        if "reference" not in self.takes:
            return self
        needs = tuple(need for need in self.needs if need != "reference")
        return replace(self, reference=Reference.of(reference), needs=needs)

    def _pick_number(self, values):
        if isinstance(values, Mapping) and self.number in values:
            return values[self.number]
        keys = f"a mapping of {', '.join(map(str, values))}" if isinstance(values, Mapping) else ""
        name = self.name.partition(".")[0]
        raise FitnessError(
            f"{name} ({self.file}, line {self.line}) returned {keys or shown(values)}",
            f"a mapping with a value for each name in the parameter 'numbers' of {name}, including "
            f"{self.number}",
            f'add "{self.number}": … to the mapping that {name} returns',
        )

    def _result_error(self, value, city: str) -> FitnessError:
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
        """First paragraph of the measure's documentation, as one line."""
        return " ".join(self.doc.partition("\n\n")[0].split())

    @property
    def range_text(self) -> str:
        """Range of the measure as text, for example ``0…∞``."""
        low, high = (
            f"{bound:g}" if math.isfinite(bound) else "∞" if bound > 0 else "-∞"
            for bound in self.range
        )
        return f"{low}…{high}"

    @cached_property
    def source_hash(self) -> str:
        """Hexadecimal hash of the source of the measure: its whole file and the files it imports
        from its folder, as loaded; only the function if there is no file."""
        with contextlib.suppress(OSError):
            return content_hash(Path(self.file).read_bytes())
        with contextlib.suppress(OSError, TypeError):
            return content_hash(inspect.getsource(self.function).encode())
        return content_hash(self.function.__code__.co_code)


class Several:
    """A function of several numbers, called once for each map.

    It keeps the last result of a map as long as the map lives, with its reference, genome, parents
    and sources.
    """

    def __init__(self, function: Callable[..., Mapping[str, float]], numbers: Sequence[str]):
        functools.update_wrapper(self, function)
        self._function, self._numbers = function, numbers
        self._known: weakref.WeakKeyDictionary[CityMap, tuple] = weakref.WeakKeyDictionary()

    def __call__(self, city: CityMap, **extras) -> Mapping[str, float]:
        parents, sources = (extras.get(name) or () for name in ("parents", "sources"))
        reference = extras.get("reference")
        # weak references: the city may be part of the reference, or one of the sources
        compared = None if reference is None else weakref.ref(reference)
        arguments = [compared, extras.get("genome"), *parents, *map(weakref.ref, sources)]
        given, values = self._known.get(city, (None, None))
        same = given is not None and len(given) == len(arguments)
        if not same or any(a is not b for a, b in zip(given, arguments, strict=True)):
            values = self._function(city, **extras)
            if not isinstance(values, Mapping):
                return values
            # only the numbers: other values may hold the map, which then would never be freed
            values = {name: values[name] for name in self._numbers if name in values}
            self._known[city] = arguments, values
        return values

    @property
    def __code__(self):
        return self._function.__code__


@dataclass(frozen=True)
class Family:
    """The measures of one function that returns several numbers; the call ``family(city)`` returns
    all these numbers by name.

    Each `Measure` in the attribute ``measures`` has a name of the form ``function.number``. If a
    number has the same name as the function, the measure of this number is called `function`
    instead of `function.number`.
    """

    name: str
    measures: tuple[Measure, ...]

    def __call__(self, city: CityMap, **extras: Any) -> dict[str, float]:
        return {measure.number: measure(city, **extras) for measure in self.measures}


def keep_result(function: Callable) -> Callable:
    """Keep the result of a ``function`` of one object as long as the object lives."""
    results: weakref.WeakKeyDictionary = weakref.WeakKeyDictionary()

    @functools.wraps(function)
    def look_up(thing):
        if thing not in results:
            results[thing] = function(thing)
        return results[thing]

    return look_up


def line_in(file: str, error: BaseException) -> int | None:
    """Find the innermost line of ``file`` that ``error`` passed through."""
    line, step = None, error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == file:
            line = step.tb_lineno
        step = step.tb_next
    return line


def shown(value) -> str:
    """Spell the result of a measure for a message."""
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
        "read-only" in str(error) or "cannot be set" in str(error)
    ):
        return (
            "all measures share a map and its views, so these are read-only: change a copy, "
            "heights = city.heights.copy()"
        )
    if isinstance(error, FileNotFoundError):
        return (
            "give the path from the measure's own folder, not from the working directory: "
            'pathlib.Path(__file__).parent / "name"; and name the file in '
            '@evocity.fitness(data="name"), so that it goes where the measure goes'
        )
    if isinstance(error, ModuleNotFoundError):
        if error.name and Path(file).with_name(f"{error.name}.py").is_file():
            return (
                f"import {error.name} at the top of the file: its folder is searched only while it "
                "loads"
            )
        return f"install {error.name} in the environment of evocity, or do without it"
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
