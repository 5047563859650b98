"""``--set key=value``: what a parameter typed on the command line means."""

import contextlib
import tomllib
from collections.abc import Collection

import click

from evocity.errors import EvocityError


def settings_option(default: str):
    """The option ``--set``; ``default`` says whose parameters stand unless they are set."""
    return click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="KEY=VALUE",
        show_default=default,
        help="A parameter, its value as in TOML; a list does without its outer brackets: 2,3 or "
        "[64,64],[256,256]. Give it once for each.",
    )


_WORDS = {"none": None, "true": True, "false": False}


def settings_of(settings: tuple[str, ...], texts: Collection[str] = ()) -> dict[str, object]:
    """Parameters by name, of ``KEY=VALUE`` each; those of ``texts`` stay as they were typed. Raises
    `EvocityError` for anything else."""
    chosen: dict[str, object] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        key = key.strip()
        if not (equals and key and value.strip()) or key in chosen:
            raise EvocityError(
                f"--set {setting}, the second of {key}" if key in chosen else f"--set {setting}",
                "KEY=VALUE, once for each parameter",
                f"write for example --set {key or 'key'}=8; lists 2,3; none for nothing",
            )
        chosen[key] = value.strip() if key in texts else value_of(value.strip())
    return chosen


def value_of(text: str) -> object:
    """A ``text`` as TOML has it; 2,3 is a list, none is None, and what is no TOML is a word.

    Nothing of it is executed.
    """
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    for value in (text, f"[{text}]") if "," in text else (text,):
        with contextlib.suppress(ValueError, RecursionError):  # TOML's own errors are the former
            document = tomllib.loads(f"value = {value}")
            if list(document) == ["value"]:  # else there was more than a value
                return document["value"]
    with contextlib.suppress(ValueError):
        return float(text)  # TOML writes no .5
    if "," in text and not set(text) & set("[]{}\"'"):
        return [value_of(part.strip()) for part in text.split(",") if part.strip()]
    return text
