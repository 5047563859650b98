"""The maps on the desk: bundled districts, and files that a user brought. A file gets a number and
the suffix of a known format; its name is text and never a path."""

import contextlib
import io
import os
import shutil
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evocity.citymap import CityMap
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
from evocity.studio.desk_areas import USES, Area, Place
from evocity.studio.desk_map_choice import MapChoice, MapEntry, Number, Window, without_map
from evocity.studio.desk_overview import lon_lat
from evocity.studio.request_fields import RequestError, fault_of
from evocity.studio.subprocesses import LastingJob

#: Bytes of all files on the desk, and their number; at most.
MOST_BYTES, MOST_MAPS = 1_000_000_000, 16
#: Bytes of memory, and seconds a map, for reading; at most.
MEMORY, SECONDS = 4 << 30, 120.0
__all__ = ["MapChoice", "MapEntry", "Maps", "Number", "Window", "without_map"]

#: The suffixes of maps in a single file.
SUFFIXES = tuple(
    sorted((one for one in READERS if one not in (".shp", *FOLDERS)), key=len, reverse=True)
)
_LETTERS = 80  # bytes of a title


@dataclass(frozen=True)
class AreaFile:
    """A file of an area that a user brought, and its name as text."""

    path: Path
    name: str


class Maps:
    """All maps on the desk, by number. One thread has processes read them."""

    def __init__(self) -> None:
        self._home: ProcessFolder | None = None
        self._changed = threading.Condition()
        self._entries = {
            number: MapEntry(number, name, name) for number, name in enumerate(sorted(DISTRICTS))
        }
        self._next = len(self._entries)
        self._areas: dict[int, AreaFile] = {}
        self._window = Window()
        self._thread: threading.Thread | None = None
        self._job: LastingJob | None = None
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
            paths = [entry.source for entry in self._entries.values() if entry.is_own]
            paths += [str(area.path) for area in self._areas.values()]
            if len(paths) >= MOST_MAPS or sum(map(os.path.getsize, paths)) >= MOST_BYTES:
                raise MapError(
                    f"the page already has {len(paths)} files",
                    f"at most {MOST_MAPS} files, and {format_bytes(MOST_BYTES)} in total",
                    "remove a file, then add the new file",
                )
            number, self._next = self._next, self._next + 1
        return self.folder / f"map-{number}{suffix}", suffix

    def add_area(self, path: Path, name: str, suffix: str) -> int:
        """Add the file of an area at ``path``, which was called ``name``; return its number."""
        with self._changed:
            number = int(path.name[: -len(suffix)].removeprefix("map-"))
            self._areas[number] = AreaFile(path, cut_short(plain_text(name), _LETTERS))
        return number

    def add_children(self, children: Iterable[tuple[Path, str]]) -> None:
        """Add kept children, each a genome with its title, unless they are here; drop the others
        that are gone."""
        with self._changed:
            known = {entry.source: entry for entry in self._entries.values() if entry.child}
            for path, title in children:
                if known.pop(str(path), None) is None:
                    name = cut_short(plain_text(title), _LETTERS)
                    entry = MapEntry(self._next, name, str(path), child=True)
                    self._entries[entry.number], self._next = entry, self._next + 1
                    self._request(entry, {})
            for entry in known.values():
                entry.fault = entry.fault or fault_of(_gone(entry.title))

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
            self._entries[number] = MapEntry(number, title, str(path), suffix)
            self._request(self._entries[number], self._window.model_dump())
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
        Path(entry.source).unlink(missing_ok=True)
        self._remove_pictures(number)

    def _remove_pictures(self, number: int) -> None:
        for path in (self._picture(number), self._overview(number)):
            path.unlink(missing_ok=True)

    def copy_chosen(self, choice: MapChoice, folder: Path) -> dict[str, Any]:
        """Copy a map and its raster of the ground for a recipe in the ``folder``; return its keys
        in the recipe. Raises `MapError` for a file that is gone."""
        entry = self[choice.map]
        if entry.child:
            return {"genome": self.copy(choice.map, folder), "name": entry.title}
        keys: dict[str, Any] = {"map": self.copy(choice.map, folder)}
        if choice.terrain_map is not None:
            keys["terrain"] = self.copy(choice.terrain_map, folder)
        if entry.is_own:
            keys["name"] = entry.title
        center = self._center(entry, choice.at)
        return keys | ({"center": list(center)} if center else {}) | choice.options

    def _center(self, entry: MapEntry, at: Place | None) -> tuple[float, float] | None:
        """Return longitude and latitude of the window's middle, if a recipe must name them."""
        if entry.over is None:
            return None
        return entry.over.get("start") if at is None else lon_lat(entry.over["frame"], at)

    def locks(self, number: int) -> tuple[Path, Path] | None:
        """Return the mask and the heights that a child locks; None without a lock."""
        about = self[number].about
        if not about or not about.get("lock_files"):
            return None
        mask, heights = about["lock_files"]
        return Path(mask), Path(heights)

    def marked(self, use: str, area: Area) -> Path:
        """Return the file that marks an ``area`` for a recipe. Raises `MapError` for one that
        cannot be used, and while its map is being read."""
        entry = self[area.map]
        found = ((entry.about or {}).get("areas") or {}).get(use)
        fault = entry.fault or (found or {}).get("fault")
        is_read = entry.read == entry.requested
        if is_read and fault is not None:
            raise MapError(f"{entry.title}: {fault['found']}", fault["expected"], fault["remedy"])
        if found is None or not is_read:
            raise MapError(
                f"studio is still reading the map {entry.title}",
                "a map that studio has read, with its areas",
                "wait a moment, and make the recipe again",
            )
        return Path(found["path"])

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
        if not (entry.is_own or entry.child):
            return entry.source
        name = f"child-{number}.parquet" if entry.child else Path(entry.source).name
        shutil.copyfile(entry.source, folder / name)
        return name

    def check_area(self, area: Area) -> None:
        """Raise `RequestError` unless the map of an ``area`` is there, and its file if it has
        one."""
        entry = self[area.map]
        if entry.child or (area.file is not None and area.file not in self._areas):
            raise RequestError(
                f"the map {entry.title} has no such area",
                "an area drawn on a map of the page, or a file that you brought",
                "load the page again, and draw the area again",
            )

    # -- reading -----------------------------------------------------------------------------------

    def place(
        self,
        window: Window,
        choices: dict[int, MapChoice],
        areas: Mapping[str, Area | None] | None = None,
    ) -> None:
        """Set how maps are read from now on, and the ``areas`` on them, by their use; unchosen
        districts keep the usual window."""
        with self._changed:
            self._window = window
            for number, entry in self._entries.items():
                choice = choices.get(number, MapChoice(map=number))
                if entry.child:
                    self._request(entry, window.model_dump() if choice.chosen else {})
                    continue
                size = window if entry.is_own or choice.chosen else Window()
                options = size.model_dump() | choice.options
                if choice.terrain_map is not None:
                    options["terrain"] = self[choice.terrain_map].source
                if choice.at is not None:
                    options["at"] = list(choice.at)
                here = {use: a for use, a in (areas or {}).items() if a and a.map == number}
                if here:
                    options["areas"] = {use: self._area(use, a) for use, a in here.items()}
                self._request(entry, options)

    def _area(self, use: str, area: Area) -> dict:
        """Return an ``area`` as a job has it."""
        if area.file is not None:
            file = self._areas[area.file]
            return {"file": str(file.path), "name": file.name}
        stem = self.folder / f"{USES[use]}-{area.map}"
        return {"shapes": area.model_dump(mode="json")["shapes"], "stem": str(stem)}

    def area_names(self) -> dict[int, str]:
        """Return the names of the files of areas, by their numbers."""
        with self._changed:
            return {number: area.name for number, area in self._areas.items()}

    def _request(self, entry: MapEntry, requested: dict) -> None:
        entry.requested = requested
        self._changed.notify_all()

    def _read_all(self) -> None:
        while True:
            with self._changed:
                while not self._closed and not self._unread():
                    self._changed.wait()
                if self._closed:
                    break
                entries = [min(self._unread(), key=lambda entry: not entry.is_own)]
                options = {entry.number: dict(entry.requested) for entry in entries}
                self._job = job = self._job or LastingJob(MEMORY, SECONDS, "reading a map")
            try:
                maps = [
                    {
                        "number": entry.number,
                        "map": entry.source,
                        "child": entry.child,
                        "options": options[entry.number] | {"name": entry.title},
                        "picture": str(self._picture(entry.number)),
                        "overview": str(self._overview(entry.number)),
                        "over": entry.over,
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
        if self._job is not None:
            self._job.close()

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
            if entry is None:  # removed while it was read
                self._remove_pictures(result["map"])
                return
            entry.read, entry.turn = options[entry.number], entry.turn + 1
            entry.about, entry.over = result.get("about"), result.get("over") or entry.over
            entry.fault = fault_of(EvocityError(*result["error"])) if "error" in result else None

    def _picture(self, number: int) -> Path:
        return self.folder / f"picture-{number}.npy"

    def _overview(self, number: int) -> Path:
        return self.folder / f"overview-{number}.bin"

    @property
    def scale(self) -> float:
        """The height in metres at which the colours of all pictures end."""
        with self._changed:
            ends = [one.about.get("scale", 0) for one in self._entries.values() if one.about]
        return max(ends, default=0) or 10.0

    def picture(self, number: int) -> bytes:
        """Return the picture of a map, PNG. Raises `RequestError` where there is no picture."""
        from evocity.pictures import render

        with contextlib.suppress(OSError, ValueError):
            entry = self[number]
            if entry.about is not None:
                heights = np.load(self._picture(number))
                city = CityMap(heights, entry.about["pixel"])
                content = io.BytesIO()
                render(city, highest=self.scale, legend=False).save(content, "PNG")
                return content.getvalue()
        raise _missing(number, "picture")

    def overview(self, number: int) -> bytes:
        """Return the content of an overview, see `Overview.write`. Raises `RequestError` where
        there is no overview."""
        with contextlib.suppress(OSError):
            if self[number].over is not None:
                return self._overview(number).read_bytes()
        raise _missing(number, "overview")

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


def _missing(number: int, what: str) -> RequestError:
    return RequestError(
        f"map {number} has no {what} yet",
        "a map that studio has read",
        "wait until studio has read the map",
    )


def _gone(title: str) -> MapError:
    return MapError(
        f"the kept child {title} is no longer on the disk",
        "a genome file in the folder of kept children",
        "choose another map, or restore the folder from a backup",
    )
