"""Reading recipes: from a TOML file, or the name of a bundled recipe, to a valid `Recipe`."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evocity.bounded_toml import MOST_BYTES, LimitError, parse_toml
from evocity.errors import RecipeError, cut_short, near_miss, plain_text, reason_of
from evocity.recipe.recipe import Recipe
from evocity.recipe.validation import fill_from_toml

_BUNDLED = Path(__file__).parent.parent / "data" / "recipes"


def recipes() -> list[str]:
    """List the names of the recipes that are part of evocity."""
    return sorted(path.stem for path in _BUNDLED.glob("*.toml"))


def _correction(text: str, error: tomllib.TOMLDecodeError) -> str:
    match, lines = re.search(r"at line (\d+)", str(error)), text.splitlines()
    if match is None or int(match[1]) > len(lines):
        return "correct the end of the file"
    line = lines[int(match[1]) - 1].strip()
    point = "; numbers have a point, as in 1.2" if re.search(r"=\s*[-+]?\d+,\d", line) else ""
    return f"correct that line: {cut_short(plain_text(line), 80)}{point}"


def _neighbours(path: Path) -> list[str]:
    try:
        return [one.name for one in path.parent.glob("*.toml")]
    except OSError:
        return []


def read_recipe(source: str | os.PathLike = "demo", **overrides: int | str | None) -> Recipe:
    """Read a recipe from a TOML file, and check it.

    Parameters
    ----------
    source : path to a TOML file, or name of a bundled recipe (see `recipes`).
    overrides : new values for the recipe's keys ``generations``, ``population``, ``seed``,
        ``workers`` and ``cluster``, and for the key ``until`` of the section ``[stop]``. An
        override with the value None leaves the recipe's value unchanged.

    Raises
    ------
    RecipeError : the recipe has faults. The message of the error lists every fault with its key,
        the value that arrived, and the values that are allowed.

    Reading a recipe executes the files of the user's own measures that the recipe names.
    """
    path = Path(source)
    if os.fspath(source) in recipes() and not path.is_file():
        path = _BUNDLED / f"{source}.toml"
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode(errors="replace" if len(content) > MOST_BYTES else "strict")
    except UnicodeDecodeError:
        raise RecipeError(
            f"{path} is not text in UTF-8", "a TOML file in UTF-8", "save the file as UTF-8"
        ) from None
    except OSError as error:
        raise RecipeError(
            f"the recipe {path} cannot be read: {reason_of(error)}",
            f"a TOML file, or a bundled recipe: {', '.join(recipes())}",
            near_miss(path.name, [*recipes(), *_neighbours(path)]) or "check the path",
        ) from None
    sections = {"workers": "evaluation", "cluster": "evaluation", "until": "stop"}
    changes = {
        f"{sections.get(key, 'run')}.{key}": value
        for key, value in overrides.items()
        if value is not None
    }
    recipe = recipe_of(text, path.parent.resolve(), changes, name=str(path))
    recipe._file = path.name if path.is_file() else None  # a pipe cannot be read again
    return recipe


def recipe_of(
    text: str,
    folder: Path,
    overrides: Mapping[str, Any],
    name: str,
    kept: Mapping[str, str] | None = None,
    defaults: Mapping[str, Any] | None = None,
) -> Recipe:
    """Read the recipe in ``text``; its paths are relative to ``folder``, messages call it ``name``.

    ``overrides`` map keys such as "run.seed" to values. ``kept``, only for a resumed run, whose
    maps need not exist, maps files of measures to the files to execute in their place. ``defaults``
    map keys, or sections, to the values that an older release used for missing ones.
    """
    try:
        raw = parse_toml(text)
    except LimitError as error:
        raise RecipeError(f"{name}: {error}", error.expected, error.remedy) from None
    except tomllib.TOMLDecodeError as error:
        raise RecipeError(
            f"{name} is not valid TOML: {error}",
            "a file in the format TOML",
            _correction(text, error),
        ) from None
    except ValueError:  # its own text is about Python
        raise RecipeError(
            f"{name} contains a number with thousands of digits",
            "numbers with fewer digits",
            "shorten the long number",
        ) from None
    recipe = Recipe.__new__(Recipe)
    fill_from_toml(recipe, raw, text, folder, overrides, name, kept, defaults)
    return recipe
