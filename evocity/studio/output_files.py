"""Output files of studio: free names, new folders, recipes, and the error of a failed write."""

from collections.abc import Callable
from pathlib import Path

from evocity.errors import EvocityError, RunError, reason_of
from evocity.files import whole_file
from evocity.recipe.reader import read_recipe
from evocity.recipe.recipe import Recipe

_MOST_NAMES = 10_000


def free_path(above: Path, name: str, is_free: Callable[[Path], bool]) -> Path:
    """Return the first free path in a folder, which is made: ``name``, or name and number."""
    try:
        above.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(above, error) from error
    for number in range(1, _MOST_NAMES):
        path = above / (name if number == 1 else f"{name}-{number}")
        if is_free(path):
            return path
    raise RunError(
        f"the folder {above} already has {_MOST_NAMES} numbered folders named {name}",
        f"fewer than {_MOST_NAMES} numbered folders of one name",
        "choose another name",
    )


def make_folder(folder: Path) -> Path:
    try:
        folder.mkdir()
    except OSError as error:
        raise write_error(folder, error) from error
    return folder


def write_recipe(path: Path, text: str) -> Recipe:
    """Write a recipe; read it again, so that a recipe that cannot run raises here."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return read_recipe(path)


def write_error(path: Path, error: Exception) -> EvocityError:
    """Return the `RunError` for a ``path`` that cannot be written; an `EvocityError` as it is."""
    if isinstance(error, EvocityError):
        return error
    return RunError(
        f"{path} cannot be written: {reason_of(error)}",
        "a folder in which you have the right to write, with free space",
        "check the owner of the folder, and the free space on its disk",
    )
