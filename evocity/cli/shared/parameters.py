"""Values of ``--set key=value``, read as TOML."""

import contextlib
import tomllib
from collections.abc import Collection

from evocity.errors import EvocityError

_WORDS = {"none": None, "true": True, "false": False}


def settings_of(settings: tuple[str, ...], texts: Collection[str] = ()) -> dict[str, object]:
    """Read parameters by name from ``KEY=VALUE`` each; those of ``texts`` stay as typed. Raises
    `EvocityError` for anything else."""
    values: dict[str, object] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        key = key.strip()
        if not (equals and key and value.strip()) or key in values:
            raise EvocityError(
                f"--set {setting}, the second of {key}" if key in values else f"--set {setting}",
                "KEY=VALUE, once for each parameter",
                f"write for example --set {key or 'key'}=8; lists 2,3; none for nothing",
            )
        values[key] = value.strip() if key in texts else value_of(value.strip())
    return values


def value_of(text: str) -> object:
    """Read a value as TOML; 2,3 is a list, none is None, and other text is a word.

    Nothing of it is executed.
    """
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    for value in (text, f"[{text}]") if "," in text else (text,):
        with contextlib.suppress(ValueError, RecursionError):  # TOML's own errors are the former
            document = tomllib.loads(f"value = {value}")
            if list(document) == ["value"]:  # else the text holds more than a value
                return document["value"]
    with contextlib.suppress(ValueError):
        return float(text)  # TOML has no .5
    if "," in text and not set(text) & set("[]{}\"'"):
        return [value_of(part.strip()) for part in text.split(",") if part.strip()]
    return text
