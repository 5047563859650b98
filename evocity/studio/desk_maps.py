"""The maps on the desk: bundled districts, and files that a user brought. A file gets a number and
the suffix of a known format; its name is text and never a path."""

import contextlib
import shutil
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from evocity.citymap import MAX_SIDE, PIXEL_SIDES
from evocity.errors import (
    EvocityError,
    MapError,
    cut_short,
    describe_error,
    format_bytes,
    plain_text,
    spell,
)
from evocity.files import ProcessFolder
from evocity.io.bundled_cities import DISTRICTS
from evocity.io.map_paths import FOLDERS
from evocity.io.map_reader import READERS
from evocity.studio.request_fields import Body, RequestError, fault_of, typed_field, whole_field
from evocity.studio.subprocesses import DeskJob

#: Bytes of all files on the desk, and their number; at most.
MOST_BYTES, MOST_MAPS = 1_000_000_000, 16
#: Bytes of memory, and seconds a map, for reading; at most.
MEMORY, SECONDS = 4 << 30, 120.0
#: The suffixes of maps in a single file.
SUFFIXES = tuple(
    sorted((one for one in READERS if one not in (".shp", *FOLDERS)), key=len, reverse=True)
)
_LETTERS = 80  # bytes of a title

Number = Annotated[int, Field(ge=0, lt=2**31)]
_METRES = "a number of metres from {:f} to {:.0f}".format(*PIXEL_SIDES)


def _metres(name: str) -> Any:
    return typed_field(name, _METRES, ge=PIXEL_SIDES[0], le=PIXEL_SIDES[1])


class Window(Body):
    """The window at which all maps are read."""

    pixels: Annotated[int, whole_field("width of the square map in pixels", 8, MAX_SIDE)] = 256
    metres_per_pixel: Annotated[float, _metres("metres per pixel")] = 2.0


class MapChoice(Body):
    """One map, whether it is a parent, and options of `evocity.read_map`."""

    map: Number
    chosen: bool = False
    center: Annotated[
        tuple[Annotated[float, Field(ge=-180, le=180)], Annotated[float, Field(gt=-90, lt=90)]]
        | None,
        typed_field("centre", "longitude from -180 to 180, latitude between -90 and 90"),
    ] = None
    layer: Annotated[
        str | None,
        typed_field(
            "layer that contains the buildings", "1 to 100 letters", min_length=1, max_length=100
        ),
    ] = None
    height_column: Annotated[
        str | None,
        typed_field("column of heights", "1 to 100 letters", min_length=1, max_length=100),
    ] = None
    levels_column: Annotated[
        str | None,
        typed_field("column of storeys", "1 to 100 letters", min_length=1, max_length=100),
    ] = None
    default_height: Annotated[float | None, _metres("default height")] = None
    height_scale: Annotated[float | None, _metres("metres of a grey level or unit")] = None
    nodata: Annotated[float | None, typed_field("value of missing pixels", "a number")] = None
    terrain: Annotated[
        float | None,
        typed_field("elevation of the ground", "a number of metres", ge=-1000, le=10_000),
    ] = None
    terrain_map: Number | None = None

    @property
    def options(self) -> dict[str, Any]:
        hidden = {"map", "chosen", "terrain_map"}
        return self.model_dump(exclude=hidden, exclude_none=True, mode="json")


def without_map(choices: Iterable[MapChoice], number: int) -> tuple[MapChoice, ...]:
    """Return ``choices`` without the map ``number``, which is the ground of no other map either."""
    return tuple(
        choice.model_copy(update={"terrain_map": None}) if choice.terrain_map == number else choice
        for choice in choices
        if choice.map != number
    )


@dataclass
class MapEntry:
    """One map: the facts ``about`` it or the ``fault``; ``turn``, how often it was read; the
    options ``requested`` and those of the last reading (``read``)."""

    number: int
    title: str
    source: str
    suffix: str = ""
    size: int = 0
    about: dict | None = None
    fault: dict | None = None
    turn: int = 0
    requested: dict = field(default_factory=dict)
    read: dict | None = None

    @property
    def is_own(self) -> bool:
        return bool(self.suffix)

    @property
    def state(self) -> dict:
        return {
            "map": self.number,
            "title": self.title,
            "own": self.is_own,
            "size": self.size,
            "takes": sorted(READERS[self.suffix].takes) if self.is_own else [],
            "about": self.about,
            "fault": self.fault,
            "turn": self.turn,
            "reading": self.read != self.requested,
        }


