"""Errors for faulty input, and the texts of their messages.

Every message has three parts: what arrived, what was expected, what to do.
"""

import contextlib
import difflib
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from numbers import Integral, Real
from typing import Any


class EvocityError(Exception):
    """Error that is caused by the user's input.

    Parameters
    ----------
    found : description of the wrong input, with the name of the file, key or parameter.
    expected : description of correct input.
    remedy : advice on how to correct the input, in one sentence.

    To name a parameter in the text of an error, use one of the functions `keyword`, `setting`,
    `text_setting` and `none_setting`. If an error names the parameter `way`, for example, the
    command line prints the option --way instead. The error removes control characters from the
    texts `found`, `expected` and `remedy`. The three texts of an error may have any length, but the
    message ``str(error)`` has at most `LONGEST` bytes.
    """

    _kept = ""  # control characters that a message keeps

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found, expected, remedy)  # with their marks, see `keyword`
        parts = (plain_text(strip_marks(part), self._kept) for part in (found, expected, remedy))
        self.found, self.expected, self.remedy = parts

    def __str__(self) -> str:
        parts = (self.found, self.expected, self.remedy)
        found, expected, remedy = _fit(parts, LONGEST - len(_MESSAGE))
        return _MESSAGE.format(found, expected, remedy)


#: The longest message, bytes of UTF-8.
LONGEST = 1000

_LONGEST_FAULT = 400
_MESSAGE = "{}\n  expected: {}\n  what to do: {}"


def _fit(parts: Sequence[str], most: int) -> list[str]:
    """``parts`` of at most ``most`` bytes together: the longest are cut short."""
    sizes = [len(part.encode()) for part in parts]
    fair, left = most, len(parts)
    for size in sorted(sizes):  # the long ones share the room that the short ones leave
        if size * left > fair:
            break
        fair, left = fair - size, left - 1
    longest = fair // max(left, 1)
    return [
        part if sum(sizes) <= most or size <= longest else cut_short(part, longest)
        for part, size in zip(parts, sizes, strict=True)
    ]


def cut_short(text: str, most: int) -> str:
    """Cut a ``text`` to at most ``most`` bytes of UTF-8, with an ellipsis at its end."""
    content = text[: most + 1].encode()
    if len(content) <= most:
        return text
    return content[: most - 3].decode(errors="ignore") + "…"


