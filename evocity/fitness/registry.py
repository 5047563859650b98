"""The table of measures: the decorator, look-up by name, users' files and plugins."""

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

from evocity.errors import EvocityError, FitnessError, check_word, describe_error, near_miss
from evocity.fitness import declaration
from evocity.fitness.local_imports import importing_from, read_data
from evocity.fitness.measure import (
    Family,
    Measure,
    Several,
    content_hash,
    line_in,
)
from evocity.fitness.reference import Reference
from evocity.plugins import load_plugins, origin_of

#: Entry points of this group name modules, or single measures, of other packages.
PLUGINS = "evocity.fitness"

#: Types of the argument of a measure.
SUBJECTS = ("city", "shape", "curve", "site")


_table: dict[str, Measure] = {}  # declared by this package, by plugins, in the user's session
_from_files: dict[str, Measure] = {}  # declared in files that `load_file` read
_collecting: ContextVar[list[Measure] | None] = ContextVar("collecting", default=None)

#: Functions that declare the measures of other files than Python's, from stem and content, by
#: suffix. They raise `FitnessError`, and execute nothing of the file.
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
    """Decorate a function of a city map to make it a `Measure` with the function's name.

    The function takes the city, and may take the arguments `reference`, `genome`, `parents` and
    `sources` by name. The argument ``reference`` is a `Reference`, which holds the cities to
    compare with the map. The argument ``genome`` is the genome that decodes to the map. The
    argument ``parents`` holds the genomes of the map's parents, and the argument ``sources`` holds
    the maps of the source cities. If evocity does not know the value of an argument, the argument
    keeps its default value.

    Parameters
    ----------
    goal : default goal of a search, "max" or "min"; None if the recipe must give a goal, a target
        value, or a city to resemble.
    unit : unit of the number, "" for a pure number.
    range : lowest and highest possible value.
    numbers : names of the numbers, if the function returns a mapping of several numbers. If the
        function returns several numbers, the decorator returns a `Family` of measures with names of
        the form ``function.number``. The arguments ``goal``, ``unit`` and ``range`` can be one
        value for all numbers, or a mapping with a value for each number. If the first number has
        the name of the function, the decorator returns the `Measure` of this number instead of the
        `Family`.
    any_site : whether the measure is correct for a part of a map that is not a rectangle;
        ``city.site`` marks the pixels of this part. If ``any_site`` is false, recipes accept only
        rectangles for this measure.
    data : files that the function reads, such as "trees.csv", from the folder of the Python file or
        from a subfolder. The content of data files is part of the measure's source, so runs store
        these files and send them to other machines. The function finds the file ``trees.csv`` by
        ``Path(__file__).with_name("trees.csv")``.
    of : type of the argument: "city" for a map; "shape", "curve" or "site" for runs that breed
        objects of these types from `evocity.kinds`.

    Raises `FitnessError` if the declaration or the function's signature is wrong, or if the name of
    the measure is already in use.
    """
    if callable(goal):
        raise FitnessError(
            "@evocity.fitness without brackets",
            declaration.HOW_TO_DECLARE,
            "write @evocity.fitness()",
        )
    several, read = declaration.check_numbers(numbers), declaration.check_names(data)
    check_word("of", of, SUBJECTS, "leave it out for a map", FitnessError)
    each = [
        (
            number,
            declaration.check_goal(declaration.value_for(goal, number, None)),
            declaration.check_unit(declaration.value_for(unit, number, "")),
            declaration.check_bounds(declaration.value_for(range, number, (-math.inf, math.inf))),
        )
        for number in several or [None]
    ]
    for values in (goal, unit, range):
        strange = set(values) - set(several) if isinstance(values, Mapping) else ()
        if strange:
            raise FitnessError(
                f"{', '.join(map(str, strange))} has a goal, a unit or a range, but is missing in "
                f"the parameter numbers = {several}",
                "goals, units and ranges only for the numbers that the function returns",
                "add these names to numbers=(…)",
            )

    def declare(function: Callable) -> Measure | Family:
        needs, takes = declaration.check_function(function)
        name, called = function.__name__, Several(function, several) if several else function
        file = function.__code__.co_filename
        declared = [
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
            _add(_table, declared, taken=_table)
        else:
            collected.extend(declared)
        return Family(name, tuple(declared)) if several and several[0] != name else declared[0]

    return declare


def get(name: str) -> Measure:
    """Return the measure called ``name``. If no measure has the name, the function raises
    `FitnessError` and suggests the most similar name."""
    known = {measure.name: measure for measure in measures(None)}
    if name in known:
        return known[name]
    raise FitnessError(
        "; ".join([f"no measure is called {name!r}", *plugin_warnings()]),
        "a name that `evocity fitness list` shows, or a file NAME.py that declares a measure",
        f"{near_miss(name, known)} `evocity fitness list` shows all {len(known)} measures".strip(),
    )


def named(name: str) -> list[Measure]:
    """Return the measure called ``name``, or all measures of the function ``name`` if it returns
    several numbers. Raises `FitnessError` for an unknown name, like the function `get`."""
    known = measures(None)
    return [m for m in known if m.name == name] or family_of(name, known) or [get(name)]


def family_of(name: str, among: Sequence[Measure]) -> list[Measure]:
    """Select ``among`` measures those of the function ``name`` that returns several numbers."""
    return [m for m in among if m.number is not None and m.name == f"{name}.{m.number}"]


def measures(of: str | None = "city") -> list[Measure]:
    """List all measures in the order of their names: those of the package, of plugins, and of
    loaded files.

    of : type of the argument of the listed measures, by default "city"; None lists the measures of
        all types.
    """
    plugin_warnings()  # the first call loads the plugins
    known = _table | _from_files
    return [known[name] for name in sorted(known) if of in (None, known[name].of)]


def execute(source: str | bytes, file: str, module: ModuleType, flags: int = 0) -> None:
    """Execute the user's ``source`` in ``module``."""
    code = compile(source, file, "exec", flags, dont_inherit=True)
    exec(code, module.__dict__)


def file_of(name: str) -> str | None:
    """Return the file that declares the measure and was read by `load_file`; None for others."""
    return _from_files[name].file if name in _from_files else None


def unpickle_measure(name: str, file: str | None, reference: Reference | None = None) -> Measure:
    """Find the measure ``name`` in another process, from its ``file`` if it has one, and bind its
    ``reference``."""
    measure = get(name) if file is None else {m.name: m for m in load_file(file)}[name]
    return measure if reference is None else measure.bound(reference)


def _reduce(measure: Measure):
    """Pickle the name, the file to load, and the reference, never the function."""
    return unpickle_measure, (measure.name, file_of(measure.name), measure.reference)


copyreg.pickle(Measure, _reduce)


@cache
def plugin_warnings() -> tuple[str, ...]:
    """Return a text for each entry point of the group `PLUGINS` that cannot be loaded."""
    return load_plugins(PLUGINS, _load_entry)


def _load_entry(entry: EntryPoint) -> None:
    with _collect() as declared:
        loaded = entry.load()
    if not isinstance(loaded, Measure | Family | ModuleType):
        raise TypeError(f"it is a {type(loaded).__name__}, not a measure or a module")
    single = {Measure: lambda: [loaded], Family: lambda: loaded.measures}
    for measure in single.get(type(loaded), list)():
        if measure.name not in (m.name for m in declared):
            declared.append(measure)
    _add(_table, [replace(m, origin=origin_of(entry)) for m in declared], taken=_table)


def load_file(path: str | os.PathLike) -> list[Measure]:
    """Load the measures of a file, and return them in order. The function executes the file if it
    is a Python file. If the file is not a Python file, the function reads a table (`TABLES`):
    building types in TOML, a line in GeoJSON, or a picture in PNG.

    After a call of `load_file`, the function `get` finds the measures of the file. A file that is
    loaded later replaces measures of the same name from earlier files. A Python file may import
    other Python files from its own folder; the source of its measures includes these imported
    files. Text that the file prints goes to standard error.

    Raises `FitnessError`, with file and line, if the file is missing, is not Python, or raises an
    error. The function raises `FitnessError` if the file declares no measure, an invalid measure,
    or a measure with the name of a packaged measure. After an error, none of the file's measures is
    registered.
    """
    path = Path(path)
    read = TABLES.get(path.suffix)
    if (path.suffix != ".py" and not read) or not path.is_file():
        kind = "table" if read else "Python file"
        raise FitnessError(
            f"no {kind} at {path}" if read or path.suffix == ".py" else f"{path} is not a {kind}",
            "a file NAME.py that declares a measure, or a table of building types, NAME.toml",
            "correct the path; write the name of a measure of the package without a suffix",
        )
    path = path.resolve()
    content = path.read_bytes()
    declared, imported = _read_table(path, content) if read else _execute_file(path, content)
    whole = content + b"".join(imported[file] for file in sorted(imported))
    for measure in declared:
        measure.__dict__["source_hash"] = content_hash(whole)  # the files may change later
    return declared


def name_of_file(stem: str, suffix: str, example: str) -> str:
    """Join the name of a table. Raises `FitnessError` if its ``stem`` cannot name a measure."""
    if not stem.isidentifier():
        raise FitnessError(
            f"the file name {stem}{suffix} cannot name a measure",
            "a file name of letters, digits and _, without a digit at the start",
            f"rename the file, for example to {example}{suffix}",
        )
    return f"{stem}{suffix}"


def _read_table(path: Path, content: bytes) -> tuple[list[Measure], dict[Path, bytes]]:
    """Declare the measures of a table, which imports nothing."""
    try:
        with _collect() as declared:
            TABLES[path.suffix](path.stem, content)
        declared = [replace(m, file=str(path), line=1, origin=str(path)) for m in declared]
        _add(_from_files, declared, taken=_table)
    except FitnessError as error:
        raise FitnessError(f"{path}: {error.found}", error.expected, error.remedy) from None
    return declared, {}


def _execute_file(path: Path, content: bytes) -> tuple[list[Measure], dict[Path, bytes]]:
    """Execute a Python file: the measures it declares, and the files it imports from its folder."""
    linecache.checkcache(str(path))  # so that errors show the lines of an edited file
    module = ModuleType(f"evocity_user_{path.stem}_{content_hash(str(path).encode())[:8]}")
    module.__file__ = str(path)
    before = sys.modules.get(module.__name__)
    sys.modules[module.__name__] = module  # where dataclasses and pickle look for its classes
    try:
        with (
            importing_from(path.parent) as imported,
            _collect() as declared,
            contextlib.redirect_stdout(sys.stderr),
        ):
            execute(content, str(path), module)
        # measures of imported files are helpers of this file
        declared = [m for m in declared if Path(m.file) not in imported]
        if not declared:
            raise FitnessError(
                "the file declares no measure",
                f"at least one line {declaration.HOW_TO_DECLARE}",
                "declare a measure in this file",
            )
        imported |= read_data(path.parent, declared)
        beside = tuple(map(str, sorted(imported)))
        declared = [replace(m, origin=str(path), beside=beside) for m in declared]
        _add(_from_files, declared, taken=_table)
    except (Exception, SystemExit) as error:
        if before is None:
            del sys.modules[module.__name__]
        else:
            sys.modules[module.__name__] = before
        raise _file_error(path, error) from error
    return declared, imported


def _file_error(path: Path, error: BaseException) -> FitnessError:
    line = line_in(str(path), error)
    unreadable = isinstance(error, SyntaxError) and line is None  # else of an imported file
    if unreadable:
        line = error.lineno
    place = f"{path}, line {line}" if line else f"{path}"
    if isinstance(error, EvocityError):
        return FitnessError(f"{place}: {error.found}", error.expected, error.remedy)
    if unreadable:
        return FitnessError(
            f"{place}: {error.msg}: {(error.text or '').strip()}",
            "a file with valid Python",
            f"correct the syntax; python -m py_compile {path.name} checks it",
        )
    remedy = f"correct that line; python {path.name} shows the same error in full"
    if isinstance(error, ModuleNotFoundError):
        remedy = f"install {error.name}, or put {error.name}.py in the folder of {path.name}"
    return FitnessError(
        f"{place} raised {describe_error(error)}", "a file that loads without errors", remedy
    )


@contextlib.contextmanager
def _collect() -> Iterator[list[Measure]]:
    """Collect the measures declared in the block, and register none of them."""
    declared: list[Measure] = []
    token = _collecting.set(declared)
    try:
        yield declared
    finally:
        _collecting.reset(token)


def _add(table: dict[str, Measure], declared: list[Measure], taken: dict[str, Measure]) -> None:
    new: dict[str, Measure] = {}
    for measure in declared:
        other = new.get(measure.name) or taken.get(measure.name)
        # A cell that runs again, or a module that is imported again, replaces its measures.
        if other and (measure.name in new or _origin(other) != _origin(measure)):
            raise FitnessError(
                f"a second measure has the name {measure.name} (line {measure.line}); "
                f"the first is in {other.file}, line {other.line}",
                "a different name for each measure",
                f"rename the function, for example my_{measure.name}",
            )
        new[measure.name] = measure
    table.update(new)


def _origin(measure: Measure) -> tuple[str, str]:
    return measure.function.__module__, measure.function.__qualname__
