"""Which parameters may an operator have? Types from its annotations, values from its checks."""

import inspect
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import NoneType, UnionType

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from evocity.citymap import MAX_SIDE
from evocity.errors import OperatorError, set_to, shown

#: Parameter -> (what was found, what is allowed).
Faults = dict[str, tuple[str, str]]
#: A condition of a parameter's value, and in words what is allowed.
Check = tuple[Callable[..., bool], str]

_STRICT = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
_WORDS = {
    str: "text",
    int: "whole number",
    float: "finite number",
    bool: "true or false",
    NoneType: "none",
}


def wrong_types(kind: type, parameters: Mapping[str, object]) -> Faults:
    """Those of ``parameters`` whose type is not that of the annotation in ``kind``.

    No type stands for another, but whole numbers for numbers, and lists, tuples, ranges and
    arrays for each other.
    """
    return {
        key: (shown(parameters[key]), told)
        for key, (adapter, told) in _annotated(kind).items()
        if key in parameters and not _fits(adapter, parameters[key])
    }


def number_of(kind: type, key: str) -> type[int] | type[float] | None:
    """What numbers a parameter takes: float any, int whole ones alone; None if it takes none. One
    without an annotation takes those of its default's type, or any."""
    annotated = _annotated(kind).get(key)
    if annotated is None:
        default = inspect.signature(kind).parameters[key].default
        return {int: int, bool: None, str: None}.get(type(default), float)
    fits = (number for number, example in ((float, 0.5), (int, 1)) if _fits(annotated[0], example))
    return next(fits, None)


def check_parameters(operator, allowed: Mapping[str, Check]) -> None:
    """Raise one `OperatorError` with every parameter of wrong type or value.

    For ``__post_init__``. ``allowed`` maps a parameter to (condition of its value, what is
    allowed); conditions see values of the right type, and NumPy's numbers as Python's.
    """
    parameters = vars(operator)
    for key, value in list(parameters.items()):
        if isinstance(value, np.ndarray | np.generic):
            object.__setattr__(operator, key, _plain(value))
    faults = wrong_types(type(operator), parameters)
    for key, (holds, told) in allowed.items():
        if key not in faults and not _holds(holds, parameters[key]):
            faults[key] = shown(parameters[key]), told
    if faults:
        raise at_fault(operator.name, faults)


def repair_checks() -> dict[str, Check]:
    """Checks of the three repair parameters every operator has, for `check_parameters`."""
    return {
        "repair": (lambda rms: rms is None or rms > 0, "above 0 m, or none for no repair"),
        "reach": (
            lambda reach: reach is None or 0 <= reach <= MAX_SIDE,
            f"0…{MAX_SIDE} px, or none for the whole map",
        ),
        "domains": (
            lambda domains: len(domains) > 0 and all(2 <= m <= MAX_SIDE for m in domains),
            "whole multiples of B, 2 or more",
        ),
    }


def at_fault(name: str, faults: Faults, remedy: str = "change these parameters") -> OperatorError:
    """The error that tells ``faults`` of the operator ``name``."""
    error = OperatorError(
        f"{name}: " + ", ".join(set_to(key, found) for key, (found, _) in faults.items()),
        ", ".join(f"{key} {told}" for key, (_, told) in faults.items()),
        remedy,
    )
    error.faults = faults
    return error


@cache
def _annotated(kind: type) -> dict[str, tuple[TypeAdapter, str]]:
    """What checks, and what tells, the type of each parameter that has an annotation."""
    hints = typing.get_type_hints(kind)
    return {
        key: (TypeAdapter(hints[key], config=_STRICT), " or ".join(_told(hints[key])))
        for key in inspect.signature(kind).parameters
        if key in hints
    }


def _fits(adapter: TypeAdapter, value: object) -> bool:
    for form in (value, _plain(value)):
        try:
            adapter.validate_python(form)
            return True
        except ValidationError:
            continue
    return False


def _plain(value):
    """Sequences and arrays as tuples, NumPy's numbers as Python's."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, list | tuple | range) else value


def _holds(condition: Callable[..., bool], value: object) -> bool:
    try:
        return condition(value)
    except TypeError:  # it compares with another parameter, of wrong type and told itself
        return True


def _told(annotation, many: bool = False) -> list[str]:
    """The alternatives of an annotation, in words."""
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in _WORDS:
        word = _WORDS[annotation]
        article = "a " if word.endswith("number") else ""
        return [f"{word}s" if many else article + word]
    if origin is tuple and Ellipsis not in inner:
        kinds = " and ".join(dict.fromkeys(word for one in inner for word in _told(one, True)))
        return [f"lists of {len(inner)} {kinds}" if many else f"a list of {len(inner)} {kinds}"]
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return [f"{'lists' if many else 'a list'} of {' or '.join(_told(inner[0], True))}"]
    if origin is typing.Union or origin is UnionType:
        return [word for one in inner for word in _told(one, many)]
    return [getattr(annotation, "__name__", str(annotation))]
