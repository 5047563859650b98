"""What tables of limits have in common: TOML, and numbers that may be one."""

import tomllib
from numbers import Real


def parsed(text: str | bytes, what: str, fault: type[Exception]) -> dict:
    """The TOML document ``text``, a table of ``what``. Raises ``fault`` (found, expected, remedy)
    where it is none."""
    try:
        return tomllib.loads(text if isinstance(text, str) else text.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        found = f"no TOML: {error}"
    except ValueError:  # the text of it speaks of Python
        found = "a number of thousands of digits"
    except RecursionError:
        found = "TOML with lists or tables too deep in each other"
    raise fault(found, f"a table of {what} in TOML", "correct that place") from None


def is_number(value: object) -> bool:
    """Whether ``value`` is a number, 0 or more, that a float holds; infinity is one."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return float(value) >= 0  # NaN is none
    except OverflowError:
        return False


__all__ = ["is_number", "parsed"]
