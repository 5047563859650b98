"""Transfer of a session's measures to worker processes, as source with all that the source uses.

Worker processes find a measure of a package or a file by name. A measure of a notebook's cell or of
a script travels as source, with all that it uses: source of functions, names of modules, and plain
values. A measure that uses anything else raises `FitnessError`.
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

from evocity.errors import FitnessError, describe_error
from evocity.fitness.measure import Family, Measure, Several
from evocity.fitness.part import own_name
from evocity.fitness.registry import execute

_REMEDY = (
    "put the measure into a file {}.py, and name this file in the recipe; or search with workers=0"
)
_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype)
#: The flags of a code object that `from __future__` sets and compile takes.
_FUTURE = 0x1FE0000
#: Instructions that depend only on the layout of the code.
_LAYOUT = ("PUSH_NULL", "PRECALL", "NOP", "CACHE", "EXTENDED_ARG", "RESUME")


@dataclass(frozen=True)
class Piece:
    """Source ``text`` of a function, without decorators. It begins in the ``line`` (from 1) of
    ``file``; ``flags`` are those of compile."""

    name: str
    text: str
    file: str
    line: int
    flags: int


@dataclass(frozen=True)
class Shipment:
    """The measures of one function of the session, packed for another process.

    fields : the fields of each `Measure`, without its function.
    place : (module, name) if the function can be imported; the rest is empty then.
    imports : name -> (module, name in it), "" for the module itself.
    values : name -> plain values, measures, other shipments.
    pieces : functions, each after those it uses, that of the measures last.
    """

    fields: tuple[Mapping[str, Any], ...]
    place: tuple[str, str] | None
    imports: Mapping[str, tuple[str, str]]
    values: Mapping[str, Any]
    pieces: tuple[Piece, ...]


def pack_function(measures: Sequence[Measure]) -> Shipment:
    """Pack all ``measures`` of one function. Raises `FitnessError` if the function, or anything it
    uses, cannot be sent."""
    first = measures[0]
    names = [field.name for field in fields(Measure) if field.name != "function"]
    described = tuple({name: getattr(m, name) for name in names} for m in measures)
    function = user_function(first.function)
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
            "a measure with source code that uses only functions with source code, modules and "
            "plain values",
            _REMEDY.format(name),
        ) from None
    return Shipment(described, place, packing.imports, packing.values, tuple(packing.pieces))


def shipped(measures: Sequence[Measure]) -> tuple[Shipment, ...]:
    """Pack those ``measures`` that worker processes do not find by name or file: those declared in
    this session, in a notebook's cell, a script, or a module of the user.

    Raises `FitnessError` if one of them cannot be sent.
    """
    groups: dict[FunctionType, list[Measure]] = {}
    for measure in measures:
        if measure.origin == "this session":
            name = own_name(measure.name)  # without the name of a part
            group = groups.setdefault(user_function(measure.function), [])
            if name not in [other.name for other in group]:
                group.append(replace(measure, name=name))
    packed = {function: pack_function(group) for function, group in groups.items()}
    for function, sent in packed.items():
        _check_shipped(function, sent)
    return tuple(packed.values())


def _check_shipped(function: FunctionType, packed: Shipment) -> None:
    """Raise `FitnessError` if the shipment does not make the ``function``."""
    try:
        copy = user_function(unpacked(packed)[0].function)
    except Exception as error:
        why = describe_error(error)
    else:
        if copy is function or same_code(copy.__code__, function.__code__):
            return
        why = "it has changed since it was read"
    raise FitnessError(
        f"the source of {function.__name__} ({function.__code__.co_filename}) cannot rebuild "
        f"the measure in worker processes: {why}",
        "a measure whose source has not changed since it was declared",
        _REMEDY.format(function.__name__),
    )


def unpacked(packed: Shipment) -> list[Measure]:
    """Make the packed measures in this process; `get` does not find them."""
    if packed.place is not None:
        module, name = packed.place
        declared = getattr(import_module(module), name)
        return list(declared.measures) if isinstance(declared, Family) else [declared]
    module = ModuleType(f"evocity_session_{packed.pieces[-1].name}")
    for name, (home, attribute) in packed.imports.items():
        imported = import_module(home)
        module.__dict__[name] = getattr(imported, attribute) if attribute else imported
    for name, value in packed.values.items():
        if isinstance(value, Shipment):
            made = unpacked(value)
            several = made[0].number is not None
            value = Family(made[0].name.partition(".")[0], tuple(made)) if several else made[0]
        module.__dict__[name] = value
    for piece in packed.pieces:
        text = "\n" * (piece.line - 1) + piece.text  # so that errors show the user's lines
        execute(text, piece.file, module, piece.flags)
    function = module.__dict__[packed.pieces[-1].name]
    numbers = [known["number"] for known in packed.fields if known["number"] is not None]
    called = Several(function, numbers) if numbers else function
    return [Measure(function=called, **known) for known in packed.fields]


def user_function(function: Callable) -> FunctionType:
    """Unwrap the user's function of a measure from `Several`."""
    return inspect.unwrap(function)


