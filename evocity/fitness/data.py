"""Data files of measures: their names, relative to the Python file, and their content."""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from evocity.errors import FitnessError, reason_of
from evocity.fitness.measure import Measure, shown

#: Most bytes of all data files that the measures of a file name.
MOST_DATA = 64_000_000


def check_names(data: str | Sequence[str]) -> tuple[str, ...]:
    """Check the names of ``data`` files, one or several: relative to a folder and within it.

    Raises `FitnessError` for anything else.
    """
    names = (data,) if isinstance(data, str) else data
    if isinstance(names, Sequence) and all(isinstance(name, str) and name for name in names):
        paths = [PurePosixPath(name) for name in names]
        within = all(p.parts and not p.is_absolute() and ".." not in p.parts for p in paths)
        if within and not any(set(name) & set("\\:\0") for name in names):
            return tuple(dict.fromkeys(map(str, paths)))
    raise FitnessError(
        f"data = {shown(data)}",
        'files beside the Python file, or in a folder beside it, for example "trees.csv"',
        "give paths relative to the Python file's folder, with / between folders",
    )


def read_data(folder: Path, measures: Sequence[Measure]) -> dict[Path, bytes]:
    """Read the data files in a ``folder`` that ``measures`` name: their content by path.

    Raises `FitnessError` for a file that cannot be read, and for more than `MOST_DATA` bytes.
    """
    contents: dict[Path, bytes] = {}
    for name in dict.fromkeys(name for measure in measures for name in measure.data):
        path = folder / name
        try:
            size = path.stat().st_size + sum(map(len, contents.values()))
            if size <= MOST_DATA:
                contents[path] = path.read_bytes()
                continue
        except OSError as error:
            raise FitnessError(
                f"data {name!r} cannot be read: {reason_of(error)}",
                f"a file in {folder}",
                "put the file there, or correct its name",
            ) from None
        raise FitnessError(
            f"the data files have {size / 1e6:.0f} MB, with {name!r}, which is too much",
            f"{MOST_DATA / 1e6:.0f} MB together at most, since runs store them and send them to "
            "clusters",
            "shrink the files; or leave them out of data, and read them from a path on all "
            "machines",
        )
    return contents
