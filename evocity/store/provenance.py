"""Provenance of a run: command, versions, hashes."""

import functools
import hashlib
import os
import platform
import sys
from importlib import metadata
from pathlib import Path

import numpy as np

from evocity import __version__
from evocity.citymap import CityMap

_LIBRARIES = ("numpy", "scipy", "numba", "deap", "moocore", "nlopt", "pyarrow", "pydantic")


def environment() -> dict:
    """Return the command, the versions of evocity and of its libraries, Python and platform.
    Absolute paths in the command are cut to their names, to keep the user's folders private."""
    return {
        "command": [_without_folders(word) for word in sys.argv],
        "versions": {"evocity": __version__} | {name: _version(name) for name in _LIBRARIES},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "cores": os.cpu_count(),
    }


def _without_folders(word: str) -> str:
    option, joint, value = word.partition("=")
    if joint and os.path.isabs(value):
        return f"{option}={Path(value).name}"
    return Path(word).name if os.path.isabs(word) else word


def hash_of_text(text: str) -> str:
    """Return the hexadecimal hash of a text, whatever its line ends."""
    return hashlib.blake2b(text.replace("\r\n", "\n").encode(), digest_size=16).hexdigest()


def hash_of_file(*paths: str | os.PathLike) -> str:
    """Return the hexadecimal hash of a file's bytes, or of several files in turn. Raises
    OSError."""
    state = hashlib.blake2b(digest_size=16)
    for path in paths:
        state.update(Path(path).read_bytes())
    return state.hexdigest()


def hash_of_map(city: CityMap) -> str:
    """Return the hexadecimal hash of a map's heights and pixel size."""
    state = hashlib.blake2b(digest_size=16)
    state.update(repr((city.shape, city.metres_per_pixel)).encode())
    state.update(city.heights.tobytes())
    return state.hexdigest()


def hash_of_mask(mask: np.ndarray) -> str:
    """Return the hexadecimal hash of booleans and their shape."""
    state = hashlib.blake2b(digest_size=16)
    state.update(repr(mask.shape).encode())
    state.update(np.packbits(mask).tobytes())
    return state.hexdigest()


@functools.cache
def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
