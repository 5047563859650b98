"""Checks of operators' parameters: types by annotations, values by conditions; shares."""

import inspect
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import NoneType, UnionType
from typing import Any

import numpy as np
from pydantic import ConfigDict, TypeAdapter, ValidationError

from evocity.citymap import MAX_SIDE
from evocity.errors import OperatorError, spell, text_setting

#: Parameter -> (the value that came, the allowed values).
Faults = dict[str, tuple[str, str]]
#: A condition of a parameter's value, and the allowed values in words.
Check = tuple[Callable[..., bool], str]

#: The check of a share.
SHARE: Check = (lambda share: 0 <= share <= 1, "0…1")
#: The largest size, metres.
MOST_METRES = 1e7

_STRICT = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
_WORDS = {
    str: "text",
    int: "whole number",
    float: "finite number",
    bool: "true or false",
    NoneType: "none",
}


def wrong_types(kind: type, parameters: Mapping[str, object]) -> Faults:
    """List the faults of those ``parameters`` that break the annotations of ``kind``.

    Whole numbers count as numbers; lists, tuples, ranges and arrays are equivalent. No other type
    replaces another.
    """
    return {
        key: (spell(parameters[key]), allowed)
        for key, (adapter, allowed) in _annotations(kind).items()
        if key in parameters and not _fits(adapter, parameters[key])
    }


def number_of(kind: type, key: str) -> type[int] | type[float] | None:
    """Return the type of numbers that a parameter takes: float for any, int for whole numbers, None
    for none. Without an annotation its default decides, or any number passes."""
    annotated = _annotations(kind).get(key)
    if annotated is None:
        default = inspect.signature(kind).parameters[key].default
        return {int: int, bool: None, str: None}.get(type(default), float)
    fits = (number for number, example in ((float, 0.5), (int, 1)) if _fits(annotated[0], example))
    return next(fits, None)


def check_parameters(operator, allowed: Mapping[str, Check]) -> None:
    """Raise one `OperatorError` with every parameter of wrong type or value; for ``__post_init__``.

    ``allowed`` maps a parameter to its `Check`; checks of parameters that the operator lacks do not
    matter. Conditions see values of the right type, and Python's numbers in place of NumPy's.
    """
    parameters = vars(operator)
    for key, value in list(parameters.items()):
        if isinstance(value, np.ndarray | np.generic):
            object.__setattr__(operator, key, _plain(value))
    faults = wrong_types(type(operator), parameters)
    for key, (holds, words) in allowed.items():
        if key in parameters and key not in faults and not _holds(holds, parameters[key]):
            faults[key] = spell(parameters[key]), words
    if faults:
        raise at_fault(operator.name, faults)


def check_generator(name: str, rng: np.random.Generator) -> None:
    """Raise `OperatorError`, in the name of an operator, unless ``rng`` is a generator."""
    if not isinstance(rng, np.random.Generator):
        raise OperatorError(
            f"{name}: rng = {spell(rng)} is not a random generator",
            "a NumPy Generator",
            "pass rng=numpy.random.default_rng(seed)",
        )


def check_parents(
    operator,
    parents: Sequence,
    rng: np.random.Generator,
    of: str,
    suits: Callable[[Any], bool],
    remedy: str,
) -> None:
    """Raise `OperatorError` unless ``rng`` is a generator, and ``parents`` is a list of as many
    individuals as the ``operator`` takes, all of which it ``suits``.

    of : the kind of individuals, in one word.
    remedy : what to do about parents of another type.
    """
    name, (fewest, most) = operator.name, operator.parents
    check_generator(name, rng)
    if not isinstance(parents, Sequence):
        raise OperatorError(
            f"{name}: the parameter 'parents' is not a list but a {type(parents).__name__}",
            f"a list of {of}s",
            f"put the {of}s in square brackets",
        )
    if len(parents) < fewest or len(parents) > (most or len(parents)):
        several = f"{fewest} to {most}" if most else f"{fewest} or more"
        number = f"{fewest}" if most == fewest else several
        raise OperatorError(
            f"{name} received {len(parents)} parents",
            f"a list of {number} parents",
            f"pass a list of {number} {of}s",
        )
    strange = [type(parent).__name__ for parent in parents if not suits(parent)]
    if strange:
        raise OperatorError(
            f"{name}: the parents have the type {', '.join(strange)}",
            f"parents that are {of}s",
            remedy,
        )


