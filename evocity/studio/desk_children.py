"""Kept children that the desk offers as parents: genomes in folders ``NAME-children`` of the runs
that studio knows."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from evocity.search.preparation.trust import state_folder

#: Children that the desk offers, at most, and seconds between two looks for them.
MOST_CHILDREN, _BETWEEN = 48, 3.0
_SUFFIX = ".parquet"


class KeptChildren:
    """The kept children of the ``runs``."""

    def __init__(self, runs: Callable[[], Sequence[Path]]):
        self._runs = runs
        self._at = -_BETWEEN
        self._children: list[tuple[Path, str]] = []

    @property
    def children(self) -> list[tuple[Path, str]]:
        """The file and the title of each child; it looks for new children from time to time."""
        if time.monotonic() - self._at >= _BETWEEN:
            self._at, self._children = time.monotonic(), list(self._look())[:MOST_CHILDREN]
        return self._children

    def _look(self) -> Iterator[tuple[Path, str]]:
        names = {path.name for path in self._runs()}
        above = dict.fromkeys(path.parent for path in self._runs())
        for folder in [*above, state_folder() / "children"] if names else []:
            for kept in _entries(folder):
                name, separator, number = kept.name.rpartition("-children")
                is_numbered = number == "" or number[1:].isdecimal()
                if (
                    not separator
                    or name not in names
                    or not is_numbered
                    or not kept.is_dir(follow_symlinks=False)
                ):
                    continue
                for child in _entries(Path(kept.path)):
                    if child.name.endswith(_SUFFIX) and child.is_file(follow_symlinks=False):
                        title = f"{child.name.removesuffix(_SUFFIX)} of {kept.name}"
                        yield Path(child.path), title


def _entries(folder: Path) -> list[os.DirEntry]:
    """Return the entries of a ``folder`` by name; none for one that cannot be read."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        return sorted(entries, key=lambda entry: entry.name)
    return []
