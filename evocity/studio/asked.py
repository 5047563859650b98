"""What requests may ask for: numbers, and JSON of known form. Nothing of it is ever a path."""

import re
from collections.abc import Mapping
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from evocity.errors import EvocityError, shown

#: So long may a number of a request be.
_NUMBER = re.compile(r"-?[0-9]{1,18}", re.ASCII)


Kind = TypeVar("Kind", bound="Body")


class Faulty(EvocityError):
    """A request that asks for nothing there is."""


class Body(BaseModel):
    """What a change says, in JSON: these keys, of these types, and no others."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


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
    """What the ``content`` of a change says. Raises `Faulty`."""
    try:
        return kind.model_validate_json(content)
    except (ValidationError, RecursionError) as error:
        reason = "it is no JSON"
        if isinstance(error, ValidationError):
            first = error.errors(include_url=False, include_input=False)[0]
            reason = f"{'.'.join(map(str, first['loc'])) or 'body'}: {first['msg']}"
        raise Faulty(reason, "what the page sends", "load the page again") from None


__all__ = ["Body", "Faulty", "body_of", "number", "numbers"]
