"""The base of the sections of a recipe: models that refuse unknown keys, and checks of a value."""

from collections.abc import Callable, Collection
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from evocity.errors import add_near_miss, spell

#: A fault of a recipe: its key, what arrived, and what is allowed.
Fault = tuple[str, str, str]
#: A number that is neither infinite nor NaN; and such a number above 0.
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Section(BaseModel):
    """A part of a recipe: unknown keys and wrong types are faults."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def disagreements(self) -> list[Fault]:
        """List the faults of keys that are valid each by itself but contradict each other."""
        return []


def fault(found: str, allowed: str) -> PydanticCustomError:
    """Make the error of one key, which pydantic collects with the others."""
    details: dict[str, Any] = {"found": found, "allowed": allowed}
    return PydanticCustomError("evocity", "{found}; allowed: {allowed}", details)


def name_in(known: Callable[[], Collection[str]]) -> AfterValidator:
    """Make the check that a text is one of the ``known`` names."""

    def check(name: str) -> str:
        names = known()
        if name not in names:
            raise fault(add_near_miss(spell(name), name, names), " or ".join(map(spell, names)))
        return name

    return AfterValidator(check)


def text_for(read: Callable[[str], Any], allowed: str) -> AfterValidator:
    """Make the check that ``read`` understands a text: it raises ValueError for others."""

    def check(text: str) -> str:
        try:
            read(text)
        except (ValueError, OverflowError, OSError):
            raise fault(spell(text), allowed) from None
        return text

    return AfterValidator(check)
