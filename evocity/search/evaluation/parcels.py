"""What another machine must know to breed and evaluate, in one parcel: the setup, and the source of
the user's own measures."""

import hashlib
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evocity.errors import RunError
from evocity.fitness import Measure
from evocity.fitness.measure import content_hash
from evocity.search.evaluation.frames import framed, read_of
from evocity.search.evaluator import Setup


@dataclass(frozen=True)
class Parcel:
    """``told``: the setup, in bytes; ``files``: the user's own files that measures are made of, by
    their paths there; ``sides``, ``parts``: of the setup, the kernels that are called.

    What sends it to a worker process sends the setup: it is opened there, and nowhere before, so
    no other process executes what the user wrote.
    """

    told: bytes
    files: Mapping[str, bytes]
    sides: int | tuple[int, int]
    parts: tuple[str, ...]

    @property
    def digest(self) -> str:
        """Hexadecimal; of all that is in it."""
        state = hashlib.blake2b(self.told, digest_size=16)
        for path, content in sorted(self.files.items()):
            state.update(repr((path, len(content))).encode() + content)
        return state.hexdigest()

    def __reduce__(self):
        return opened, (self.told, self.files)


def parcel_of(setup: Setup, measures: Sequence[Measure]) -> Parcel:
    """Of a ``setup`` with these ``measures``. Raises `RunError` if a file of theirs is not any more
    what was executed."""
    named = {file for _, file in setup.measures if file is not None}
    files: dict[str, bytes] = {}
    for one in measures:
        if one.file not in named:
            continue
        try:
            own = {path: Path(path).read_bytes() for path in (one.file, *one.beside)}
        except OSError:
            own = {}
        if content_hash(b"".join(own.values())) != one.source_hash:
            raise RunError(
                f"{one.file} has changed since it was executed",
                "files of measures that stay as they are while a run begins",
                "start again",
            )
        files |= own
    return Parcel(bytes(framed(setup))[8:], files, setup.sides, setup.parts)


def opened(told: bytes, files: Mapping[str, bytes]) -> Setup:
    """The setup of a parcel, in a worker process. Files that lie here as they lie there are taken
    where they are; else they are written into this process's temporary folder."""
    setup = read_of(told)
    if not files or all(map(_is_here, files, files.values())):
        return setup
    named = list(dict.fromkeys(file for _, file in setup.measures if file is not None))
    room = tempfile.mkdtemp(prefix="measures-")
    moved = {}
    for number, folder in enumerate(dict.fromkeys(map(os.path.dirname, named))):
        moved[os.path.join(room, str(number))] = folder
        for path, content in files.items():
            if Path(path).is_relative_to(folder):
                place = Path(room, str(number), Path(path).relative_to(folder))
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(content)
    places = {folder: place for place, folder in moved.items()}
    measures = tuple(
        (
            name,
            file and os.path.join(places[os.path.dirname(file)], os.path.basename(file)),
        )
        for name, file in setup.measures
    )
    return replace(setup, measures=measures, moved=moved)


def _is_here(path: str, content: bytes) -> bool:
    try:
        return Path(path).read_bytes() == content
    except OSError:
        return False


__all__ = ["Parcel", "opened", "parcel_of"]
