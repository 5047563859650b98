"""What requests may ask for: numbers, and JSON of known form. Nothing of it is ever a path."""

import re
from collections.abc import Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from evocity.errors import EvocityError, shown

#: So long may a number of a request be.
_NUMBER = re.compile(r"-?[0-9]{1,18}", re.ASCII)


Kind = TypeVar("Kind", bound="Body")


class Faulty(EvocityError):
    """A request that asks for nothing there is."""


class Body(BaseModel):
    """What a change says, in JSON: these keys, of these types, and no others."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def typed(name: str, expected: str, **limits: Any) -> Any:
    """A field of a `Body` that a user types: its ``name`` on the page, what is ``expected`` there,
    in words, and its ``limits``, as pydantic has them."""
    return Field(title=name, description=expected, **limits)


def whole(name: str, low: int, high: int) -> Any:
    """`typed`, a whole number from ``low`` to ``high``."""
    return typed(name, f"a whole number from {low} to {high}", ge=low, le=high)


def number(
    query: Mapping[str, str], name: str, low: int, high: int, usual: int | None = None
) -> int:
    """The number ``name`` of a ``query``, from ``low`` to ``high``; ``usual`` where it is not
    there. Raises `Faulty`."""
    text = query.get(name)
    if text is None and usual is not None:
        return usual
    if text is None or not _NUMBER.fullmatch(text) or not low <= int(text) <= high:
        raise Faulty(f"{name} = {shown(text)}", f"a number, {low} to {high}", "ask for one")
    return int(text)


def numbers(query: Mapping[str, str], name: str, most: int) -> list[int]:
    """Numbers with commas between, each once, in their order; ``most`` of them. Raises `Faulty`."""
    parts = query.get(name, "").split(",")
    right = len(parts) <= most and all(_NUMBER.fullmatch(one) for one in parts)
    if not right:
        raise Faulty(f"{name} = {shown(query.get(name))}", f"1 to {most} numbers", "ask for these")
    return list(dict.fromkeys(map(int, parts)))


def body_of(kind: type[Kind], content: bytes) -> Kind:
    """What the ``content`` of a change says. Raises `Faulty`, which names a field as the page
    does, where a user typed what it cannot have."""
    try:
        return kind.model_validate_json(content)
    except RecursionError:
        reason = "it is no JSON"
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = None if first["type"] == "missing" else _typed(kind, first["loc"])
        if field is not None:
            value = first["input"]
            came = ": nothing was typed" if value is None else f" = {shown(value)}"
            remedy = f"type another at {field.title!r}"
            raise Faulty(f"{field.title}{came}", field.description or "", remedy) from None
        reason = f"{'.'.join(map(str, first['loc'])) or 'body'}: {first['msg']}"
    raise Faulty(reason, "what the page sends", "load the page again")


def _typed(kind: type[Body] | None, place: tuple[int | str, ...]) -> FieldInfo | None:
    """The field at a ``place`` in a body, where a user types it."""
    field = None
    for part in place:
        if isinstance(part, str):
            if kind is None or part not in kind.model_fields:
                break  # it is of pydantic's own
            field = kind.model_fields[part]
            kind = _body_in(field.annotation)
    return field if field is not None and field.title else None


def _body_in(annotation: Any) -> type[Body] | None:
    if isinstance(annotation, type) and issubclass(annotation, Body):
        return annotation
    return next(filter(None, map(_body_in, get_args(annotation))), None)


__all__ = ["Body", "Faulty", "body_of", "number", "numbers", "typed", "whole"]
