"""How a measure of the user's session reaches worker processes: as source, and what that uses.

A measure of a package or a file is found again by its name there. One of a notebook's cell, or of
a script, is not: its source is sent, with that of the functions it calls, the names of modules,
and plain values. What uses anything else cannot be sent honestly, and is refused.
"""

import ast
import builtins
import dis
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib import import_module
from importlib.util import find_spec
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from evocity.errors import FitnessError, told
from evocity.fitness.measure import Family, Measure, Several
from evocity.fitness.part import own_name
from evocity.fitness.registry import execute

_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype)
#: Of a code's flags, those that `from __future__` sets and compile takes.
_FUTURE = 0x1FE0000
#: Steps of a code that only lay out what the others do.
_LAYOUT = ("PUSH_NULL", "PRECALL", "NOP", "CACHE", "EXTENDED_ARG", "RESUME")


@dataclass(frozen=True)
class Piece:
    """Source ``text`` of a function, without decorators: it begins in the ``line`` (from 1) of
    ``file``. ``flags`` are compile's."""

    name: str
    text: str
    file: str
    line: int
    flags: int


@dataclass(frozen=True)
class Shipment:
    """The measures that one function of the session returns, as another process can make them.

    told : what describes each, by the fields of `Measure` but its function.
    place : (module, name) of what can be imported; the rest is empty then.
    imports : name -> (module, what of it); what is "" for the module itself.
    values : name -> plain values, measures, other shipments.
    pieces : functions in an order in which they can be made, that of the measures last.
    """

    told: tuple[Mapping[str, Any], ...]
    place: tuple[str, str] | None
    imports: Mapping[str, tuple[str, str]]
    values: Mapping[str, Any]
    pieces: tuple[Piece, ...]


def shipment(measures: Sequence[Measure]) -> Shipment:
    """All ``measures`` of one function, packed. Raises `FitnessError` if it, or what it uses,
    cannot be sent, and says how to do without."""
    first = measures[0]
    names = [one.name for one in fields(Measure) if one.name != "function"]
    described = tuple({name: getattr(one, name) for name in names} for one in measures)
    function = plain(first.function)
    packing = _Packing()
    try:
        if first.data:
            raise _CannotShip(f"it reads data, {', '.join(first.data)}, which only files have")
        place = _importable(function, lambda found: _function_of(found) is function)
        if place is None:
            packing.add(function)
    except _CannotShip as error:
        name = first.name.partition(".")[0]
        raise FitnessError(
            f"{name} ({first.file}, line {first.line}) cannot be sent to worker processes: {error}",
            "a measure whose source is at hand, and that uses functions with source, modules and "
            "plain values alone",
            f"put it into a file, {name}.py, and name that in the recipe as file; or search with "
            "workers=0, in this process",
        ) from None
    return Shipment(described, place, packing.imports, packing.values, tuple(packing.pieces))


def shipped(measures: Sequence[Measure]) -> tuple[Shipment, ...]:
    """What worker processes must be given of those ``measures`` that they do not find by name or
    file: those declared in this session, in a notebook's cell, a script, a module of the user's.

    Raises `FitnessError` if one cannot be sent.
    """
    together: dict[FunctionType, list[Measure]] = {}
    for one in measures:
        if one.origin == "this session":
            own = own_name(one.name)  # whatever part it is taken of
            found = together.setdefault(plain(one.function), [])
            if own not in [other.name for other in found]:
                found.append(replace(one, name=own))
    packed = tuple(shipment(found) for found in together.values())
    for function, one in zip(together, packed, strict=True):
        _check_shipped(function, one)
    return packed


def _check_shipped(function: FunctionType, packed: Shipment) -> None:
    """Raise `FitnessError` if what was packed does not become the ``function`` again."""
    try:
        again = plain(unpacked(packed)[0].function)
    except Exception as error:
        why = told(error)
    else:
        if again is function or alike(again.__code__, function.__code__):
            return
        why = "it has changed since it was read"
    raise FitnessError(
        f"the source of {function.__name__} ({function.__code__.co_filename}) does not make the "
        f"measure again, as worker processes must: {why}",
        "a measure whose source is as it was when it was declared",
        f"put it into a file, {function.__name__}.py, and name that in the recipe as file; or "
        "search with workers=0, in this process",
    )


def unpacked(packed: Shipment) -> list[Measure]:
    """The measures that were packed, in this process; `get` does not know them by name."""
    if packed.place is not None:
        module, name = packed.place
        found = getattr(import_module(module), name)
        return list(found.measures) if isinstance(found, Family) else [found]
    module = ModuleType(f"evocity_session_{packed.pieces[-1].name}")
    for name, (home, what) in packed.imports.items():
        imported = import_module(home)
        module.__dict__[name] = getattr(imported, what) if what else imported
    for name, value in packed.values.items():
        if isinstance(value, Shipment):
            found = unpacked(value)
            several = found[0].number is not None
            value = Family(found[0].name.partition(".")[0], tuple(found)) if several else found[0]
        module.__dict__[name] = value
    for piece in packed.pieces:
        text = "\n" * (piece.line - 1) + piece.text  # errors tell the lines of the user's source
        execute(text, piece.file, module, piece.flags)
    function = module.__dict__[packed.pieces[-1].name]
    numbers = [one["number"] for one in packed.told if one["number"] is not None]
    called = Several(function, numbers) if numbers else function
    return [Measure(function=called, **one) for one in packed.told]


def plain(function: Callable) -> FunctionType:
    """The user's own function of a measure, without what counts its several numbers."""
    return inspect.unwrap(function)


def alike(one: CodeType, other: CodeType) -> bool:
    """Whether two codes do the same, wherever they stand."""
    return list(_steps(one)) == list(_steps(other))