def repair_checks() -> dict[str, Check]:
    """Return the checks of the three repair parameters that every operator has."""
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
    """Make the error that lists ``faults`` of the operator ``name``."""
    error = OperatorError(
        f"{name}: " + ", ".join(text_setting(key, found) for key, (found, _) in faults.items()),
        ", ".join(f"{key} {allowed}" for key, (_, allowed) in faults.items()),
        remedy,
    )
    error.faults = faults
    return error


def are_shares(fill: float | Sequence[float] | None) -> bool:
    """Tell whether ``fill`` is None, a share (0…1) or a list of shares."""
    if fill is None:
        return True
    shares = fill if isinstance(fill, Sequence) else [fill]
    return len(shares) > 0 and all(0 <= share <= 1 for share in shares)


#: The check of ``fill``, the shares of the parents.
FILL: Check = (are_shares, "0…1, or a list of such shares")


def shares_of(
    name: str, fill: float | Sequence[float] | None, count: int, void: bool = False
) -> np.ndarray:
    """Compute the share of each of ``count`` parents, then of the void if it takes part; their sum
    is 1.

    ``fill`` is the share of the second of two, or a share for each parent, or None for equal
    shares. Raises `OperatorError`, in the name of the operator, for another number of shares.
    """
    total = count + void
    if fill is None:
        return np.full(total, 1 / total)
    shares = np.atleast_1d(np.asarray(fill, float))
    if shares.size == 1 and total == 2:
        shares = np.array([1 - shares[0], shares[0]])
    if shares.size != total or abs(shares.sum() - 1) >= 1e-6:
        also = " and the void" if void else ""
        allowed = f"one share for each of {count} parents{also}, summing to 1"
        raise at_fault(name, {"fill": (spell(fill), allowed)})
    return shares


def fill_report(shares: np.ndarray, owner: np.ndarray) -> dict[str, list[float]]:
    """Report the ``shares`` aimed at, and those in the cells of ``owner`` (the parent of each)."""
    reached = np.bincount(owner.ravel(), minlength=len(shares)) / owner.size
    return {
        "fill": [round(float(share), 4) for share in shares],
        "fill_reached": [round(float(share), 4) for share in reached],
    }


@cache
def _annotations(kind: type) -> dict[str, tuple[TypeAdapter, str]]:
    """Collect for each annotated parameter its type's adapter, and the type in words."""
    hints = typing.get_type_hints(kind)
    return {
        key: (TypeAdapter(hints[key], config=_STRICT), " or ".join(_words(hints[key])))
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
    """Convert sequences and arrays to tuples, NumPy's numbers to Python's."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return tuple(map(_plain, value)) if isinstance(value, list | tuple | range) else value


def _holds(condition: Callable[..., bool], value: object) -> bool:
    try:
        return condition(value)
    except (
        TypeError
    ):  # the condition reads another parameter of wrong type, which has its own fault
        return True


def _words(annotation, many: bool = False) -> list[str]:
    """Describe the alternatives of an annotation."""
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in _WORDS:
        word = _WORDS[annotation]
        article = "a " if word.endswith("number") else ""
        return [f"{word}s" if many else article + word]
    if origin is tuple and Ellipsis not in inner:
        kinds = " and ".join(dict.fromkeys(word for hint in inner for word in _words(hint, True)))
        return [f"lists of {len(inner)} {kinds}" if many else f"a list of {len(inner)} {kinds}"]
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return [f"{'lists' if many else 'a list'} of {' or '.join(_words(inner[0], True))}"]
    if origin is typing.Union or origin is UnionType:
        return [word for hint in inner for word in _words(hint, many)]
    return [getattr(annotation, "__name__", str(annotation))]
