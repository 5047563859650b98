"""Fields of requests: numbers and JSON of a known form; errors as JSON. No field becomes a path."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from evocity.errors import EvocityError, spell

# The longest number of a request.
_NUMBER = re.compile(r"-?[0-9]{1,18}", re.ASCII)

#: The id of a birth.
Id = Annotated[int, Field(ge=0, lt=2**63)]
Kind = TypeVar("Kind", bound="Body")


class RequestError(EvocityError):
    """A request for something that does not exist."""


class Body(BaseModel):
    """The JSON of a request: these keys, of these types, and no others."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def typed_field(name: str, expected: str, **limits: Any) -> Any:
    """Return a field that a user types: its ``name`` on the page, ``expected`` in words,
    ``limits``."""
    return Field(title=name, description=expected, **limits)


def whole_field(name: str, low: int, high: int) -> Any:
    """Return a `typed_field` for a whole number from ``low`` to ``high``."""
    return typed_field(name, f"a whole number from {low} to {high}", ge=low, le=high)


def number(
    query: Mapping[str, str], name: str, low: int, high: int, usual: int | None = None
) -> int:
    """Return the number ``name`` of a ``query``; ``usual`` where it is missing."""
    text = query.get(name)
    if text is None and usual is not None:
        return usual
    if text is None or not _NUMBER.fullmatch(text) or not low <= int(text) <= high:
        raise RequestError(
            f"{name} = {spell(text)} is invalid",
            f"a number from {low} to {high}",
            f"choose a number from {low} to {high}",
        )
    return int(text)


def numbers(query: Mapping[str, str], name: str, most: int) -> list[int]:
    """Return the numbers between commas, in their order, without repeats; at most ``most``."""
    parts = query.get(name, "").split(",")
    if len(parts) > most or not all(_NUMBER.fullmatch(part) for part in parts):
        raise RequestError(
            f"{name} = {spell(query.get(name))} is invalid",
            f"1 to {most} numbers with commas between them",
            f"send 1 to {most} numbers",
        )
    return list(dict.fromkeys(map(int, parts)))


def parse_body(kind: type[Kind], content: bytes) -> Kind:
    """Parse a request. Raises `RequestError`, which names a typed field as the page does."""
    try:
        return kind.model_validate_json(content)
    except RecursionError:
        reason = "the body is not JSON"
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = None if first["type"] == "missing" else _field_at(kind, first["loc"])
        if field is not None:
            value = first["input"]
            given = ": nothing was typed" if value is None else f" = {spell(value)}"
            remedy = f"type another value at {field.title!r}"
            raise RequestError(f"{field.title}{given}", field.description or "", remedy) from None
        reason = f"{'.'.join(map(str, first['loc'])) or 'body'}: {first['msg']}"
    raise RequestError(reason, "the JSON that the page sends", "load the page again")


def _field_at(kind: type[Body] | None, place: tuple[int | str, ...]) -> FieldInfo | None:
    """Return the field at a ``place`` in a body, if a user types it."""
    field = None
    for part in place:
        if isinstance(part, str):
            if kind is None or part not in kind.model_fields:
                break  # a part that pydantic added
            field = kind.model_fields[part]
            kind = _body_in(field.annotation)
    return field if field is not None and field.title else None


def _body_in(annotation: Any) -> type[Body] | None:
    if isinstance(annotation, type) and issubclass(annotation, Body):
        return annotation
    return next(filter(None, map(_body_in, get_args(annotation))), None)


def fault_of(error: EvocityError) -> dict:
    return {"found": error.found, "expected": error.expected, "remedy": error.remedy}