# C0 and C1, line and paragraph separators, marks of the direction of text, lone surrogates.
_CONTROL = re.compile(
    "[\x00-\x1f\x7f-\x9f\u2028\u2029\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def plain_text(text: str, kept: str = "") -> str:
    """Replace control characters except those ``kept``, by spaces or U+FFFD."""

    def replace(match: re.Match) -> str:
        character = match[0]
        return character if character in kept else " " if character.isspace() else "\ufffd"

    return _CONTROL.sub(replace, text)


# A parameter in a text: its name, a joint, its value. Unicode reserves the characters for internal
# use: no text of a file or a user has them.
_MARK = re.compile("\ufdd0([a-z_]+)\ufdd1([ =]*)\ufdd1([^\ufdd0-\ufdd2]*)\ufdd2")

_STRAY = re.compile("[\ufdd0-\ufdd2]")


def keyword(name: str, *value: object) -> str:
    """Name a parameter in an `EvocityError` as Python's callers type it: ``layer=``,
    ``pixels=256``."""
    return _mark(name, "=", repr(value[0]) if value else "")


def setting(name: str, value: object) -> str:
    """Name a parameter and the value that arrived in an `EvocityError`: ``block = 3``."""
    return text_setting(name, spell(value))


def text_setting(name: str, text: str) -> str:
    """Write a `setting` whose value is text already."""
    return _mark(name, " = ", text)


def none_setting(name: str) -> str:
    """Name the value None of a parameter, in a text of an `EvocityError`."""
    return _mark(name, "", "None")


def _mark(name: str, joint: str, value: str) -> str:
    return f"\ufdd0{name}\ufdd1{joint}\ufdd1{_STRAY.sub('', value)}\ufdd2"


def replace_parameters(text: str, parameter: Callable[[str, str, str], str]) -> str:
    """Replace marked parameters in a ``text`` by ``parameter(name, joint, value)``, all texts."""
    return _STRAY.sub("", _MARK.sub(lambda match: parameter(*match.groups()), text))


def strip_marks(text: str) -> str:
    """Return a ``text`` as callers of Python read it."""
    return replace_parameters(
        text, lambda name, joint, value: f"{name if joint else ''}{joint}{value}"
    )


class MapError(EvocityError):
    """A map, or its file, is unusable."""


class GenomeError(EvocityError):
    """A genome, or its file, violates its schema or the bounds of its nucleotides."""


class OperatorError(EvocityError):
    """The parents or parameters of a breeding operator are unusable.

    ``faults`` maps each faulty parameter to (what arrived, what is allowed).
    """

    faults: Mapping[str, tuple[str, str]] = {}


class FitnessError(EvocityError):
    """A measure is unknown, cannot be loaded, or has a wrong declaration."""


class RecipeError(EvocityError):
    """A recipe has faults; ``found`` lists all of them, the message as many as it has room for."""

    _kept = "\n"

    def __str__(self) -> str:
        return self.list_faults(LONGEST)

    def list_faults(self, most: int) -> str:
        """Return the message in ``most`` bytes, with a line per fault, and the number left out."""
        room = most - 60 - sum(len(part.encode()) for part in (self.expected, self.remedy))
        if len(self.found.encode()) <= room:
            return _MESSAGE.format(self.found, self.expected, self.remedy)
        head, *faults = self.found.split("\n")
        lines = [cut_short(head, 200)]
        for number, fault in enumerate(faults):
            fault = cut_short(fault, _LONGEST_FAULT)
            room -= len(fault.encode()) + 1
            if room < 200 and number:
                lines.append(f"  and {len(faults) - number} more")
                break
            lines.append(fault)
        expected, remedy = _fit((self.expected, self.remedy), most - 700)
        return _MESSAGE.format("\n".join(lines), expected, remedy)


class RunError(EvocityError):
    """A run folder is missing, damaged, in use, or exists already."""


@contextlib.contextmanager
def blame(what: str) -> Iterator[None]:
    """Put ``what`` is at fault, a key or a file, before the text of every `EvocityError` within."""
    try:
        yield
    except EvocityError as error:
        found, expected, remedy = error.args  # with their marks
        raise type(error)(f"{what}: {found}", expected, remedy) from error


def near_miss(name: str, known: Iterable[str]) -> str:
    """Return ``did you mean X?`` with the most similar word of ``known``, or ""."""
    plain = {word.lower(): word for word in known}
    close = difflib.get_close_matches(name.lower(), plain, 1)
    if len(name) > 2:
        close += [word for word in plain if word.startswith(name.lower())]
    return f"did you mean {plain[close[0]]}?" if close else ""


def describe_error(error: BaseException) -> str:
    """Write the class and the message of an error of foreign code."""
    try:
        text = str(error)
    except Exception:  # foreign code runs here
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def reason_of(error: BaseException) -> str:
    """Say why the operating system refused: its own words for an ``error``, else the message."""
    return str(getattr(error, "strerror", None) or error)


def format_bytes(count: int) -> str:
    """Write a number of bytes with a unit: 4 GB."""
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def check_word(
    name: str,
    value: object,
    known: Collection[str],
    remedy: str = "choose one",
    error: type[EvocityError] = EvocityError,
) -> None:
    """Raise an ``error`` unless ``value`` is one of ``known``; it suggests the nearest, or
    ``remedy``."""
    if not (isinstance(value, str) and value in known):
        raise error(
            setting(name, value),
            f"one of {', '.join(known)}",
            near_miss(str(value), known) or remedy,
        )


def check_number(
    name: str,
    value: Any,
    low: float,
    high: float,
    expected: str,
    error: type[EvocityError] = EvocityError,
    remedy: str = "",
    whole: bool = False,
) -> None:
    """Raise an ``error`` unless the ``value`` of a parameter is a finite number, or a ``whole``
    one, from ``low`` to ``high``."""
    right = is_whole(value) if whole else is_number(value)
    if not (right and low <= value <= high and abs(value) != math.inf):
        remedy = remedy or f"correct {keyword(name)}, or leave it out"
        raise error(f"{setting(name, value)} is invalid", expected, remedy)


def is_number(value: Any) -> bool:
    """Whether ``value`` is a real number; a bool is not a number."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_whole(value: Any, least: float = -math.inf) -> bool:
    """Whether ``value`` is a whole number of ``least`` or more; a bool is not a number."""
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    return whole and int(value) >= least


def add_near_miss(found: str, name: str, known: Iterable[str]) -> str:
    """Append the word of ``known`` that is most similar to ``name``, if any is."""
    near = near_miss(name, known)
    return f"{found}, {near}" if near else found


def spell(value: object) -> str:
    """Write a ``value`` as a user types it, cut short."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write thousands of digits
        return "a number far too large"
    return text if len(text) < 60 else text[:57] + "…"