def _steps(code: CodeType) -> Iterator[tuple[str, str]]:
    """What a ``code`` does, step by step, but for how a call is laid out: that depends on what
    else the text it was compiled in imports."""
    yield code.co_name, repr((code.co_varnames, code.co_argcount, code.co_kwonlyargcount))
    for step in dis.get_instructions(code):
        if step.opname in _LAYOUT:
            continue
        if isinstance(step.argval, CodeType):
            yield from _steps(step.argval)
        elif step.opcode in dis.hasjrel or step.opcode in dis.hasjabs:
            yield step.opname, ""
        else:
            yield step.opname.replace("LOAD_METHOD", "LOAD_ATTR"), repr(step.argval)


class _CannotShip(Exception):
    pass


class _Packing:
    """What one function needs, gathered name by name."""

    def __init__(self):
        self.imports: dict[str, tuple[str, str]] = {}
        self.values: dict[str, Any] = {}
        self.pieces: list[Piece] = []
        self._names: set[str] = set()
        self._globals: dict[str, Any] | None = None

    def add(self, function: FunctionType) -> None:
        name = function.__name__
        if self._globals is None:
            self._globals = function.__globals__
        if function.__closure__:
            inner = ", ".join(function.__code__.co_freevars)
            raise _CannotShip(f"{name} uses {inner} of the function it is made in")
        if function.__globals__ is not self._globals:
            raise _CannotShip(f"{name} is of another module that cannot be imported")
        self._names.add(name)
        piece, made_at_once = _piece(function)
        for used in dict.fromkeys([*made_at_once, *_global_names(function.__code__)]):
            self._take(used, name)
        self.pieces.append(piece)

    def _take(self, used: str, by: str) -> None:
        """Pack what the global name ``used`` stands for."""
        if used in self._names:
            return
        if used not in self._globals:
            if not hasattr(builtins, used):
                raise _CannotShip(f"{by} uses {used}, which is not defined")
            return
        self._names.add(used)
        found = self._globals[used]
        if isinstance(found, ModuleType):
            self.imports[used] = (_module(found, used), "")
        elif isinstance(found, Measure) and found.origin == "this session":
            self.values[used] = shipment([found])
        elif isinstance(found, Family) and found.measures[0].origin == "this session":
            self.values[used] = shipment(found.measures)
        elif isinstance(found, Measure) or _is_plain(found):
            self.values[used] = found
        elif place := _importable(found, lambda there: there is found):
            self.imports[used] = place
        elif isinstance(found, FunctionType) and found.__name__ == used:
            self.add(found)
        else:
            raise _CannotShip(f"{by} uses {used}, a {type(found).__name__}")


def _piece(function: FunctionType) -> tuple[Piece, list[str]]:
    """The source of a ``function``, and the names that making it takes: of its defaults and
    annotations."""
    name, code = function.__name__, function.__code__
    try:
        lines, first = inspect.getsourcelines(code)
        text = textwrap.dedent("".join(lines))
        (node,) = ast.parse(text).body
    except (OSError, TypeError, SyntaxError, ValueError) as error:
        raise _CannotShip(f"the source of {name} is not at hand ({told(error)})") from None
    if not isinstance(node, ast.FunctionDef) or node.name != name:
        raise _CannotShip(f"the source of {name} is not at hand (there is something else)")
    bare = "".join(text.splitlines(keepends=True)[node.lineno - 1 :])
    outer = [node.args, *([node.returns] if node.returns else [])]
    names = [one.id for part in outer for one in ast.walk(part) if isinstance(one, ast.Name)]
    line = max(1, first) + node.lineno - 1
    return Piece(name, bare, code.co_filename, line, code.co_flags & _FUTURE), names


def _global_names(code: CodeType) -> Iterator[str]:
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield step.argval
        elif step.opname in ("STORE_GLOBAL", "DELETE_GLOBAL"):
            raise _CannotShip(f"{code.co_name} changes {step.argval}, which is not its own")
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _global_names(inner)


def _module(module: ModuleType, used: str) -> str:
    if module.__name__ == "__main__" or not _can_be_found(module):
        raise _CannotShip(f"the module {used} cannot be imported by its name there")
    return module.__name__


def _importable(found: Any, is_it: Callable[[Any], bool]) -> tuple[str, str] | None:
    """(module, name) by which ``found`` can be imported; None if it cannot."""
    home = "numpy" if isinstance(found, np.ufunc) else getattr(found, "__module__", None)
    module = sys.modules.get(home or "")
    name = getattr(found, "__qualname__", None) or getattr(found, "__name__", "")
    if module is None or module.__name__ == "__main__" or not name.isidentifier():
        return None
    here = is_it(getattr(module, name, None))
    return (module.__name__, name) if here and _can_be_found(module) else None


def _can_be_found(module: ModuleType) -> bool:
    """Whether another process of the same search path finds this very ``module``."""
    try:
        spec = find_spec(module.__name__)
    except (ImportError, ValueError):
        return False
    return spec is not None and spec.origin == getattr(module.__spec__, "origin", None)


def _function_of(found: Any) -> Any:
    if isinstance(found, Family):
        found = found.measures[0]
    return plain(found.function) if isinstance(found, Measure) else None


def _is_plain(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return type(value) is np.ndarray and not value.dtype.hasobject
    if type(value) in (list, tuple, set, frozenset):
        return all(map(_is_plain, value))
    if type(value) is dict:
        return all(_is_plain(one) for pair in value.items() for one in pair)
    return isinstance(value, _PLAIN) and type(value).__module__ in ("builtins", "numpy")


__all__ = ["Piece", "Shipment", "shipment", "shipped", "unpacked"]
