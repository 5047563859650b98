"""The maps on the desk: bundled districts, and files that a user brought. A file is kept under a
number and a suffix of a table; the name that it came by is text, and never a path."""

import contextlib
import shutil
import threading
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from evocity.citymap import MAX_SIDE, PIXEL_SIDES
from evocity.errors import EvocityError, MapError, cut_short, plain_text, shown, told, told_bytes
from evocity.files import OwnFolder
from evocity.io.bundled import DISTRICTS
from evocity.io.reading import READERS
from evocity.studio.apart import Errand
from evocity.studio.asked import Body, Faulty, typed, whole
from evocity.studio.one import fault_of

#: Bytes of all files that are brought; how many are on the desk at a time.
MOST_BYTES, MOST_MAPS = 1_000_000_000, 16
#: Bytes of memory and seconds that reading may take.
MEMORY, SECONDS = 4 << 30, 120.0
#: What stands in one file.
SUFFIXES = tuple(sorted((one for one in READERS if one != ".shp"), key=len, reverse=True))
_LETTERS = 80  # bytes of a title

Number = Annotated[int, Field(ge=0, lt=2**31)]
_METRES = "a number of metres from {:f} to {:.0f}".format(*PIXEL_SIDES)


def _metres(name: str) -> Any:
    return typed(name, _METRES, ge=PIXEL_SIDES[0], le=PIXEL_SIDES[1])


class Window(Body):
    """The window that all maps are read at."""

    pixels: Annotated[int, whole("window, pixels a side", 8, MAX_SIDE)] = 256
    metres_per_pixel: Annotated[float, _metres("metres a pixel")] = 2.0


class Placed(Body):
    """How one map is read: options of `evocity.read_map`; whether it is a parent."""

    map: Number
    chosen: bool = False
    center: Annotated[
        tuple[Annotated[float, Field(ge=-180, le=180)], Annotated[float, Field(gt=-90, lt=90)]]
        | None,
        typed("centre", "longitude from -180 to 180, latitude between -90 and 90"),
    ] = None
    layer: Annotated[
        str | None,
        typed("layer of the buildings", "1 to 100 letters", min_length=1, max_length=100),
    ] = None
    default_height: Annotated[float | None, _metres("height where none is told")] = None
    height_scale: Annotated[float | None, _metres("metres of a grey level or unit")] = None

    @property
    def options(self) -> dict[str, Any]:
        """Those that were told, as a recipe has them."""
        return self.model_dump(exclude={"map", "chosen"}, exclude_none=True, mode="json")


@dataclass
class Laid:
    """One map: ``about``, what its reader told of it, or the ``fault`` there is; ``turn``: how
    often it was read."""

    number: int
    title: str
    source: str
    suffix: str = ""
    size: int = 0
    about: dict | None = None
    fault: dict | None = None
    turn: int = 0
    wanted: dict = field(default_factory=dict)
    read: dict | None = None

    @property
    def is_own(self) -> bool:
        """Whether a user brought it."""
        return bool(self.suffix)

    @property
    def told(self) -> dict:
        return {
            "map": self.number,
            "title": self.title,
            "own": self.is_own,
            "size": self.size,
            "takes": sorted(READERS[self.suffix].takes) if self.is_own else [],
            "about": self.about,
            "fault": self.fault,
            "turn": self.turn,
            "reading": self.read != self.wanted,
        }


