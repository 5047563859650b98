"""Files that a process has read, kept for its next job: a move of a window reads no file again."""

import dataclasses
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from evocity.io import map_reader
from evocity.io.reader_types import Footprints, Grid, Request

#: Bytes of all that is kept, estimated; at most.
MOST_KEPT = 256 << 20
# Bytes of a building without its points, estimated: its polygon, and its tags.
_OF_BUILDING = 2000

Data = Footprints | Grid
_Key = tuple[Path, int, int, tuple[tuple[str, Any], ...]]


class _Traced(Request):
    """A request that notes the names of the fields that a reader looks at."""

    def __getattribute__(self, name: str) -> Any:
        fields = object.__getattribute__(self, "__dataclass_fields__")
        if name in fields:
            object.__getattribute__(self, "__dict__").setdefault("_used", set()).add(name)
        return object.__getattribute__(self, name)


class KeptSources:
    """What readers returned, by file and by those fields of the request that the reader looked at;
    the results that were used last, in `MOST_KEPT` bytes."""

    def __init__(self) -> None:
        self._kept: OrderedDict[_Key, tuple[Data, int]] = OrderedDict()

    def read(self, read: Callable[[Path, Request], Data], path: Path, request: Request) -> Data:
        """Return what ``read`` returns for a file and a ``request``."""
        if not path.is_file():
            return read(path, request)
        about = path.stat()
        file = path, about.st_mtime_ns, about.st_size
        for key, (data, _) in self._kept.items():
            if key[:3] == file and all(getattr(request, name) == v for name, v in key[3]):
                self._kept.move_to_end(key)
                return data
        traced = _Traced(**{f.name: getattr(request, f.name) for f in dataclasses.fields(request)})
        vars(traced)["_used"] = set()
        data = read(path, traced)
        used = sorted(vars(traced)["_used"])
        self._keep((*file, tuple((name, getattr(request, name)) for name in used)), data)
        return data

    def _keep(self, key: _Key, data: Data) -> None:
        if isinstance(data, Grid):
            data.heights.setflags(write=False)  # a writable array would be changed
        self._kept[key] = data, _size_of(data)
        while sum(size for _, size in self._kept.values()) > MOST_KEPT:
            self._kept.popitem(last=False)


def _size_of(data: Data) -> int:
    if isinstance(data, Grid):
        return int(data.heights.nbytes)
    points = shapely.get_num_coordinates(data.polygons)
    return int(16 * np.sum(points) + _OF_BUILDING * len(data.polygons))


def keep_sources() -> None:
    """Let the readers of evocity keep what they read, in this process."""
    kept = KeptSources()

    def keeping(read: Callable[[Path, Request], Data]) -> Callable[[Path, Request], Data]:
        return lambda path, request: kept.read(read, path, request)

    for suffix, reader in map_reader.READERS.items():
        map_reader.READERS[suffix] = dataclasses.replace(reader, read=keeping(reader.read))
