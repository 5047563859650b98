"""Data files that measures read: named beside the Python file, part of a measure's source."""

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from evocity.errors import FitnessError
from evocity.fitness.measure import Measure, shown

#: Bytes of all data files that the measures of a file name, at most.
MOST_DATA = 64_000_000


def checked_names(data: str | Sequence[str]) -> tuple[str, ...]:
    """The names of ``data`` files, one or several, relative to a folder and within it. Raises
    `FitnessError` for anything else."""
    names = (data,) if isinstance(data, str) else data
    if isinstance(names, Sequence) and all(isinstance(name, str) and name for name in names):
        ways = [PurePosixPath(name) for name in names]
        within = all(way.parts and not way.is_absolute() and ".." not in way.parts for way in ways)
        if within and not any(set(name) & set("\\:\0") for name in names):
            return tuple(dict.fromkeys(map(str, ways)))
    raise FitnessError(
        f"data = {shown(data)}",
        'files beside the Python file, or in a folder beside it, for example "trees.csv"',
        "name them from the Python file's own folder, with / between folders",
    )


def data_of(folder: Path, measures: Sequence[Measure]) -> dict[Path, bytes]:
    """The data files in a ``folder`` that ``measures`` name, with their content. Raises
    `FitnessError` for one that cannot be read, and for more than `MOST_DATA` together."""
    contents: dict[Path, bytes] = {}
    for name in dict.fromkeys(name for one in measures for name in one.data):
        path = folder / name
        try:
            size = path.stat().st_size + sum(map(len, contents.values()))
            if size <= MOST_DATA:
                contents[path] = path.read_bytes()
                continue
        except OSError as error:
            raise FitnessError(
                f"data {name!r} cannot be read: {error.strerror}",
                f"a file in {folder}",
                "bring it there, or correct its name",
            ) from None
        raise FitnessError(
            f"data of {size / 1e6:.0f} MB, with {name!r}",
            f"{MOST_DATA / 1e6:.0f} MB together at most: runs keep them, clusters are sent them",
            "make them smaller; or leave them out of data, under a path that all machines have",
        )
    return contents


__all__ = ["MOST_DATA", "checked_names", "data_of"]
