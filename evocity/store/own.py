"""The user's own measures in a run folder: the text of their files, so that a run can be moved and
taken up again elsewhere. Nothing here executes them."""

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from evocity.errors import RunError
from evocity.files import whole_file
from evocity.store.parts import plain_file, plain_folder

#: The folder of a run that they lie in.
OWN = "fitness"


def write_own(root: Path, files: Mapping[str, bytes]) -> None:
    """Write each of ``files``, place within the run folder ``root`` -> content, whole."""
    for place, content in files.items():
        path = _within(root, place)
        path.parent.mkdir(parents=True, exist_ok=True)
        for folder in path.relative_to(root).parents:
            plain_folder(root / folder)
        with whole_file(path) as temporary:
            temporary.write_bytes(content)


def own_file(root: Path, place: str) -> Path:
    """The file at a ``place`` such as "fitness/my_measure.py" of the run folder ``root``.

    Raises FileNotFoundError if it is not there; `RunError` for a place outside the folder of the
    user's own measures, or where a link leads there.
    """
    path = _within(root, place)
    for folder in list(path.relative_to(root).parents)[-2::-1]:  # from the outermost inwards
        plain_folder(root / folder)
    return plain_file(path)


def _within(root: Path, place: str) -> Path:
    parts = PurePosixPath(place).parts if isinstance(place, str) else ()
    if len(parts) < 2 or parts[0] != OWN or ".." in parts or "\\" in place:
        raise RunError(
            f"{root}: {place!r} as the place of a measure's source",
            f"a file in {OWN}/ of the run folder",
            "bring provenance.json back from a copy",
        )
    return root.joinpath(*parts)
