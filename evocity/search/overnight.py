"""What a recipe says of a run that goes on by itself: when it stops, who is told, what is kept."""

import re
import shlex
from collections.abc import Mapping
from datetime import datetime, time, timedelta
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from evocity.errors import shown, with_near_miss
from evocity.search.searching import bytes_of
from evocity.search.values import Finite, Positive, Section, fault
from evocity.store import GENOMES

_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}))?", re.ASCII)

#: What commands of ``[notify]`` may say of the moment, in braces.
PLACEHOLDERS = ("run", "event", "generation", "births", "hypervolume", "best", "reason")
_PLACEHOLDER = re.compile(r"\{([A-Za-z_]+)\}")


def moment_of(text: str, now: datetime) -> datetime | None:
    """The moment that ``until`` names: of a time of the day the next one after ``now``, else a date
    with a time; of this machine's time zone unless it has its own. None for "none". Raises
    ValueError for anything else."""
    text = text.strip()
    if text == "none":
        return None
    if found := _CLOCK.fullmatch(text):
        wanted, today = time(*(int(part or 0) for part in found.groups())), now.astimezone().date()
        moments = (datetime.combine(day, wanted) for day in (today, today + timedelta(days=1)))
        return next(one for one in map(datetime.astimezone, moments) if one > now)
    if not re.search("[T ]", text):
        raise ValueError(text)
    return datetime.fromisoformat(text).astimezone()


def _told(value: Any) -> Any:
    """TOML has times and dates of its own."""
    return value.isoformat() if isinstance(value, datetime | time) else value


def _some_moment(text: str) -> str:
    try:
        moment_of(text, datetime.now().astimezone())
    except (ValueError, OverflowError, OSError):
        allowed = '"07:00", a date with a time such as "2026-11-25T07:00", or "none"'
        raise fault(shown(text), allowed) from None
    return text


def _some_size(text: str) -> str:
    try:
        bytes_of(text)
    except ValueError:
        raise fault(shown(text), 'a size such as "500 MB", "10 GB" or "none"') from None
    return text


class StopSection(Section):
    """``[stop]``: what ends a run before its last generation, looked at after each whole one.

    ``until``: a time of the day, or a date with a time. ``target``: measure -> value that one of
    the living which keeps all constraints has reached in all of them. ``stagnation``: generations
    without progress. ``disk``: size of the run folder.
    """

    until: Annotated[str, BeforeValidator(_told), AfterValidator(_some_moment)] | None = None
    target: dict[str, Finite] = Field({})
    stagnation: int | None = Field(None, ge=1, le=99_999_999)
    disk: Annotated[str, AfterValidator(_some_size)] | None = None

    @property
    def disk_bytes(self) -> int | None:
        """``disk`` in bytes; None without one."""
        return None if self.disk is None else bytes_of(self.disk)


class LogSection(Section):
    """``[log]``. ``genomes``: of which births the log holds the genomes, see
    `evocity.search.leaving`."""

    genomes: Literal[GENOMES] = "all"


def _some_command(text: str) -> str:
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise fault(f"{shown(text)} ({error})", "words, quoted as in a shell") from None
    if not words or "\0" in text:
        raise fault(shown(text), "a command: a program and what it is told")
    for name in _PLACEHOLDER.findall(text):
        if name not in PLACEHOLDERS:
            known = [f"{{{one}}}" for one in PLACEHOLDERS]
            found = with_near_miss(f"{{{name}}}", f"{{{name}}}", known)
            raise fault(found, f"{', '.join(known)}; braces around one word have no other use")
    return text


_CommandText = Annotated[str, AfterValidator(_some_command)]


class NotifySection(Section):
    """``[notify]``: commands of the user's that are run when the search gets better and when it
    ends; each may take ``timeout`` seconds. See `evocity.search.notifying`."""

    on_improvement: _CommandText | None = None
    on_end: _CommandText | None = None
    timeout: Positive = 60.0

    @property
    def commands(self) -> dict[str, str]:
        """The commands that there are, by their keys."""
        told = {"on_improvement": self.on_improvement, "on_end": self.on_end}
        return {key: one for key, one in told.items() if one is not None}


def words_of(command: str, told: Mapping[str, str]) -> list[str]:
    """The words of a ``command`` with what is ``told`` in place of its placeholders. What takes
    their place is never parted, nor read again."""
    return [
        _PLACEHOLDER.sub(lambda match: told.get(match[1], match[0]).replace("\0", " "), word)
        for word in shlex.split(command)
    ]


__all__ = ["PLACEHOLDERS", "LogSection", "NotifySection", "StopSection", "moment_of", "words_of"]
