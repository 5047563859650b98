"""A run folder while one looks at it: it may grow, be damaged, go, and come back."""

import contextlib
import hashlib
import json
import threading
import time
from functools import cached_property
from pathlib import Path

from evocity.analysis import Run, open_run
from evocity.analysis.likeness import Likeness
from evocity.analysis.pedigree import Pedigree
from evocity.analysis.viewed import Viewed
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError
from evocity.store.lock import is_held
from evocity.store.parts import open_to_read
from evocity.studio.tiles import Tiles
from evocity.viewer.sheet import Sheet

#: Seconds for which news are news: many pages that ask at once have the folder looked at once.
FRESH = 0.5
#: Bytes of the first event that are read.
MOST_LINE = 1 << 16


def framed(about: dict, content: bytes) -> bytes:
    """A JSON object and bytes in one answer: how many bytes the first takes, uint32, little-endian;
    that, filled up with spaces to a multiple of four; the second."""
    told = json.dumps(about, allow_nan=False).encode()
    told += b" " * (-len(told) % 4)
    return len(told).to_bytes(4, "little") + told + content


class Moment(Viewed):
    """All births up to a generation, as columns; ``called`` is the same for all moments of a run
    whose births are the same as far as they go."""

    def __init__(self, run: Run, called: str):
        super().__init__(run)
        self.called, self.generation = called, run.told.last

    @property
    def about(self) -> dict:
        """What the page is told of them; plain values."""
        run = self.run
        return {
            **super().about,
            **self.table.about,
            "run": self.called,
            "generation": self.generation,
            "folder": str(run.path),
            "axes": self.axes(),
            "cities": list(run.header.cities),
            "metres": [
                run.header.width * run.header.metres_per_pixel,
                run.header.height * run.header.metres_per_pixel,
            ],
        }

    @cached_property
    def buffer(self) -> bytes:
        """The births as the page reads them, `framed`: what is told `about` them, the table."""
        return framed(self.about, self.table.buffer)

    @cached_property
    def likeness(self) -> Likeness:
        return Likeness(self.run.told)

    @cached_property
    def cities(self) -> tuple[list[CityMap], list[CityMap]]:
        """The source cities, and those that measures compare with."""
        return [one.city for one in self.run.sources()], list(self.run.references())

    @cached_property
    def pedigree(self) -> Pedigree:
        return Pedigree(self.run.told)


class Watched:
    """The run in the folder ``path``. One thread at a time looks. Raises `RunError` if there is
    none, or it is damaged; later that is told by `news`."""

    def __init__(self, path: str | Path):
        self.path = Path(path).resolve()
        self._lock = threading.RLock()
        self._moment: Moment | None = None
        self._tiles: Tiles | None = None
        self._news, self._until = {}, 0.0
        self._look()

    def _look(self) -> dict:
        """Look at the folder; what is new there."""
        run = open_run(self.path)
        going = is_held(run.path / "lock")
        called, last = _called(run), run.generations[-1] if run.generations else -1
        before = self._moment
        if last >= 0 and (before is None or (before.called, before.generation) != (called, last)):
            moment = Moment(run, called)
            _ = moment.buffer  # what is damaged is found now
            if before is None or before.called != called:
                self._tiles = Tiles(called)
            self._moment = moment
        return {"run": called, "generation": last, "going": going, "problem": None}

    def news(self) -> dict:
        """``generation``, the last whole one, -1 before the first; ``run``, what the run is
        `Moment.called`; whether it is ``going``, that is bred by a process now; the ``problem``
        there is with the folder, in words, None for none."""
        with self._lock:
            if time.monotonic() >= self._until:
                try:
                    self._news = self._look()
                except EvocityError as error:
                    last = -1 if self._moment is None else self._moment.generation
                    called = "" if self._moment is None else self._moment.called
                    self._news = {
                        "run": called,
                        "generation": last,
                        "going": False,
                        "problem": str(error),
                    }
                self._until = time.monotonic() + FRESH
            return self._news

    @property
    def moment(self) -> Moment:
        """The last one that could be read. Raises `RunError` before the first generation."""
        if self._moment is None:
            self.news()
        if self._moment is None:
            raise RunError(
                f"{self.path} has no whole generation yet", "at least one", "wait for the first"
            )
        return self._moment

    def sheet(self, ids: list[int], side: int) -> Sheet:
        """Small pictures of births."""
        with self._lock:
            moment = self.moment
            return self._tiles.sheet(moment, ids, side)

    @property
    def reading(self) -> threading.RLock:
        """Held by who reads the run."""
        return self._lock


def _called(run: Run) -> str:
    """A name of letters and digits for a run, which another in its place would not have."""
    begun = b""
    with contextlib.suppress(OSError), open_to_read(run.path / "events.jsonl") as file:
        begun = file.readline(MOST_LINE)
    told = [repr(run.header), run.recipe_text, begun.decode(errors="replace")]
    return hashlib.blake2b("\0".join(told).encode(errors="replace"), digest_size=12).hexdigest()


__all__ = ["Moment", "Watched", "framed"]
