"""Which measures there are, and how a function, a name or a file becomes one."""

import contextlib
import copyreg
import inspect
import linecache
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import overload

from evocity.errors import EvocityError, FitnessError, check_word, near_miss, told
from evocity.fitness.data import checked_names, data_of
from evocity.fitness.declaring import (
    HOW_TO_DECLARE,
    check_function,
    checked_bounds,
    checked_goal,
    checked_numbers,
    checked_unit,
    own,
)
from evocity.fitness.measure import (
    Family,
    Measure,
    Several,
    content_hash,
    line_in,
)
from evocity.fitness.reference import Reference
from evocity.fitness.siblings import importing_from
from evocity.plugins import load_plugins, origin_of

#: Entry points of this group name modules, or single measures, of other packages.
PLUGINS = "evocity.fitness"

#: What measures may be of.
SUBJECTS = ("city", "shape", "curve", "site")


_table: dict[str, Measure] = {}  # declared by this package, by plugins, in the user's session
_from_files: dict[str, Measure] = {}  # declared in files that `load_file` executed
_collecting: ContextVar[list[Measure] | None] = ContextVar("collecting", default=None)

#: Other files than Python's that declare measures: by suffix, what declares those of a file's stem
#: and content. It raises `FitnessError` and executes nothing.
TABLES: dict[str, Callable[[str, bytes], None]] = {}

_PACKAGE = str(Path(__file__).parent.parent) + os.sep


@overload
def fitness(
    goal: str | None = None,
    unit: str = "",
    range: tuple[float, float] = (-math.inf, math.inf),
    *,
    any_site: bool = False,
    of: str = "city",
) -> Callable[[Callable], Measure]: ...


@overload
def fitness(
    goal: str | Mapping[str, str | None] | None = None,
    unit: str | Mapping[str, str] = "",
    range: tuple[float, float] | Mapping[str, tuple[float, float]] = (-math.inf, math.inf),
    *,
    numbers: Sequence[str],
    any_site: bool = False,
    of: str = "city",
) -> Callable[[Callable], Measure | Family]: ...


def fitness(
    goal: str | Mapping[str, str | None] | None = None,
    unit: str | Mapping[str, str] = "",
    range: tuple[float, float] | Mapping[str, tuple[float, float]] = (-math.inf, math.inf),
    *,
    numbers: Sequence[str] = (),
    any_site: bool = False,
    data: str | Sequence[str] = (),
    of: str = "city",
) -> Callable[[Callable], Measure | Family]:
    """Decorator that makes a `Measure` of a function of a city map, under its name.

    The function takes the city, and if it names them so, ``reference`` (a `Reference`, the cities
    it is compared with), ``genome`` (the code that was decoded) and ``parents`` (the genomes it
    was bred from); those with a default value it gets where they are known.

    Parameters
    ----------
    goal : "max" or "min", what a search does with it unless told otherwise; None if the
        recipe must give a target, or a city to be like.
    unit : unit of the number, "" for a pure number.
    range : lowest and highest value it can take.
    numbers : names, if the function returns several numbers, as a mapping from each name; it
        becomes a `Family` of measures called function.number. goal, unit and range are then
        those of all, or mappings from a number's name. A first number with the function's own
        name is the one meant by that name alone: the decorator then returns that `Measure`.

    any_site : whether it is right of a part of a map of any shape, whose pixels are ``city.site``;
        else a recipe takes it within rectangles alone.
    data : files that the function reads, beside the Python file or in a folder beside it, such as
        "trees.csv": they are part of its source, kept by runs, and go along to other machines. The
        function finds them by ``Path(__file__).with_name("trees.csv")``.
    of : what it is a function of: "city", a map, or for runs of other kinds "shape", "curve" or
        "site", a form of `evocity.forms`.

    Raises `FitnessError` if the declaration or the function's signature is wrong, or the name
    is taken.
    """
    if callable(goal):
        raise FitnessError("@evocity.fitness without brackets", HOW_TO_DECLARE, "add brackets")
    several, read = checked_numbers(numbers), checked_names(data)
    check_word("of", of, SUBJECTS, "leave it out for a map", FitnessError)
    each = [
        (
            number,
            checked_goal(own(goal, number, None)),
            checked_unit(own(unit, number, "")),
            checked_bounds(own(range, number, (-math.inf, math.inf))),
        )
        for number in several or [None]
    ]
    for told_by_name in (goal, unit, range):
        strange = set(told_by_name) - set(several) if isinstance(told_by_name, Mapping) else ()
        if strange:
            raise FitnessError(
                f"{', '.join(map(str, strange))}, which is none of numbers = {several}",
                "goals, units and ranges of the numbers the function returns",
                "name them in numbers=(…) too",
            )

    def declare(function: Callable) -> Measure | Family:
        needs, takes = check_function(function)
        name, called = function.__name__, Several(function, several) if several else function
        file = function.__code__.co_filename
        found = [
            Measure(
                name=name if number in (None, name) else f"{name}.{number}",
                function=called,
                goal=goal,
                unit=unit,
                range=bounds,
                doc=inspect.cleandoc(function.__doc__ or ""),
                file=file,
                line=function.__code__.co_firstlineno,
                needs=needs,
                takes=takes,
                number=number,
                any_site=bool(any_site),
                data=read,
                of=of,
                origin="evocity" if file.startswith(_PACKAGE) else "this session",
            )
            for number, goal, unit, bounds in each
        ]
        collected = _collecting.get()
        if collected is None:
            _add(_table, found, taken=_table)
        else:
            collected.extend(found)
        return Family(name, tuple(found)) if several and several[0] != name else found[0]

    return declare


