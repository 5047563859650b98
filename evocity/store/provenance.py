"""Provenance of a run: command, versions, hashes."""

import functools
import hashlib
import json
import os
import platform
import re
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path, PurePath

import numpy as np
from pydantic_core import from_json

from evocity import __version__
from evocity.citymap import CityMap
from evocity.store.run_directory import RunDirectory

_LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "deap",
    "moocore",
    "nlopt",
    "pyarrow",
    "pydantic",
    "scikit-image",
)

# The types of what readers take from provenance.json, where a run has it.
_PARTS = {
    "versions": dict,
    "evaluation": dict,
    "files": dict,
    "marks": list,
    "recipe": dict,
    "recipe.folder": str,
    "recipe.hash": str,
    "recipe.overrides": dict,
    "recipe.operators": dict,
    "recipe.search": dict,
    "recipe.before": list,
    "recipe.islands": list,
    "maps": list,
    "references": list,
    "fitness": list,
    "recorded": list,
    "descriptors": list,
}


# The end of a sealed document: the digest of all its other bytes, with zeros in its place.
_SEAL = re.compile(rb'"seal": "([^"]{32})"\s*\}\s*\Z')
_UNSEALED = "0" * 32


def sealed_json(about: Mapping) -> bytes:
    """Return a JSON document of ``about``; its last key, ``seal``, has the digest of all other
    bytes."""
    text = json.dumps({**about, "seal": _UNSEALED}, indent=1, ensure_ascii=False).encode()
    match = _SEAL.search(text)
    assert match is not None  # the last key of the text above
    start, end = match.span(1)
    return text[:start] + _hash(text).encode() + text[end:]


def is_sealed(content: bytes) -> bool:
    """Return whether a document has a seal."""
    return _SEAL.search(content) is not None


def read_provenance(directory: RunDirectory, part: str | PurePath) -> dict:
    """Return the document in a file of a run, without its seal; older releases wrote none. Raises
    OSError, `RunError`, and ValueError if the file was changed."""
    content = directory.read(part)
    if found := _SEAL.search(content):
        start, end = found.span(1)
        unsealed = content[:start] + _UNSEALED.encode() + content[end:]
        if found[1] != _hash(unsealed).encode():
            raise ValueError("its seal is not that of its content")
    about = from_json(content)
    if isinstance(about, dict):
        about.pop("seal", None)
    return about


def check_parts(provenance: object) -> None:
    """Raise ValueError if a part of ``provenance``, read from a file, has another type."""
    if not isinstance(provenance, dict):
        raise ValueError("it is not a JSON object")
    for path, kind in _PARTS.items():
        outer, _, name = path.rpartition(".")
        within = provenance.get(outer, {}) if outer else provenance
        if not isinstance(part := within.get(name, kind()), kind):
            raise ValueError(f"{path} is of the type {type(part).__name__}")


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
    return _hash(text.replace("\r\n", "\n").encode())


def hash_of_file(*paths: str | os.PathLike) -> str:
    """Return the hexadecimal hash of one file, or of several in turn. Raises OSError."""
    return _hash(*(Path(path).read_bytes() for path in paths))


def hash_of_map(city: CityMap) -> str:
    """Return the hexadecimal hash of a map's heights and pixel size."""
    return _hash(repr((city.shape, city.metres_per_pixel)).encode(), city.heights.tobytes())


def hash_of_mask(mask: np.ndarray) -> str:
    """Return the hexadecimal hash of booleans and their shape."""
    return _hash(repr(mask.shape).encode(), np.packbits(mask).tobytes())


def _hash(*parts: bytes) -> str:
    return hashlib.blake2b(b"".join(parts), digest_size=16).hexdigest()


@functools.cache
def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
