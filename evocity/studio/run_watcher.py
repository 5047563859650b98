"""The watcher of a run folder, which may grow, be damaged, disappear and come back."""

import contextlib
import hashlib
import json
import threading
import time
from functools import cached_property
from pathlib import Path
from typing import Any

from evocity.analysis import Run, open_run
from evocity.analysis.goals import planned_generations
from evocity.analysis.outlook import outlook
from evocity.analysis.page import Page
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError
from evocity.store.events import EVENTS
from evocity.store.lock import is_held
from evocity.store.run_directory import RunDirectory
from evocity.studio.request_fields import fault_of
from evocity.studio.tiles import Tiles
from evocity.viewer.sheet import Sheet

#: Seconds between two looks at the folder, however many pages ask.
FRESH = 0.5
#: Bytes of the first event that count for the fingerprint.
MOST_LINE = 1 << 16


def frame(about: dict, content: bytes) -> bytes:
    """Join the length of the JSON, uint32, little-endian; the JSON, padded to four bytes; the
    bytes."""
    head = json.dumps(about, allow_nan=False).encode()
    head += b" " * (-len(head) % 4)
    return len(head).to_bytes(4, "little") + head + content


class Moment(Page):
    """All births up to a generation; moments of one run have the same ``fingerprint``."""

    def __init__(self, run: Run, fingerprint: str):
        super().__init__(run, folder=str(run.path))
        self.fingerprint, self.generation = fingerprint, run.columns.last

    @cached_property
    def about(self) -> dict:
        header = self.run.header
        return {
            **super().about,
            "run": self.fingerprint,
            "generation": self.generation,
            "folder": str(self.run.path),
            "metres": [
                header.width * header.metres_per_pixel,
                header.height * header.metres_per_pixel,
            ],
        }

    @cached_property
    def buffer(self) -> bytes:
        """The births for the page: `about` and the table, as `frame` joins them."""
        return frame(self.about, self.table.buffer)

    #: The time left, and targets and bounds that no birth has reached.
    outlook = cached_property(lambda self: outlook(self.run))
    #: The generations of the recipe; None if it is unreadable.
    planned = cached_property(lambda self: planned_generations(self.run))

    @cached_property
    def cities(self) -> tuple[list[CityMap], list[CityMap]]:
        return [source.city for source in self.run.sources()], list(self.run.references())


class RunWatcher:
    """The run in the folder ``path``; one thread at a time reads it."""

    def __init__(self, path: str | Path):
        self.path = Path(path).resolve()
        #: The lock that a reader of the run holds.
        self.reading = threading.RLock()
        self._choosing = threading.Lock()
        self._moment: Moment | None = None
        self._tiles: Tiles | None = None
        self._news, self._until = {}, 0.0
        self._look()

    def _look(self) -> dict:
        run = open_run(self.path)
        if self._moment is not None:
            run.take_over_checks(self._moment.run)
        going = is_held(run.path / "lock")
        fingerprint, last = _fingerprint(run), run.generations[-1] if run.generations else -1
        before = self._moment
        is_new = before is None or before.fingerprint != fingerprint
        if last >= 0 and (is_new or before.generation != last):
            moment = Moment(run, fingerprint)
            _ = moment.buffer  # raises now if the run is damaged
            if is_new:
                self._tiles = Tiles(fingerprint)
            self._moment = moment
        return {"run": fingerprint, "generation": last, "going": going, "problem": None}

    def news(self) -> dict:
        """Return the last complete ``generation``, -1 before the first; the fingerprint of the
        ``run``; whether it is ``going``; the ``problem`` of the folder in three parts, or None."""
        with self.reading:
            if time.monotonic() >= self._until:
                try:
                    self._news = self._look()
                except EvocityError as error:
                    moment = self._moment
                    self._news = {
                        "run": "" if moment is None else moment.fingerprint,
                        "generation": -1 if moment is None else moment.generation,
                        "going": False,
                        "problem": fault_of(error),
                    }
                self._until = time.monotonic() + FRESH
            return self._news

    @property
    def moment(self) -> Moment:
        """The last readable moment. Raises `RunError` before the first generation."""
        if self._moment is None:
            self.news()
        if self._moment is None:
            raise RunError(
                f"{self.path} has no complete generation yet",
                "at least one complete generation",
                "wait for the first generation to end",
            )
        return self._moment

    def sheet(self, ids: list[int], side: int) -> Sheet:
        with self.reading:
            moment = self.moment
            return self._tiles.sheet(moment, ids, side)

    def part(self, name: str) -> Any:
        """Return a part of the page. The births to keep take seconds to choose; meanwhile the run
        stays readable."""
        with self.reading:
            moment = self.moment
            if name != "keep":
                return moment.part(name)
        with self._choosing:
            if "keep" not in moment.__dict__:
                moment.__dict__["keep"] = Page(open_run(self.path), folder=str(self.path)).keep
            return moment.keep


def _fingerprint(run: Run) -> str:
    """Return letters and digits that differ for another run in the same folder."""
    begun = b""
    with contextlib.suppress(OSError), RunDirectory(run.path).open(EVENTS) as file:
        begun = file.readline(MOST_LINE)
    parts = [repr(run.header), run.recipe_text, begun.decode(errors="replace")]
    return hashlib.blake2b("\0".join(parts).encode(errors="replace"), digest_size=12).hexdigest()