def get(name: str) -> Measure:
    """The measure called ``name``. Raises `FitnessError`, which tells the one that is most like
    it."""
    known = {measure.name: measure for measure in measures(None)}
    if name in known:
        return known[name]
    raise FitnessError(
        "; ".join([f"no measure is called {name!r}", *plugin_warnings()]),
        "a measure that `evocity fitness list` names, or a file NAME.py that declares one",
        f"{near_miss(name, known)} `evocity fitness list` names all {len(known)}".strip(),
    )


def named(name: str) -> list[Measure]:
    """The measure called ``name``, or all those of the function so called that returns several
    numbers, none of them of its own name. Raises `FitnessError` as `get` does."""
    found = measures(None)
    return [m for m in found if m.name == name] or family_of(name, found) or [get(name)]


def family_of(name: str, among: Sequence[Measure]) -> list[Measure]:
    """Those ``among`` measures that the function ``name`` returns as several numbers."""
    return [one for one in among if one.number is not None and one.name == f"{name}.{one.number}"]


def measures(of: str | None = "city") -> list[Measure]:
    """All measures of maps, or of what else they are to be ``of``, None for all there are, by name:
    the package's, plugins', and those of files loaded so far."""
    plugin_warnings()  # the first call loads the plugins
    known = _table | _from_files
    return [known[name] for name in sorted(known) if of in (None, known[name].of)]


def execute(source: str | bytes, file: str, module: ModuleType, flags: int = 0) -> None:
    """Run the user's own ``source`` in ``module``."""
    code = compile(source, file, "exec", flags, dont_inherit=True)
    exec(code, module.__dict__)


def file_of(name: str) -> str | None:
    """The file `load_file` found the measure in; None for those registered otherwise."""
    return _from_files[name].file if name in _from_files else None


def found_again(name: str, file: str | None, reference: Reference | None = None) -> Measure:
    """The measure called ``name``, in another process: from its ``file`` if it has one; bound to
    its ``reference``."""
    found = get(name) if file is None else {m.name: m for m in load_file(file)}[name]
    return found if reference is None else found.bound(reference)


def _as_named(measure: Measure):
    """To another process goes the name, the file to load there, and what it compares with, never
    the function."""
    return found_again, (measure.name, file_of(measure.name), measure.reference)


copyreg.pickle(Measure, _as_named)


@cache
def plugin_warnings() -> tuple[str, ...]:
    """One text for each entry point of the group `PLUGINS` that could not be loaded."""
    return load_plugins(PLUGINS, _take)


