"""Local imports of a file of measures, importable only while it loads, and its data files.

The names of modules leave ``sys.modules`` afterwards. So two folders may each have a ``helper.py``,
and an edited file is read again.
"""

import contextlib
import sys
import sysconfig
from collections.abc import Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType

from evocity.errors import FitnessError, reason_of
from evocity.fitness.measure import Measure

#: Most bytes of all data files that the measures of a file name.
MOST_DATA = 64_000_000

_INSTALLED = tuple(sysconfig.get_paths()[kind] for kind in ("purelib", "platlib"))


@contextlib.contextmanager
def importing_from(folder: Path) -> Iterator[dict[Path, bytes]]:
    """Make Python files and packages in ``folder`` importable by their plain names in the block.

    They come before others, as for a script in that folder. They do not come before the standard
    library, evocity, and modules already imported from an installed package. The mapping receives
    each imported file with its content.
    """
    finder = _Finder(folder)
    hidden = {name: sys.modules.pop(name) for name in list(sys.modules) if finder.claims(name)}
    sys.meta_path.insert(0, finder)
    try:
        yield finder.contents
    finally:
        sys.meta_path.remove(finder)
        for name in [name for name in sys.modules if finder.claims(name)]:
            del sys.modules[name]
        sys.modules.update(hidden)


class _Finder(MetaPathFinder):
    """Finds the modules of one folder."""

    def __init__(self, folder: Path):
        self._folder = folder
        self.contents: dict[Path, bytes] = {}
        stems = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
        self._names = {name for name in stems if name.isidentifier() and not _is_taken(name)}

    def claims(self, name: str) -> bool:
        """Check whether a module of this dotted ``name`` belongs to the folder."""
        return name.partition(".")[0] in self._names

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if not self.claims(name):
            return None
        places = [self._folder] if path is None else [Path(place) for place in path]
        for place in places:
            stem = place / name.rpartition(".")[2]
            for file in (stem / "__init__.py", stem.with_name(f"{stem.name}.py")):
                if file.is_file():
                    loader = _Loader(name, str(file), self.contents)
                    return spec_from_file_location(name, file, loader=loader)
            if stem.is_dir() and PathFinder.find_spec(name, path) is None:
                folder = ModuleSpec(name, None, is_package=True)  # a package without __init__.py
                folder.submodule_search_locations = [str(stem)]
                return folder
        return None


class _Loader(SourceFileLoader):
    """Compiles the current file, keeps no bytecode, and records the content."""

    def __init__(self, name: str, path: str, contents: dict[Path, bytes]):
        super().__init__(name, path)
        self._contents = contents

    def get_code(self, fullname: str) -> CodeType:
        content = self._contents[Path(self.path)] = self.get_data(self.path)
        return self.source_to_code(content, self.path)


def _is_taken(name: str) -> bool:
    if name in sys.stdlib_module_names or name in ("evocity", "__main__"):
        return True
    file = getattr(sys.modules.get(name), "__file__", None) or ""
    return file.startswith(_INSTALLED)


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
                f"the data file {name!r} cannot be read: {reason_of(error)}",
                f"a file of this name in the folder {folder}",
                "put the file into this folder, or correct its name in the parameter 'data'",
            ) from None
        raise FitnessError(
            f"the data files up to {name!r} have {size / 1e6:.0f} MB in all",
            f"at most {MOST_DATA / 1e6:.0f} MB, because runs store these files and send them to "
            "clusters",
            "shrink the files; or remove the files from the parameter 'data', and read them from a "
            "path that exists on all machines",
        )
    return contents
