"""Exports of births and children: files for other programs, which a process of its own writes
within limits. Every file has the attribution, in the file or in a file beside it."""

import io
import re
import tempfile
import threading
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from evocity.analysis import Individual, Run
from evocity.analysis.individual import facts_of_buildings, place_of
from evocity.errors import EvocityError, RunError
from evocity.kinds import KINDS
from evocity.studio.children import MOST_CHILDREN, Breeding
from evocity.studio.request_fields import Body, Id, typed_field
from evocity.studio.subprocesses import DeskJob

#: Births in one export, at most; bytes of memory, and seconds for each.
MOST, MEMORY, SECONDS = 20, 4 << 30, 180.0
_NO_CREDIT = (".npy",)


class _Format(NamedTuple):
    """A file format: a scene, a "map" or a "genome"; whether its coordinates may be converted."""

    title: str
    suffix: str
    of: str = "scene"
    is_placed: bool = True


#: The formats, by their names on the page.
FORMATS = {
    "gpkg": _Format("GeoPackage, footprints for GIS", ".gpkg"),
    "glb": _Format("GLB, for Blender and browsers", ".glb"),
    "obj": _Format("OBJ, for modellers", ".obj"),
    "dxf": _Format("DXF, for CAD", ".dxf"),
    "3dm": _Format("3DM, for Rhino", ".3dm"),
    "cityjson": _Format("CityJSON, for GIS in 3D", ".city.json"),
    "png": _Format("PNG, a picture in 3D", ".png", is_placed=False),
    "map-png": _Format("PNG, a picture of the map", ".png", "map", is_placed=False),
    "tif": _Format("GeoTIFF, heights", ".tif", "map"),
    "geojson": _Format("GeoJSON, footprints", ".geojson", "map"),
    "fgb": _Format("FlatGeobuf, footprints", ".fgb"),
    "geoparquet": _Format("GeoParquet, footprints", ".geoparquet"),
    "stl": _Format("STL, for printers", ".stl", is_placed=False),
    "3mf": _Format("3MF, for printers", ".3mf", is_placed=False),
    "wrl": _Format("VRML97", ".wrl"),
    "x3d": _Format("X3D", ".x3d"),
    "npy": _Format("NumPy, heights", ".npy", "map", is_placed=False),
    "genome": _Format("genome of evocity", ".parquet", "genome", is_placed=False),
}


class ExportRequest(Body):
    """A request for births (``ids``), or for ``children`` of a ``brood``, as files of a ``format``.

    ``at``: the source city whose place the files get; the other fields are options of `scene`."""

    format: Annotated[str, Field(max_length=20)]
    ids: Annotated[tuple[Id, ...], Field(max_length=MOST)] = ()
    brood: Annotated[int, Field(ge=0, lt=2**31)] = 0
    children: Annotated[tuple[Id, ...], Field(max_length=MOST_CHILDREN)] = ()
    board: bool = False
    at: Annotated[str | None, Field(max_length=500)] = None
    crs: Annotated[
        str | None,
        typed_field(
            "reference system", "a code such as EPSG:2154, at most 200 letters", max_length=200
        ),
    ] = None
    streets: bool = False
    level: Annotated[str | None, Field(max_length=10)] = None


class Subject(NamedTuple):
    """A birth or a child: its genome, its values, its name in files, and its title."""

    genome: Any
    values: Mapping[str, float]
    name: str
    title: str


def subjects_of(run: Run, breeding: Breeding, request: ExportRequest) -> list[Subject]:
    """Return the births and children of a ``request``. Raises `RunError` for unknown ones."""
    births = [Individual(run.columns, n) for n in dict.fromkeys(request.ids)]
    subjects = [
        Subject(one.genome, one.scores, str(one.id), f"individual {one.id}") for one in births
    ]
    for number in dict.fromkeys(request.children):
        child = breeding.child(request.brood, number)
        genome = None if child.genome is None else run.with_roofs(child.genome)
        values = {name: value for name, value in child.values.items() if value == value}
        subjects.append(Subject(genome, values, f"child-{number}", f"child {number}"))
    if not subjects:
        raise RunError(
            "the export has no births",
            f"1 to {MOST} births or children",
            "choose a birth, or pick one",
        )
    return subjects


@cache
def _options_of(name: str) -> dict[str, Any]:
    """Return the options of a format: whether it takes streets, and its levels of detail."""
    from evocity.scene.detail import LEVELS, check_format

    def has(level: str, streets: bool = False) -> bool:
        try:
            check_format(level, kind.suffix, streets)
        except EvocityError:
            return False
        return kind.of == "scene"

    kind = FORMATS[name]
    levels = [level for level in LEVELS if has(level)]
    about = {"name": name, "title": kind.title, "placed": kind.is_placed}
    return about | {"streets": has("1.3", True), "levels": levels}


