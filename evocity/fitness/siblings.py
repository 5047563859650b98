"""What a file of measures imports from its own folder: found while it loads, and forgotten after.

The names go out of ``sys.modules`` again: two folders may each have a ``helper.py``, and a file
edited in between is read anew.
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

_INSTALLED = tuple(sysconfig.get_paths()[kind] for kind in ("purelib", "platlib"))


@contextlib.contextmanager
def importing_from(folder: Path) -> Iterator[dict[Path, bytes]]:
    """Within, Python files and packages in ``folder`` can be imported by their plain names.

    They come before others, as for a script that lies there, but not before the standard library,
    evocity, and what is imported from an installed package already. The mapping gets each file
    that was imported so, with its content.
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
        beside = {path.stem for path in folder.iterdir() if path.suffix == ".py" or path.is_dir()}
        self._names = {name for name in beside if name.isidentifier() and not _is_taken(name)}

    def claims(self, name: str) -> bool:
        """Whether a module of this dotted ``name`` is the folder's."""
        return name.partition(".")[0] in self._names

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if not self.claims(name):
            return None
        places = [self._folder] if path is None else [Path(one) for one in path]
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
    """Compiles the file as it is now, keeps no bytecode, and notes what it read."""

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


__all__ = ["importing_from"]