class Maps:
    """All maps on the desk, by number. One thread has processes read them."""

    def __init__(self) -> None:
        self._home: ProcessFolder | None = None
        self._changed = threading.Condition()
        self._entries = {
            number: MapEntry(number, name, name) for number, name in enumerate(sorted(DISTRICTS))
        }
        self._next = len(self._entries)
        self._window = Window()
        self._thread: threading.Thread | None = None
        self._job: DeskJob | None = None
        self._closed = False

    def __getitem__(self, number: int) -> MapEntry:
        with self._changed:
            if number not in self._entries:
                raise RequestError(
                    f"the page has no map {number}",
                    "the number of a map on the page",
                    "load the page again",
                )
            return self._entries[number]

    def __contains__(self, number: int) -> bool:
        with self._changed:
            return number in self._entries

    @property
    def folder(self) -> Path:
        """A temporary folder, made at first use and removed with the desk."""
        with self._changed:
            if self._home is None:
                try:
                    self._home = ProcessFolder("evocity-desk-")
                except OSError as error:
                    raise MapError(
                        f"studio cannot make a temporary folder: {error.strerror or error}",
                        "free space for a temporary folder",
                        "free some space, or set TMPDIR to another folder and start studio again",
                    ) from error
            return self._home.path

    def states(self) -> list[dict]:
        """Return plain values for the page; the first call starts the reading."""
        with self._changed:
            if self._thread is None and not self._closed:
                self.place(self._window, {})
                self._thread = threading.Thread(target=self._read_all, daemon=True, name="maps")
                self._thread.start()
            return [entry.state for entry in self._entries.values()]

    # -- files -------------------------------------------------------------------------------------

    def begin(self, name: str) -> tuple[Path, str]:
        """Return the path for a file called ``name``, and its suffix. Raises `MapError`."""
        lower = name.lower()
        suffix = next((one for one in SUFFIXES if lower.endswith(one)), None)
        if suffix is None:
            what = "not a map by its name"
            remedy = "convert it; GeoJSON and GeoTIFF are the easiest to check"
            if lower.endswith((".shp", ".dbf", ".shx", ".prj", ".cpg")):
                what = "a part of a Shapefile"
                remedy = "pack all files of the Shapefile into a zip, or save it as GeoPackage"
            expected = f"a single file that ends in {', '.join(sorted(SUFFIXES))}"
            raise MapError(f"{spell(name)} is {what}", expected, remedy)
        with self._changed:
            own = [entry for entry in self._entries.values() if entry.is_own]
            if len(own) >= MOST_MAPS or sum(entry.size for entry in own) >= MOST_BYTES:
                raise MapError(
                    f"the page already has {len(own)} files",
                    f"at most {MOST_MAPS} files, and {format_bytes(MOST_BYTES)} in total",
                    "remove a file, then add the new file",
                )
            number, self._next = self._next, self._next + 1
        return self.folder / f"map-{number}{suffix}", suffix

    def add(self, path: Path, name: str, suffix: str) -> int:
        """Add the file at ``path``, which was called ``name``; return its number."""
        stem = plain_text(name[: -len(suffix)])
        stem = "".join("-" if one in '/\\:*?"<>|' else one for one in stem).strip(" .-")
        stem = cut_short(stem, _LETTERS) or "map"
        with self._changed:
            number = int(path.name[: -len(suffix)].removeprefix("map-"))
            titles = {entry.title for entry in self._entries.values()}
            others = (f"{stem} {k}" for k in range(2, number + 2))
            title = next(one for one in (stem, *others) if one not in titles)
            self._entries[number] = MapEntry(number, title, str(path), suffix, path.stat().st_size)
            self._request(self._entries[number], self._window, {})
        return number

    def drop(self, number: int) -> None:
        """Remove a file that a user brought."""
        entry = self[number]
        if not entry.is_own:
            raise RequestError(
                f"the map {entry.title} comes with evocity and cannot be removed",
                "a map from a file of your own",
                "leave this map on the page without choosing it",
            )
        with self._changed:
            self._entries.pop(number, None)
        for path in (Path(entry.source), self._picture(number)):
            path.unlink(missing_ok=True)

    def copy_chosen(self, choice: MapChoice, folder: Path) -> dict[str, str]:
        """Copy a map and its raster of the ground for a recipe in the ``folder``; return their
        names in the recipe."""
        names = {"map": self.copy(choice.map, folder)}
        if choice.terrain_map is not None:
            names["terrain"] = self.copy(choice.terrain_map, folder)
        return names

    def check(self, choice: MapChoice) -> None:
        """Raise `RequestError` unless the map of a ``choice`` is there, and its ground, if any, is
        a raster from a file, or an elevation."""
        title = self[choice.map].title
        if choice.terrain_map is None:
            return
        entry = self[choice.terrain_map]
        if choice.terrain_map == choice.map:
            raise RequestError(
                f"the map {title} is its own raster of the ground",
                "another raster",
                "choose another raster of the ground, or no raster",
            )
        if choice.terrain is not None:
            raise RequestError(
                f"the map {title} has an elevation of the ground, and a raster of the ground",
                "one of the two",
                "empty the field of the elevation, or choose no raster",
            )
        of_footprints = bool(entry.about and entry.about["rules"])  # in a zip
        if not entry.is_own or of_footprints or "terrain" not in READERS[entry.suffix].takes:
            raise RequestError(
                f"the map {entry.title} is not a raster, so it cannot be the ground of a map",
                "a raster of elevations from a file of your own",
                "choose another raster of the ground",
            )

    def copy(self, number: int, folder: Path) -> str:
        """Copy a map for a recipe in the ``folder``; return its name in the recipe."""
        entry = self[number]
        if entry.is_own:
            path = Path(entry.source)
            shutil.copyfile(path, folder / path.name)
            return path.name
        return entry.source

    # -- reading -----------------------------------------------------------------------------------

    def place(self, window: Window, choices: dict[int, MapChoice]) -> None:
        """Set how maps are read from now on; unchosen districts keep the usual window."""
        with self._changed:
            self._window = window
            for number, entry in self._entries.items():
                choice = choices.get(number, MapChoice(map=number))
                is_set = entry.is_own or choice.chosen
                ground = {}
                if choice.terrain_map is not None:
                    ground["terrain"] = self[choice.terrain_map].source
                self._request(entry, window if is_set else Window(), choice.options | ground)

    def _request(self, entry: MapEntry, window: Window, options: dict) -> None:
        entry.requested = window.model_dump() | options
        self._changed.notify_all()

    def _read_all(self) -> None:
        while True:
            with self._changed:
                while not self._closed and not self._unread():
                    self._changed.wait()
                if self._closed:
                    return
                entries = sorted(self._unread(), key=lambda entry: not entry.is_own)
                options = {entry.number: dict(entry.requested) for entry in entries}
                self._job = job = DeskJob(MEMORY, SECONDS * len(entries), "reading a map")
            try:
                maps = [
                    {
                        "number": entry.number,
                        "map": entry.source,
                        "options": options[entry.number] | {"name": entry.title},
                        "picture": str(self._picture(entry.number)),
                    }
                    for entry in entries
                ]
                job.run({"job": "read", "maps": maps}, partial(self._receive, options))
            except EvocityError as error:
                self._fail(error, options)
            except Exception as error:  # the page shows it; later maps are still read
                fault = f"the map could not be read: {describe_error(error)}"
                remedy = "check whether memory or disk is full, then change how the map is read"
                self._fail(MapError(fault, "a process that reads it", remedy), options)

    def _fail(self, fault: EvocityError, options: dict[int, dict]) -> None:
        """Give the ``fault`` to the first map without a result; the others are read again."""
        with self._changed:
            for number, requested in options.items():
                entry = self._entries.get(number)
                if entry is None:
                    return
                if entry.read != requested:
                    entry.read, entry.about, entry.turn = requested, None, entry.turn + 1
                    entry.fault = fault_of(fault)
                    return

    def _unread(self) -> list[MapEntry]:
        return [entry for entry in self._entries.values() if entry.read != entry.requested]

    def _receive(self, options: dict[int, dict], result: dict) -> None:
        with self._changed:
            entry = self._entries.get(result["map"])
            if entry is None:
                return
            entry.read, entry.turn = options[entry.number], entry.turn + 1
            entry.about = result.get("about")
            entry.fault = fault_of(EvocityError(*result["error"])) if "error" in result else None

    def _picture(self, number: int) -> Path:
        return self.folder / f"picture-{number}.png"

    def picture(self, number: int) -> bytes:
        """Return the picture of a map, PNG. Raises `RequestError` where there is no picture."""
        with contextlib.suppress(OSError):
            if self[number].about is not None:
                return self._picture(number).read_bytes()
        raise RequestError(
            f"map {number} has no picture yet",
            "a map that studio has read",
            "wait until studio has read the map",
        )

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._job is not None:
            self._job.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        if self._home is not None:
            self._home.remove()