def list_formats(run: Run) -> dict:
    """Return the formats with their options; the source cities whose place a file may get, none if
    all source cities have one place; and whether there is a place at all."""
    cities = () if run.header.crs is not None else run.sources()
    places = [one.name for one in cities if one.city.crs is not None]
    formats = [_options_of(name) for name in FORMATS]
    placed = bool(places) or run.header.crs is not None
    return {"formats": formats, "places": places, "placed": placed}


class Exports:
    """The exports of a studio: one at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._job: DeskJob | None = None

    def close(self) -> None:
        if (job := self._job) is not None:
            job.stop()

    def write(
        self, run: Run, subjects: Sequence[Subject], request: ExportRequest
    ) -> tuple[str, bytes]:
        """Write ``subjects``; return the name and the content of a file, a zip of several files.

        Raises `EvocityError` for options that do not fit, and beyond the limits."""
        if request.format not in FORMATS:
            raise RunError(
                f"the format {request.format!r} is unknown",
                f"one of {', '.join(FORMATS)}",
                "choose one of these formats",
            )
        if not self._lock.acquire(blocking=False):
            raise RunError(
                "studio is already writing a file",
                "one export at a time",
                "wait until the other file is written",
            )
        try:
            return self._write(run, subjects, request)
        finally:
            self._job = None
            self._lock.release()

    def _write(self, run: Run, subjects: Sequence[Subject], request: ExportRequest):
        kind = FORMATS[request.format]
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", run.name)[:60].strip(".-") or "run"
        with tempfile.TemporaryDirectory() as folder:
            entries = []
            for place, one in enumerate(subjects):
                genome = Path(folder) / f"{place}.genome.parquet"
                one.genome.write(genome)
                file = Path(folder) / "files" / f"{stem}-{one.name}{kind.suffix}"
                title = f"{run.name}, {one.title}"
                entry = {"genome": str(genome), "file": str(file), "title": title}
                entries.append(entry | {"values": one.values})
            (Path(folder) / "files").mkdir()
            job = {"job": "export", "kind": run.header.kind, "entries": entries}
            job |= {"place": {} if request.at is None else place_of(run, request.at)}
            job |= {"of": kind.of, "crs": request.crs or None}
            job |= {"streets": request.streets, "level": request.level}
            self._job = DeskJob(
                MEMORY,
                SECONDS * len(entries),
                f"the export as {kind.title}",
                "a smaller map, or a coarser level of detail",
            )
            cut: list[bool] = []
            self._job.run(job, lambda result: cut.append(result["cut"]))
            if len(cut) < len(entries):
                raise RunError("the export ended early", "all files", "export the births again")
            files = sorted((Path(folder) / "files").iterdir())
            if len(files) == 1 and not any(cut):
                return files[0].name, files[0].read_bytes()
            credit = run.header.attribution.replace("; ", "\n") or "The source maps state none."
            return f"{stem}-{subjects[0].name}.zip", _zip(files, credit)


def _zip(files: Sequence[Path], credit: str) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.name)
        archive.writestr("ATTRIBUTION.txt", f"{credit}\n")
    return content.getvalue()


def write_exports(job: Mapping, send: Callable) -> None:
    """Write the files of a ``job``; send for each whether it has ``cut`` the attribution."""
    from evocity.io import write_map
    from evocity.scene import scene, suffix_of
    from evocity.scene.export import cuts_attribution

    kind, crs = KINDS[job["kind"]], job["crs"]
    place = {key: tuple(at) if key == "origin" else at for key, at in job["place"].items()}
    for entry in job["entries"]:
        path = Path(entry["file"])
        genome = kind.read(Path(entry["genome"])).replace(**place)
        if job["of"] == "genome":
            genome.write(path)
            send(cut=False)
            continue
        expressed = kind.express(genome)
        if expressed.city is None:
            raise RunError(
                f"{entry['title']} has no map: {expressed.problem}",
                "a genome that decodes to a map",
                "choose another birth",
            )
        city = expressed.city.replace(expressed.city.heights, name=entry["title"])
        if job["of"] == "map":
            write_map(city, path, crs=crs)
            send(cut=path.suffix in _NO_CREDIT)
            continue
        facts = {"measures": entry["values"], **facts_of_buildings(city, genome)}
        made = scene(city, streets=job["streets"], lod=job["level"], **facts)
        made.write(path, crs=crs)
        send(cut=cuts_attribution(suffix_of(path) or "", made.about))
