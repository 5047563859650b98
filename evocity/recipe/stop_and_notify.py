"""Sections of a recipe on unattended runs: ``[stop]``, ``[notify]`` and ``[log]``."""

import re
import shlex
from collections.abc import Mapping
from datetime import datetime, time, timedelta
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from evocity.errors import add_near_miss, spell
from evocity.recipe.search_section import bytes_of
from evocity.section import Finite, Positive, Section, fault, text_for
from evocity.store import GENOMES

_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}))?", re.ASCII)

#: The placeholders of commands in ``[notify]``, written in braces.
PLACEHOLDERS = ("run", "event", "generation", "births", "hypervolume", "best", "reason")
_PLACEHOLDER = re.compile(r"\{([A-Za-z_]+)\}")


def moment_of(text: str, now: datetime | None = None) -> datetime | None:
    """Read the moment that ``until`` names: a time of the day means the next one after ``now``, the
    present unless given. Dates without a time zone are of this machine's. None for "none". Raises
    ValueError for anything else, OverflowError and OSError for dates that no clock has."""
    text, now = text.strip(), now or datetime.now().astimezone()
    if text == "none":
        return None
    if match := _CLOCK.fullmatch(text):
        clock, today = time(*(int(part or 0) for part in match.groups())), now.astimezone().date()
        moments = (datetime.combine(day, clock) for day in (today, today + timedelta(days=1)))
        return next(one for one in map(datetime.astimezone, moments) if one > now)
    if not re.search("[T ]", text):
        raise ValueError(text)
    return datetime.fromisoformat(text).astimezone()


def _write_toml_date(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime | time) else value


class StopSection(Section):
    """``[stop]``: the rules that end a run before its last generation.

    ``until``: a time of the day, or a date with a time. ``target``: measure -> value; one of the
    living must reach all of them and keep all constraints. ``stagnation``: generations without
    progress. ``disk``: size of the run folder.
    """

    until: (
        Annotated[
            str,
            BeforeValidator(_write_toml_date),
            text_for(
                moment_of, '"07:00", a date with a time such as "2026-11-25T07:00", or "none"'
            ),
        ]
        | None
    ) = None
    target: dict[str, Finite] = Field({})
    stagnation: int | None = Field(None, ge=1, le=99_999_999)
    disk: (
        Annotated[str, text_for(bytes_of, 'a size such as "500 MB", "10 GB" or "none"')] | None
    ) = None

    @property
    def disk_bytes(self) -> int | None:
        """``disk`` in bytes; None without one."""
        return None if self.disk is None else bytes_of(self.disk)


class LogSection(Section):
    """``[log]``. ``genomes``: the births whose genomes the log holds, see
    `evocity.search.breeding.omitted_genomes`."""

    genomes: Literal[GENOMES] = "all"


def _check_command(text: str) -> str:
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise fault(
            f"{spell(text)} cannot be split into words ({error})",
            "a command and its arguments, with quotes as in a shell",
        ) from None
    if not words or "\0" in text:
        raise fault(spell(text), "a command: a program and its arguments")
    for name in _PLACEHOLDER.findall(text):
        if name not in PLACEHOLDERS:
            known = [f"{{{one}}}" for one in PLACEHOLDERS]
            found = add_near_miss(f"{{{name}}}", f"{{{name}}}", known)
            raise fault(found, f"{', '.join(known)}; braces around one word have no other use")
    return text


_CommandText = Annotated[str, AfterValidator(_check_command)]


class NotifySection(Section):
    """``[notify]``: the user's commands that run when the search improves and when it ends; each
    may take ``timeout`` seconds. See `evocity.search.steering.notification`."""

    on_improvement: _CommandText | None = None
    on_end: _CommandText | None = None
    timeout: Positive = 60.0

    @property
    def commands(self) -> dict[str, str]:
        """The commands that there are, by their keys."""
        return self.model_dump(include={"on_improvement", "on_end"}, exclude_none=True)


def words_of(command: str, values: Mapping[str, str]) -> list[str]:
    """Split a ``command`` into words and put ``values`` in place of its placeholders. The values
    are neither split nor searched for placeholders."""
    return [
        _PLACEHOLDER.sub(lambda match: values.get(match[1], match[0]).replace("\0", " "), word)
        for word in shlex.split(command)
    ]