def same_code(one: CodeType, other: CodeType) -> bool:
    """Check whether two code objects do the same, in whatever lines."""
    return list(_steps(one)) == list(_steps(other))


def _steps(code: CodeType) -> Iterator[tuple[str, str]]:
    """List the instructions of a ``code``, without the layout of calls: that depends on the other
    imports of the compiled text."""
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
    """All that one function uses, collected name by name."""

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
            raise _CannotShip(f"{name} uses {inner} of its outer function")
        if function.__globals__ is not self._globals:
            raise _CannotShip(f"{name} belongs to another module, which cannot be imported")
        self._names.add(name)
        piece, made_at_once = _piece(function)
        for used in dict.fromkeys([*made_at_once, *_global_names(function.__code__)]):
            self._take(used, name)
        self.pieces.append(piece)

    def _take(self, used: str, by: str) -> None:
        """Pack the value of the global name ``used``."""
        if used in self._names:
            return
        if used not in self._globals:
            if not hasattr(builtins, used):
                raise _CannotShip(f"{by} uses {used}, which is not defined")
            return
        self._names.add(used)
        value = self._globals[used]
        if isinstance(value, ModuleType):
            self.imports[used] = (_module(value, used), "")
        elif isinstance(value, Measure) and value.origin == "this session":
            self.values[used] = pack_function([value])
        elif isinstance(value, Family) and value.measures[0].origin == "this session":
            self.values[used] = pack_function(value.measures)
        elif isinstance(value, Measure) or _is_plain(value):
            self.values[used] = value
        elif place := _importable(value, lambda there: there is value):
            self.imports[used] = place
        elif isinstance(value, FunctionType) and value.__name__ == used:
            self.add(value)
        else:
            raise _CannotShip(f"{by} uses {used}, a {type(value).__name__}")


def _piece(function: FunctionType) -> tuple[Piece, list[str]]:
    """Read the source of a ``function``, and the names in its defaults and annotations."""
    name, code = function.__name__, function.__code__
    try:
        lines, first = inspect.getsourcelines(code)
        text = textwrap.dedent("".join(lines))
        (node,) = ast.parse(text).body
    except (OSError, TypeError, SyntaxError, ValueError) as error:
        raise _CannotShip(
            f"the source of {name} is not available ({describe_error(error)})"
        ) from None
    if not isinstance(node, ast.FunctionDef) or node.name != name:
        raise _CannotShip(f"the source of {name} is not available (its lines hold other code)")
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
            raise _CannotShip(f"{code.co_name} changes the global variable {step.argval}")
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _global_names(inner)


def _module(module: ModuleType, used: str) -> str:
    if module.__name__ == "__main__" or not _can_be_found(module):
        raise _CannotShip(f"worker processes cannot import the module {used} by its name")
    return module.__name__


def _importable(value: Any, is_it: Callable[[Any], bool]) -> tuple[str, str] | None:
    """Find (module, name) by which ``value`` can be imported; None if it cannot."""
    home = "numpy" if isinstance(value, np.ufunc) else getattr(value, "__module__", None)
    module = sys.modules.get(home or "")
    name = getattr(value, "__qualname__", None) or getattr(value, "__name__", "")
    if module is None or module.__name__ == "__main__" or not name.isidentifier():
        return None
    here = is_it(getattr(module, name, None))
    return (module.__name__, name) if here and _can_be_found(module) else None


def _can_be_found(module: ModuleType) -> bool:
    """Check whether another process with the same search path finds the same ``module``."""
    try:
        spec = find_spec(module.__name__)
    except (ImportError, ValueError):
        return False
    return spec is not None and spec.origin == getattr(module.__spec__, "origin", None)


def _function_of(value: Any) -> Any:
    if isinstance(value, Family):
        value = value.measures[0]
    return user_function(value.function) if isinstance(value, Measure) else None


def _is_plain(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return type(value) is np.ndarray and not value.dtype.hasobject
    if type(value) in (list, tuple, set, frozenset):
        return all(map(_is_plain, value))
    if type(value) is dict:
        return all(_is_plain(one) for pair in value.items() for one in pair)
    return isinstance(value, _PLAIN) and type(value).__module__ in ("builtins", "numpy")
