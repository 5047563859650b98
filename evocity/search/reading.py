"""From a TOML file, or the name of a bundled demonstration, to a `Recipe` without faults."""

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evocity.errors import RecipeError, cut_short, near_miss, plain_text
from evocity.search.checking import check
from evocity.search.recipe import Recipe

_BUNDLED = Path(__file__).parent.parent / "data" / "recipes"


def recipes() -> list[str]:
    """Names of the bundled recipes."""
    return sorted(path.stem for path in _BUNDLED.glob("*.toml"))


def _correct(text: str, error: tomllib.TOMLDecodeError) -> str:
    """What to do about the line of a recipe's ``text`` that an ``error`` names."""
    told, lines = re.search(r"at line (\d+)", str(error)), text.splitlines()
    if told is None or int(told[1]) > len(lines):
        return "correct the end of it"
    line = lines[int(told[1]) - 1].strip()
    point = "; numbers have a point, as in 1.2" if re.search(r"=\s*[-+]?\d+,\d", line) else ""
    return f"correct that line: {cut_short(plain_text(line), 80)}{point}"


def _beside(path: Path) -> list[str]:
    """Names of the TOML files in the folder of ``path``."""
    try:
        return [one.name for one in path.parent.glob("*.toml")]
    except OSError:
        return []


def read_recipe(source: str | os.PathLike = "demo", **overrides: int | str | None) -> Recipe:
    """Read and check a recipe.

    Parameters
    ----------
    source : a path to a TOML file, or the name of a bundled recipe (see `recipes`).
    overrides : ``generations``, ``population``, ``seed``, ``workers``, ``cluster``, ``until``
        of ``[stop]``; None leaves the recipe's own.

    Raises
    ------
    RecipeError : lists every fault with its key, what was found and what is allowed.

    A user's own measures named in the recipe are loaded, that is: their file is executed.
    """
    path = Path(source)
    if os.fspath(source) in recipes() and not path.is_file():
        path = _BUNDLED / f"{source}.toml"
    try:
        text = path.read_bytes().decode()
    except UnicodeDecodeError:
        raise RecipeError(
            f"{path} is not text in UTF-8", "a TOML file", "save it as UTF-8"
        ) from None
    except OSError as error:
        raise RecipeError(
            f"no recipe can be read at {path}: {error.strerror}",
            f"a TOML file, or a bundled one: {', '.join(recipes())}",
            near_miss(path.name, [*recipes(), *_beside(path)]) or "check the path",
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
    """The recipe in ``text``, whose paths are relative to ``folder``; ``name`` for messages.

    ``overrides`` map keys such as "run.seed" to values that replace the recipe's. ``kept``, for a
    run that is taken up again: files of measures -> those to be executed in their place; the maps
    need not be there any more, the run has its own. ``defaults`` map keys, or whole sections, to
    what an older release took where the recipe says nothing.
    """
    try:
        raw = tomllib.loads(text)
    except RecursionError:
        raise RecipeError(
            f"{name} is nested too deeply",
            "a TOML file",
            "put lists in lists only where a key takes them",
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise RecipeError(
            f"{name} is not TOML: {error}", "a TOML file", _correct(text, error)
        ) from None
    except ValueError:  # the text of it speaks of Python
        raise RecipeError(
            f"{name} holds a number of thousands of digits", "numbers of use", "shorten it"
        ) from None
    recipe = Recipe.__new__(Recipe)
    check(recipe, raw, text, folder, overrides, name, kept, defaults)
    return recipe
