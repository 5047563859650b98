"""The one family of errors evocity raises for input at fault.

Every message has three parts: what was found, what was expected, what to do.
"""

import difflib
from collections.abc import Iterable, Mapping


class EvocityError(Exception):
    """Something the user gave cannot be used.

    Parameters
    ----------
    found : what arrived, with its name (file, key, parameter).
    expected : what would have been right.
    remedy : what to do next, one sentence.
    """

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found, expected, remedy)
        self.found, self.expected, self.remedy = found, expected, remedy

    def __str__(self) -> str:
        return f"{self.found}\n  expected: {self.expected}\n  what to do: {self.remedy}"


class MapError(EvocityError):
    """A map, or the file it should be read from, cannot be used."""


class GenomeError(EvocityError):
    """A genome, or a file of one, breaks the bounds of its nucleotides or its schema."""


class OperatorError(EvocityError):
    """A breeding operator got parents or parameters it cannot work with.

    ``faults`` maps each parameter at fault to (what was found, what is allowed).
    """

    faults: Mapping[str, tuple[str, str]] = {}


class FitnessError(EvocityError):
    """A measure is unknown, cannot be loaded, or is declared wrongly."""


class RecipeError(EvocityError):
    """A recipe has faults; the message lists all of them."""


class RunError(EvocityError):
    """A run folder is missing, damaged, in use, or in the way."""


def near_miss(name: str, known: Iterable[str]) -> str:
    """``did you mean X?`` for the one of ``known`` that is most like ``name``, or ""."""
    plain = {one.lower(): one for one in known}
    close = difflib.get_close_matches(name.lower(), plain, 1)
    if len(name) > 2:
        close += [one for one in plain if one.startswith(name.lower())]
    return f"did you mean {plain[close[0]]}?" if close else ""


def told(error: BaseException) -> str:
    """Class and message of an error of foreign code, for a text of ours."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def with_near_miss(found: str, name: str, known: Iterable[str]) -> str:
    """``found``, and what was perhaps meant by ``name``."""
    near = near_miss(name, known)
    return f"{found}, {near}" if near else found


def shown(value: object) -> str:
    """``value`` as it would be typed, cut short."""
    try:
        text = repr(value)
    except ValueError:  # Python writes no number of thousands of digits
        return "a number far too large"
    return text if len(text) < 60 else text[:57] + "…"