def _take(entry: EntryPoint) -> None:
    with _collected() as found:
        loaded = entry.load()
    if not isinstance(loaded, Measure | Family | ModuleType):
        raise TypeError(f"it is a {type(loaded).__name__}, not a measure or a module")
    single = {Measure: lambda: [loaded], Family: lambda: loaded.measures}
    for one in single.get(type(loaded), list)():
        if one.name not in (m.name for m in found):
            found.append(one)
    _add(_table, [replace(one, origin=origin_of(entry)) for one in found], taken=_table)


def load_file(path: str | os.PathLike) -> list[Measure]:
    """Execute a Python file of the user's own and return the measures it declares, in order; or
    read a table, such as one of building types in TOML (`TABLES`), and return the measures by it.

    From then on `get` finds them too; a file loaded later takes over names from an earlier
    one. The file may import others that lie beside it; they are found while it loads, and are
    part of its source. What it prints goes to standard error. Raises `FitnessError`, naming file
    and line, if it is missing, is not Python, raises, declares no measure or a wrong one, or takes
    the name of a measure that exists; nothing is registered then.
    """
    path = Path(path)
    read = TABLES.get(path.suffix)
    if (path.suffix != ".py" and not read) or not path.is_file():
        kind = "table" if read else "Python file"
        raise FitnessError(
            f"no {kind} at {path}" if read or path.suffix == ".py" else f"{path} is no {kind}",
            "a file NAME.py that declares a measure, or a table of building types, NAME.toml",
            "check the path; a measure of the package is named without a suffix",
        )
    path = path.resolve()
    content = path.read_bytes()
    found, imported = _tabled(path, content) if read else _executed(path, content)
    whole = content + b"".join(imported[one] for one in sorted(imported))
    for measure in found:
        measure.__dict__["source_hash"] = content_hash(whole)  # the files may change later
    return found


def _tabled(path: Path, content: bytes) -> tuple[list[Measure], dict[Path, bytes]]:
    """The measures by a table, which imports nothing."""
    try:
        with _collected() as found:
            TABLES[path.suffix](path.stem, content)
        found = [replace(one, file=str(path), line=1, origin=str(path)) for one in found]
        _add(_from_files, found, taken=_table)
    except FitnessError as error:
        raise FitnessError(f"{path}: {error.found}", error.expected, error.remedy) from None
    return found, {}


def _executed(path: Path, content: bytes) -> tuple[list[Measure], dict[Path, bytes]]:
    """The measures that a Python file declares, and what it imports from its folder."""
    linecache.checkcache(str(path))  # an edited file: show its new lines
    module = ModuleType(f"evocity_user_{path.stem}_{content_hash(str(path).encode())[:8]}")
    module.__file__ = str(path)
    before = sys.modules.get(module.__name__)
    sys.modules[module.__name__] = module  # where dataclasses and pickle look for its classes
    try:
        with (
            importing_from(path.parent) as imported,
            _collected() as found,
            contextlib.redirect_stdout(sys.stderr),
        ):
            execute(content, str(path), module)
        # a measure that the file imports is its helper
        found = [one for one in found if Path(one.file) not in imported]
        if not found:
            raise FitnessError("no measure in it", f"at least one {HOW_TO_DECLARE}", "add it")
        imported |= data_of(path.parent, found)
        beside = tuple(str(one) for one in sorted(imported))
        found = [replace(one, origin=str(path), beside=beside) for one in found]
        _add(_from_files, found, taken=_table)
    except (Exception, SystemExit) as error:
        if before is None:
            del sys.modules[module.__name__]
        else:
            sys.modules[module.__name__] = before
        raise _file_fault(path, error) from error
    return found, imported


def _file_fault(path: Path, error: BaseException) -> FitnessError:
    line = line_in(str(path), error)
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
    remedy = f"correct that line; python {path.name} shows the same error in full"
    if isinstance(error, ModuleNotFoundError):
        remedy = f"install {error.name}, or lay {error.name}.py beside {path.name}"
    return FitnessError(
        f"{place} raised {told(error)}",
        "a file that can be imported",
        remedy,
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
