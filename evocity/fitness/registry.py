"""What a measure is, which ones there are, and how a name or a file becomes one."""

import contextlib
import hashlib
import inspect
import linecache
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.metadata import EntryPoint
from numbers import Real
from pathlib import Path
from types import ModuleType

from evocity.citymap import CityMap
from evocity.errors import EvocityError, FitnessError, near_miss, told
from evocity.plugins import load_plugins

#: Entry points of this group name modules, or single measures, of other packages.
PLUGINS = "evocity.fitness"

_HOW_TO_DECLARE = '@evocity.fitness(goal="max", unit="m", range=(0, 1)) above def name(city):'


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

    Call it on a `CityMap`: it returns a float, NaN (often an `Undefined`) where the measure
    has no meaning. It raises `FitnessError`, with file and line, if the function raises or
    returns anything but one finite real number or NaN.

    Attributes
    ----------
    name : the function's name: how recipes, logs and tables call the measure.
    function : the plain function, ``function(city) -> float``.
    goal : "max" or "min", its own default; None if it takes a target, or a city to be like.
    unit : the unit of the number; "" for a pure number.
    range : lowest and highest value; ``inf`` where there is no bound.
    doc : the function's documentation.
    file : the file that declares it.
    line : the line in that file.
    """

    name: str
    function: Callable[[CityMap], float] = field(repr=False)
    goal: str | None
    unit: str
    range: tuple[float, float]
    doc: str = field(repr=False)
    file: str
    line: int

    def __post_init__(self):
        object.__setattr__(self, "__doc__", self.doc)

    def __call__(self, city: CityMap) -> float:
        if not isinstance(city, CityMap):
            raise FitnessError(
                f"{self.name} of a {type(city).__name__}",
                "a CityMap",
                "read one with evocity.read_map, or wrap heights: evocity.CityMap(heights, 2.0)",
            )
        try:
            value = self.function(city)
        except EvocityError:
            raise
        except Exception as error:
            line = _line_in(self.file, error) or self.line
            raise FitnessError(
                f"{self.name} ({self.file}, line {line}) raised {told(error)} on {city.name}",
                "a measure that copes with every map, the empty one too",
                "correct that line, or return float('nan') where the measure has no meaning",
            ) from error
        if isinstance(value, Undefined):
            return value
        if isinstance(value, Real) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError):
                number = float(value)
                if not math.isinf(number):
                    return number
        raise FitnessError(
            f"{self.name} ({self.file}, line {self.line}) returned {_shown(value)} for {city.name}",
            "one finite real number, or NaN where the measure has no meaning",
            f"end {self.name} with: return float(...)",
        )

    @cached_property
    def source_hash(self) -> str:
        """Hexadecimal hash of the source that declares the measure, helpers beside it included:
        of its whole file, as it was when loaded; of the function alone if there is no file."""
        with contextlib.suppress(OSError):
            return _hash(Path(self.file).read_bytes())
        with contextlib.suppress(OSError, TypeError):
            return _hash(inspect.getsource(self.function).encode())
        return _hash(self.function.__code__.co_code)

    def __reduce__(self):
        # To another process goes the name, and the file to load there, never the function.
        return _found_again, (self.name, self.file if self.name in _from_files else None)


def _found_again(name: str, file: str | None) -> Measure:
    return get(name) if file is None else {m.name: m for m in load_file(file)}[name]


_table: dict[str, Measure] = {}  # declared by this package, by plugins, in the user's session
_from_files: dict[str, Measure] = {}  # declared in files that `load_file` executed
_collecting: ContextVar[list[Measure] | None] = ContextVar("collecting", default=None)


def fitness(
    goal: str | None = None,
    unit: str = "",
    range: tuple[float, float] = (-math.inf, math.inf),
) -> Callable[[Callable[[CityMap], float]], Measure]:
    """Decorator that makes a `Measure` of a function of one city map, under its name.

    Parameters
    ----------
    goal : "max" or "min", what a search does with it unless told otherwise; None if the
        recipe must give a target, or a city to be like.
    unit : unit of the number, "" for a pure number.
    range : lowest and highest value it can take.

    Raises `FitnessError` if the declaration or the function's signature is wrong, or the name
    is taken.
    """
    if callable(goal):
        raise FitnessError("@evocity.fitness without brackets", _HOW_TO_DECLARE, "add brackets")
    if goal not in ("max", "min", None):
        raise FitnessError(
            f"goal = {goal!r}",
            '"max", "min" or None',
            "give targets in the recipe (target = 0.35, or like = a city), not here",
        )
    if not isinstance(unit, str):
        raise FitnessError(f"unit = {unit!r}", 'text, for example "m"', "put the unit in quotes")
    bounds = _bounds(range)

    def declare(function: Callable[[CityMap], float]) -> Measure:
        _check_function(function)
        measure = Measure(
            name=function.__name__,
            function=function,
            goal=goal,
            unit=unit,
            range=bounds,
            doc=inspect.cleandoc(function.__doc__ or ""),
            file=function.__code__.co_filename,
            line=function.__code__.co_firstlineno,
        )
        collected = _collecting.get()
        if collected is None:
            _add(_table, [measure], taken=_table)
        else:
            collected.append(measure)
        return measure

    return declare


def get(name: str) -> Measure:
    """The measure called ``name``. Raises `FitnessError`, which lists those that exist."""
    known = {measure.name: measure for measure in measures()}
    if name in known:
        return known[name]
    raise FitnessError(
        "; ".join([f"no measure is called {name!r}", *plugin_warnings()]),
        f"one of {', '.join(known)}",
        near_miss(name, known) or "name one of these, or load its file first",
    )


def measures() -> list[Measure]:
    """All measures, by name: the package's, plugins', and those of files loaded so far."""
    plugin_warnings()  # the first call loads the plugins
    known = _table | _from_files
    return [known[name] for name in sorted(known)]


@cache
def plugin_warnings() -> tuple[str, ...]:
    """One text for each entry point of the group `PLUGINS` that could not be loaded."""
    return load_plugins(PLUGINS, _take)


def _take(entry: EntryPoint) -> None:
    with _collected() as found:
        loaded = entry.load()
    if not isinstance(loaded, Measure | ModuleType):
        raise TypeError(f"it is a {type(loaded).__name__}, not a measure or a module")
    if isinstance(loaded, Measure) and loaded.name not in (m.name for m in found):
        found.append(loaded)
    _add(_table, found, taken=_table)


def load_file(path: str | os.PathLike) -> list[Measure]:
    """Execute a Python file of the user's own and return the measures it declares, in order.

    From then on `get` finds them too; a file loaded later takes over names from an earlier
    one. What the file prints goes to standard error. Raises `FitnessError`, naming file and
    line, if it is missing, is not Python, raises, declares no measure or a wrong one, or takes
    the name of a measure that exists; nothing is registered then.
    """
    path = Path(path)
    if path.suffix != ".py" or not path.is_file():
        raise FitnessError(
            f"no Python file at {path}" if path.suffix == ".py" else f"{path} is no Python file",
            "a file NAME.py that declares a measure",
            "check the path; a measure of the package is named without a suffix",
        )
    path = path.resolve()
    content = path.read_bytes()
    linecache.checkcache(str(path))  # an edited file: show its new lines
    module = ModuleType(f"evocity_user_{path.stem}_{_hash(str(path).encode())[:8]}")
    module.__file__ = str(path)
    before = sys.modules.get(module.__name__)
    sys.modules[module.__name__] = module  # where dataclasses and pickle look for its classes
    try:
        with _collected() as found, contextlib.redirect_stdout(sys.stderr):
            code = compile(content, str(path), "exec", dont_inherit=True)
            exec(code, module.__dict__)
        if not found:
            raise FitnessError("no measure in it", f"at least one {_HOW_TO_DECLARE}", "add it")
        _add(_from_files, found, taken=_table)
    except (Exception, SystemExit) as error:
        if before is None:
            del sys.modules[module.__name__]
        else:
            sys.modules[module.__name__] = before
        raise _file_fault(path, error) from error
    for measure in found:
        measure.__dict__["source_hash"] = _hash(content)  # the file may change later
    return found


def _file_fault(path: Path, error: BaseException) -> FitnessError:
    line = _line_in(str(path), error)
    unreadable = isinstance(error, SyntaxError) and line is None  # else it is another file's
    if unreadable:
        line = error.lineno
    place = f"{path}, line {line}" if line else f"{path}"
    if isinstance(error, EvocityError):
        return FitnessError(f"{place}: {error.found}", error.expected, error.remedy)
    if unreadable:
        return FitnessError(
            f"{place}: {error.msg}: {(error.text or '').strip()}",
            "a Python file",
            f"correct the syntax; python -m py_compile {path.name} checks it",
        )
    return FitnessError(
        f"{place} raised {told(error)}",
        "a file that can be imported",
        f"correct that line; python {path.name} shows the same error in full",
    )


@contextlib.contextmanager
def _collected() -> Iterator[list[Measure]]:
    """Gather the measures declared within, in place of registering them one by one."""
    found: list[Measure] = []
    token = _collecting.set(found)
    try:
        yield found
    finally:
        _collecting.reset(token)


def _add(table: dict[str, Measure], found: list[Measure], taken: dict[str, Measure]) -> None:
    new: dict[str, Measure] = {}
    for measure in found:
        other = new.get(measure.name) or taken.get(measure.name)
        # Running a notebook cell, or importing a module, once more redefines its measures.
        if other and (measure.name in new or _origin(other) != _origin(measure)):
            raise FitnessError(
                f"a second measure called {measure.name} (line {measure.line}); "
                f"the first is in {other.file}, line {other.line}",
                "one measure a name",
                f"rename the function, for example my_{measure.name}",
            )
        new[measure.name] = measure
    table.update(new)


def _origin(measure: Measure) -> tuple[str, str]:
    return measure.function.__module__, measure.function.__qualname__


def _check_function(function) -> None:
    if not inspect.isfunction(function) or not function.__name__.isidentifier():
        raise FitnessError(
            f"@evocity.fitness(...) above {_shown(function)}",
            "a function with a name",
            f"write {_HOW_TO_DECLARE}",
        )
    try:
        signature = inspect.signature(function)
        signature.bind("city")
    except TypeError as error:
        raise FitnessError(
            f"{function.__name__}{signature}: {error}",
            f"a function of one argument: def {function.__name__}(city):",
            "take the city map only; give other parameters default values",
        ) from None


def _bounds(range) -> tuple[float, float]:
    with contextlib.suppress(TypeError, ValueError):
        low, high = (float(bound) for bound in range)
        if low < high:
            return low, high
    raise FitnessError(
        f"range = {range!r}",
        "two numbers, the lower first; float('inf') for no bound",
        "write for example range=(0, 1)",
    )


def _line_in(file: str, error: BaseException) -> int | None:
    """The innermost line of ``file`` that ``error`` passed through."""
    line, step = None, error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == file:
            line = step.tb_lineno
        step = step.tb_next
    return line


def _shown(value) -> str:
    shape = getattr(value, "shape", None)
    if shape is not None and not isinstance(value, Real):
        return f"{type(value).__name__} of shape {shape}"
    text = repr(value)
    return f"{type(value).__name__} {text if len(text) < 60 else text[:57] + '…'}"


def _hash(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()
