"""Parcels: the setup and the files of measures that another machine needs to breed and evaluate."""

import hashlib
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evocity.errors import RunError
from evocity.evaluation.evaluator import Setup
from evocity.evaluation.frames import unpickle, write_frame
from evocity.fitness import Measure
from evocity.fitness.measure import content_hash


@dataclass(frozen=True)
class Parcel:
    """A setup for another machine: pickled, with the user's files of measures by path, and the
    kernels. Only a worker unpickles the setup, by `unpack`, so no other process executes the user's
    code."""

    setup: bytes
    files: Mapping[str, bytes]
    sides: int | tuple[int, int]
    parts: tuple[str, ...]

    @property
    def digest(self) -> str:
        """A hash of the setup and the files, hexadecimal."""
        state = hashlib.blake2b(self.setup, digest_size=16)
        for path, content in sorted(self.files.items()):
            state.update(repr((path, len(content))).encode() + content)
        return state.hexdigest()

    def __reduce__(self):
        return unpack, (self.setup, self.files)


def parcel_of(setup: Setup, measures: Sequence[Measure]) -> Parcel:
    """Make the parcel of a ``setup``. Raises `RunError` if a file of ``measures`` has changed."""
    named = {file for _, file in setup.measures if file is not None}
    files: dict[str, bytes] = {}
    for measure in measures:
        if measure.file not in named:
            continue
        try:
            sources = {path: Path(path).read_bytes() for path in (measure.file, *measure.beside)}
        except OSError:
            sources = {}
        if content_hash(b"".join(sources.values())) != measure.source_hash:
            raise RunError(
                f"the file {measure.file} has changed since evocity executed it",
                "files of measures that stay unchanged while a run starts",
                "start the run again",
            )
        files |= sources
    return Parcel(bytes(write_frame(setup))[8:], files, setup.sides, setup.parts)


def unpack(packed: bytes, files: Mapping[str, bytes]) -> Setup:
    """Unpickle the setup of a parcel, in a worker process. Missing or other ``files`` are copied to
    a temporary folder; ``moved`` maps the copies' folders to the originals."""
    setup = unpickle(packed)
    if all(_is_here(path, content) for path, content in files.items()):
        return setup
    originals = dict.fromkeys(os.path.dirname(file) for _, file in setup.measures if file)
    room = tempfile.mkdtemp(prefix="measures-")
    copies = {folder: os.path.join(room, str(number)) for number, folder in enumerate(originals)}
    for folder, copy in copies.items():
        for path, content in files.items():
            if Path(path).is_relative_to(folder):
                target = Path(copy, Path(path).relative_to(folder))
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)

    def copy_of(file: str) -> str:
        return os.path.join(copies[os.path.dirname(file)], os.path.basename(file))

    measures = tuple((name, file and copy_of(file)) for name, file in setup.measures)
    moved = {copy: folder for folder, copy in copies.items()}
    return replace(setup, measures=measures, moved=moved)


def _is_here(path: str, content: bytes) -> bool:
    try:
        return Path(path).read_bytes() == content
    except OSError:
        return False
