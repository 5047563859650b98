"""The one family of errors evocity raises for input at fault.

Every message has three parts: what was found, what was expected, what to do.
"""

import contextlib
import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping


class EvocityError(Exception):
    """Something the user gave cannot be used.

    Parameters
    ----------
    found : what arrived, with its name (file, key, parameter).
    expected : what would have been right.
    remedy : what to do next, one sentence.

    Where these name a parameter they do it by `keyword`, `setting`, `set_to` or `unset`: the
    command line then names its own option in its place. The rest of a text is told as it is.
    """

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found, expected, remedy)  # with its marks, see `keyword`
        self.found, self.expected, self.remedy = map(unmarked, (found, expected, remedy))

    def __str__(self) -> str:
        return f"{self.found}\n  expected: {self.expected}\n  what to do: {self.remedy}"


# A parameter in a text: name, what stands between name and value, value. The characters are none
# of any language, and no text is exchanged with them in it.
_MARK = re.compile("\ufdd0([a-z_]+)\ufdd1([ =]*)\ufdd1([^\ufdd0-\ufdd2]*)\ufdd2")

_STRAY = re.compile("[\ufdd0-\ufdd2]")


def keyword(name: str, *value: object) -> str:
    """A parameter in a text of an `EvocityError`, as a caller of Python types it: ``layer=``, or
    with its value ``pixels=256``."""
    return _marked(name, "=", repr(value[0]) if value else "")


def setting(name: str, value: object) -> str:
    """A parameter and the value that came, in a text of an `EvocityError`: ``block = 3``."""
    return set_to(name, shown(value))


def set_to(name: str, text: str) -> str:
    """`setting` of a value that is text already."""
    return _marked(name, " = ", text)


def unset(name: str) -> str:
    """The value None of a parameter, in a text of an `EvocityError`."""
    return _marked(name, "", "None")


def _marked(name: str, joint: str, value: str) -> str:
    return f"\ufdd0{name}\ufdd1{joint}\ufdd1{_STRAY.sub('', value)}\ufdd2"


def told_by(text: str, parameter: Callable[[str, str, str], str]) -> str:
    """``text`` with what ``parameter`` makes of each one marked in it: of its name, what stands
    between ("=", " = ", or "" for a bare value), and the value as text."""
    return _STRAY.sub("", _MARK.sub(lambda match: parameter(*match.groups()), text))


def unmarked(text: str) -> str:
    """``text`` as Python's callers read it."""
    return told_by(text, lambda name, joint, value: f"{name if joint else ''}{joint}{value}")


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


@contextlib.contextmanager
def blaming(what: str) -> Iterator[None]:
    """Within, an `EvocityError` tells first ``what`` is at fault: a key, a file."""
    try:
        yield
    except EvocityError as error:
        found, expected, remedy = error.args  # with its marks
        raise type(error)(f"{what}: {found}", expected, remedy) from error


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
