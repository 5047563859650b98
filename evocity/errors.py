"""The one family of errors evocity raises for input at fault.

Every message has three parts: what was found, what was expected, what to do.
"""

import contextlib
import difflib
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence


class EvocityError(Exception):
    """Something the user gave cannot be used.

    Parameters
    ----------
    found : what arrived, with its name (file, key, parameter).
    expected : what would have been right.
    remedy : what to do next, one sentence.

    Where these name a parameter they do it by `keyword`, `setting`, `set_to` or `unset`: the
    command line then names its own option in its place. The rest of a text is told as it is, but
    for control characters, see `plain_text`. The three have their whole length; the message, which
    is ``str(error)``, has `LONGEST` bytes at most.
    """

    _kept = ""  # control characters that a message may have

    def __init__(self, found: str, expected: str, remedy: str):
        super().__init__(found, expected, remedy)  # with its marks, see `keyword`
        parts = (plain_text(unmarked(part), self._kept) for part in (found, expected, remedy))
        self.found, self.expected, self.remedy = parts

    def __str__(self) -> str:
        parts = (self.found, self.expected, self.remedy)
        found, expected, remedy = _fitted(parts, LONGEST - len(_MESSAGE))
        return _MESSAGE.format(found, expected, remedy)


#: A message is no longer than that, bytes of UTF-8.
LONGEST = 1000

_LONGEST_FAULT = 400
_MESSAGE = "{}\n  expected: {}\n  what to do: {}"


def _fitted(parts: Sequence[str], most: int) -> list[str]:
    """``parts`` of ``most`` bytes together: the longest are cut short."""
    sizes = [len(part.encode()) for part in parts]
    fair, left = most, len(parts)
    for size in sorted(sizes):  # what the short ones leave is shared by the long ones
        if size * left > fair:
            break
        fair, left = fair - size, left - 1
    longest = fair // max(left, 1)
    return [
        part if sum(sizes) <= most or size <= longest else cut_short(part, longest)
        for part, size in zip(parts, sizes, strict=True)
    ]


def cut_short(text: str, most: int) -> str:
    """``text`` in ``most`` bytes of UTF-8: what is longer ends in an ellipsis."""
    content = text[: most + 1].encode()
    if len(content) <= most:
        return text
    return content[: most - 3].decode(errors="ignore") + "…"


# C0 and C1, line and paragraph separators, what turns the direction of text, lone surrogates.
_UNTOLD = re.compile(
    "[\x00-\x1f\x7f-\x9f\u2028\u2029\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def plain_text(text: str, kept: str = "") -> str:
    """``text`` without what a terminal would obey: a space for each tab and end of a line, U+FFFD
    for each other control character, but for those ``kept``."""

    def told(match: re.Match) -> str:
        one = match[0]
        return one if one in kept else " " if one.isspace() else "\ufffd"

    return _UNTOLD.sub(told, text)


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
    """A recipe has faults; ``found`` lists all of them, the message those it has room for."""

    _kept = "\n"

    def __str__(self) -> str:
        return self.listed(LONGEST)

    def listed(self, most: int) -> str:
        """The message with as many faults, a line each, as have room in ``most`` bytes; then how
        many more there are."""
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
        expected, remedy = _fitted((self.expected, self.remedy), most - 700)
        return _MESSAGE.format("\n".join(lines), expected, remedy)


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
    try:
        text = str(error)
    except Exception:  # its own code runs here
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def told_bytes(count: int) -> str:
    """Bytes in words: 4 GB."""
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
    """Raise an ``error`` unless the ``value`` of a parameter is one of the words ``known``; its
    remedy is the word that was perhaps meant, or else what is given."""
    if not (isinstance(value, str) and value in known):
        raise error(
            setting(name, value),
            f"one of {', '.join(known)}",
            near_miss(str(value), known) or remedy,
        )


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