class Maps:
    """All that lie on the desk, by number. One thread has them read, again whenever their window
    changes, in processes of their own."""

    def __init__(self) -> None:
        self._home: OwnFolder | None = None
        self._changed = threading.Condition()
        self._laid = {
            number: Laid(number, name, name) for number, name in enumerate(sorted(DISTRICTS))
        }
        self._next = len(self._laid)
        self._window = Window()
        self._thread: threading.Thread | None = None
        self._errand: Errand | None = None
        self._closed = False

    def __getitem__(self, number: int) -> Laid:
        with self._changed:
            if number not in self._laid:
                raise Faulty(f"no map {number}", "one on the desk", "load the page again")
            return self._laid[number]

    def __contains__(self, number: int) -> bool:
        with self._changed:
            return number in self._laid

    @property
    def folder(self) -> Path:
        """A temporary one, made when it is first needed, and removed with the desk. Raises
        `MapError` where it cannot be made."""
        with self._changed:
            if self._home is None:
                try:
                    self._home = OwnFolder("evocity-desk-")
                except OSError as error:
                    raise MapError(
                        f"no temporary folder can be made: {error.strerror or error}",
                        "room for it",
                        "free some, or set TMPDIR to a folder with room and start studio again",
                    ) from error
            return self._home.path

    def told(self) -> list[dict]:
        """Plain values. Who asks first has them read."""
        with self._changed:
            if self._thread is None and not self._closed:
                self.place(self._window, {})
                self._thread = threading.Thread(target=self._read_all, daemon=True, name="maps")
                self._thread.start()
            return [one.told for one in self._laid.values()]

    # -- files -------------------------------------------------------------------------------------

    def begin(self, name: str) -> tuple[Path, str]:
        """Where a file called ``name`` is to be written, and its suffix. Raises `MapError` for one
        that is none of a map in one file, and where there is no room."""
        lower = name.lower()
        suffix = next((one for one in SUFFIXES if lower.endswith(one)), None)
        if suffix is None:
            parts = lower.endswith((".shp", ".dbf", ".shx", ".prj", ".cpg"))
            raise MapError(
                f"{shown(name)}: " + ("a part of a Shapefile" if parts else "no map by its name"),
                f"one file that ends in {', '.join(sorted(SUFFIXES))}",
                "a Shapefile is several files: save it as GeoPackage, in one"
                if parts
                else "convert it to one of these; GeoJSON and GeoTIFF are the easiest to check",
            )
        with self._changed:
            own = [one for one in self._laid.values() if one.is_own]
            if len(own) >= MOST_MAPS or sum(one.size for one in own) >= MOST_BYTES:
                raise MapError(
                    f"{len(own)} files are on the desk",
                    f"{MOST_MAPS} at most, of {told_bytes(MOST_BYTES)} in all",
                    "take one away",
                )
            number, self._next = self._next, self._next + 1
        return self.folder / f"map-{number}{suffix}", suffix

    def add(self, path: Path, name: str, suffix: str) -> int:
        """The number of the file at ``path``, which was called ``name``."""
        stem = plain_text(name[: -len(suffix)])
        stem = "".join("-" if one in '/\\:*?"<>|' else one for one in stem).strip(" .-")
        with self._changed:
            number = int(path.name[: -len(suffix)].removeprefix("map-"))
            stem, titles = (
                cut_short(stem, _LETTERS) or "map",
                {o.title for o in self._laid.values()},
            )
            others = (f"{stem} {k}" for k in range(2, number + 2))
            title = next(one for one in (stem, *others) if one not in titles)
            self._laid[number] = Laid(number, title, str(path), suffix, path.stat().st_size)
            self._want(self._laid[number], self._window, {})
        return number

    def drop(self, number: int) -> None:
        """Take a file away that a user brought."""
        one = self[number]
        if not one.is_own:
            raise Faulty(f"{one.title} comes with evocity", "a file of yours", "leave it")
        with self._changed:
            self._laid.pop(number, None)
        for path in (Path(one.source), self._picture(number)):
            path.unlink(missing_ok=True)

    def copy(self, number: int, folder: Path) -> str:
        """Put a map where a recipe in the ``folder`` can name it; how it does."""
        one = self[number]
        if one.is_own:
            path = Path(one.source)
            shutil.copyfile(path, folder / path.name)
            return path.name
        return one.source

    # -- reading -----------------------------------------------------------------------------------

    def place(self, window: Window, placed: dict[int, Placed]) -> None:
        """How they are read from now on; districts that nobody chose are shown as they come."""
        with self._changed:
            self._window = window
            for number, one in self._laid.items():
                told = placed.get(number, Placed(map=number))
                self._want(one, window if one.is_own or told.chosen else Window(), told.options)

    def _want(self, one: Laid, window: Window, options: dict) -> None:
        one.wanted = window.model_dump() | options
        self._changed.notify_all()

    def _read_all(self) -> None:
        while True:
            with self._changed:
                while not self._closed and not self._unread():
                    self._changed.wait()
                if self._closed:
                    return
                taken = sorted(self._unread(), key=lambda one: not one.is_own)
                jobs = {one.number: dict(one.wanted) for one in taken}
                self._errand = errand = Errand(MEMORY, SECONDS * len(taken), "reading a map")
            try:
                maps = [
                    {
                        "number": one.number,
                        "map": one.source,
                        "options": jobs[one.number] | {"name": one.title},
                        "picture": str(self._picture(one.number)),
                    }
                    for one in taken
                ]
                errand.run({"errand": "read", "maps": maps}, partial(self._told, jobs))
            except EvocityError as error:
                self._failed(error, jobs)
            except Exception as error:  # told on the page; those to come are read all the same
                fault = f"it could not be read: {told(error)}"
                remedy = "look whether memory or disk is full, then change how it is read"
                self._failed(MapError(fault, "a process that reads it", remedy), jobs)

    def _failed(self, fault: EvocityError, jobs: dict[int, dict]) -> None:
        """The first that was not told of is at fault, unless it is gone; the others are read
        again."""
        with self._changed:
            for number, job in jobs.items():
                one = self._laid.get(number)
                if one is None:
                    return
                if one.read != job:
                    one.read, one.about, one.turn = job, None, one.turn + 1
                    one.fault = fault_of(fault)
                    return

    def _unread(self) -> list[Laid]:
        return [one for one in self._laid.values() if one.read != one.wanted]

    def _told(self, jobs: dict[int, dict], said: dict) -> None:
        with self._changed:
            one = self._laid.get(said["map"])
            if one is None:
                return
            one.read, one.turn = jobs[one.number], one.turn + 1
            one.about = said.get("about")
            one.fault = fault_of(EvocityError(*said["error"])) if "error" in said else None

    def _picture(self, number: int) -> Path:
        return self.folder / f"picture-{number}.png"

    def picture(self, number: int) -> bytes:
        """PNG. Raises `Faulty` where there is none."""
        with contextlib.suppress(OSError):
            if self[number].about is not None:
                return self._picture(number).read_bytes()
        raise Faulty(f"no picture of map {number}", "one that was read", "wait for it")

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._errand is not None:
            self._errand.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        if self._home is not None:
            self._home.remove()


__all__ = ["Laid", "Maps", "Placed", "Window"]
