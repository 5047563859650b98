"""Tiles of a scene: files per tile and level of detail, which meet exactly, and their tileset."""

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evocity import formats
from evocity.citymap import CityMap
from evocity.errors import MapError, is_whole, keyword, setting
from evocity.formats import About, Group
from evocity.formats.kerbs import kerbs_near
from evocity.formats.materials import is_surface
from evocity.formats.tileset import Content, tileset
from evocity.formats.trees import mesh_of
from evocity.io.writers import check_place, open_output
from evocity.scene.blocks import walls_at
from evocity.scene.building import Scene
from evocity.scene.cutting import cut_surfaces, with_crossings
from evocity.scene.detail import CITYJSON, LEVELS, Level, check_level
from evocity.scene.globe import globe_transform
from evocity.scene.noding import join_nodes

if TYPE_CHECKING:
    from pyproj import CRS

#: Name of the file that lists all tiles, the key of evocity's own entries in it, and the key of the
#: settings of the map in these.
TILESET, OWN, SETTINGS = "tileset.json", "evocity", "settings"
#: Least side of a tile, pixels.
_LEAST_SIDE = 16


def write_tiles(
    scene: Scene,
    folder: str | os.PathLike,
    side: int = 256,
    *,
    levels: Sequence[str] | None = None,
    margin: int = 0,
    crs: str | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write a scene as tiles: a folder with a ``tileset.json`` of 3D Tiles 1.1, a .glb file for
    each tile and level of detail, and a CityJSONSeq file (.city.jsonl) for each tile. CityJSON has
    no level "afar", so tiles that only have this level have no CityJSONSeq files.

    A building belongs to one tile as a whole, at each level: the tile with the centre of its
    pixels. Ground and streets are cut at the borders of tiles, and two tiles have the same points
    there, bit for bit. Coordinates count from the south-west corner of all tiles. The file
    ``1.3/0-2.glb`` is the tile in the first row from the north and the third column from the west.

    folder : a folder that does not exist, is empty, or holds the tiles of this fabric.
    side : side of a tile, px, 16 or more; it divides the height and the width of the map.
    levels : levels of `evocity.scene.LEVELS` for the .glb files; None means the level of the scene
        and all coarser ones. CityJSONSeq has the finest of them.
    margin : width of a strip around the map that belongs to no tile, px. Its pixels only help to
        find the buildings at the border.
    crs : reference system of the .city.jsonl files, a code such as ``"EPSG:2154"``; None keeps that
        of the map. All other coordinates stay the same.
    settings : how the map was made, values that JSON can hold. The file ``tileset.json`` keeps
        these values, and only the same values may replace the tiles.
    progress : is called with two numbers: the number of finished files, and the number of all
        files.

    Returns facts: ``tiles``, ``levels``, ``files``, ``bytes``, and ``buildings`` and ``triangles``
    by level. Raises `MapError` for a side that does not divide the map, for a level that is unknown
    or finer than the scene, for a ``crs`` that does not fit, for a folder that holds other files,
    and for files that cannot be written. An error leaves no partial file.
    """
    folder, city = Path(folder), scene.city
    grid = _Grid.of(city, side, margin)
    names = _levels(scene, levels)
    target, code = _system(city, crs)
    if target is not None and names[0] not in CITYJSON:
        raise MapError(
            f"tiles of LoD {names[0]} have no .city.jsonl files for {keyword('crs', crs)}",
            f"a level that CityJSON has: {', '.join(sorted(CITYJSON))}",
            f"choose another level, or leave {keyword('crs')} out",
        )
    settings = json.loads(json.dumps(dict(settings or {})))
    fabric = _digest(scene, grid, names, code)
    check_tiles_folder(folder, settings, fabric)
    writer = _Writer(scene, folder, grid, target)
    total = len(grid) * (len(names) + (names[0] in CITYJSON))
    facts: dict[str, Any] = {"tiles": len(grid), "levels": names, "files": 0, "bytes": 0}
    facts |= {"buildings": {}, "triangles": {}}
    contents: dict[tuple[int, int], list[Content]] = {place: [] for place in grid.places}
    for name in reversed(names):  # the coarsest first
        found = writer.write_level(Level(name), name == names[0] and name in CITYJSON)
        facts["buildings"][name] = facts["triangles"][name] = 0
        for place, content, counts in found:
            contents[place].append(content)
            for key, count in counts.items():
                if isinstance(facts[key], dict):
                    facts[key][name] += count
                else:
                    facts[key] += count
            if progress is not None:
                progress(facts["files"], total)
    about = writer.about
    own = {"version": 1, "fabric": fabric, "tile": side, "rows": grid.rows, "columns": grid.columns}
    own |= {"metres_per_pixel": city.metres_per_pixel, "levels": names, "crs": about.crs or ""}
    own |= {"offset": list(about.offset), "name": about.name, "attribution": about.attribution}
    own |= {SETTINGS: settings}
    asset = {"copyright": about.attribution} if about.attribution else {}
    text = tileset(
        [levels for levels in contents.values() if levels],
        globe_transform(about.crs, about.offset, grid.size),
        {"extras": asset} if asset else {},
        {OWN: own},
    )
    facts["bytes"] += _write(folder / TILESET, text.encode())
    facts["files"] += 1
    return facts


@dataclasses.dataclass(frozen=True)
class _Grid:
    """Square tiles of ``side`` px in ``rows`` and ``columns``, within a ``margin``, px."""

    rows: int
    columns: int
    side: int
    margin: int
    pixel: float

    @classmethod
    def of(cls, city: CityMap, side: int, margin: int) -> "_Grid":
        """Divide a map, or raise `MapError`."""
        high, wide = (length - 2 * margin for length in city.shape)
        check_side(side, high, wide)
        return cls(high // side, wide // side, int(side), margin, city.metres_per_pixel)

    def __len__(self) -> int:
        return self.rows * self.columns

    @property
    def places(self) -> list[tuple[int, int]]:
        """(row from the north, column) of each tile."""
        return [(row, column) for row in range(self.rows) for column in range(self.columns)]

    @property
    def size(self) -> tuple[float, float]:
        """Metres along and down all tiles."""
        metres = self.side * self.pixel
        return self.columns * metres, self.rows * metres

    @property
    def across(self) -> list[float]:
        """The borders of tiles, metres from the west."""
        return [k * self.side * self.pixel for k in range(self.columns + 1)]

    @property
    def down(self) -> list[float]:
        """The borders of tiles, metres from the south."""
        return [k * self.side * self.pixel for k in range(self.rows + 1)]

    def number(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The tile of places y px from the north and x px from the west of the map, row by row; −1
        outside."""
        row, column = self._place(y, x)
        inside = (row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns)
        return np.where(inside, row * self.columns + column, -1)

    def number_all(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The tile of places, as `number`, but each tile of the margin has a number of its own."""
        row, column = self._place(y, x)
        around = -(-self.margin // self.side)
        return (row + around) * (self.columns + 2 * around) + column + around

    def _place(self, y: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        row, column = (np.floor((at - self.margin) / self.side).astype(np.int64) for at in (y, x))
        return row, column


class _Writer:
    """Writes the files of tiles, level by level."""

    def __init__(self, scene: Scene, folder: Path, grid: _Grid, target: "CRS | None"):
        self.scene, self.folder, self.grid, self.target = scene, folder, grid, target
        labels = scene.city.building_labels
        pixels = np.bincount(labels.ravel())[1:]
        rows, columns = np.indices(labels.shape, np.int32)
        y, x = (
            (np.bincount(labels.ravel(), at.ravel())[1:] / pixels + 0.5) for at in (rows, columns)
        )
        self.owners, self.apart = grid.number(y, x), grid.number_all(y, x)
        self.shift = grid.margin * grid.pixel
        about = scene.about
        offset = (about.offset[0] + self.shift, about.offset[1] + self.shift)
        if about.crs is None:
            offset = about.offset
        self.about: About = dataclasses.replace(about, offset=offset, size=grid.size)

    def write_level(
        self, level: Level, lines: bool
    ) -> Iterator[tuple[tuple[int, int], Content, dict[str, int]]]:
        """Write the files of all tiles at a ``level``; yield the place and the content of each, and
        counts. ``lines``: whether to write CityJSONSeq files too."""
        scene = at_level(self.scene, level, self.apart)
        about = dataclasses.replace(self.about, lod=level.name)
        parts = self._divided(scene.groups, level.name)
        (self.folder / level.name).mkdir(parents=True, exist_ok=True)
        for number, place in enumerate(self.grid.places):
            groups = [group for group in parts[number] if len(group)]
            if not groups:
                continue
            name = f"{level.name}/{place[0]}-{place[1]}"
            counts = {"files": 1, "buildings": 0}
            meshes = [mesh_of(group) for group in groups]
            counts["triangles"] = sum(len(mesh.triangles) for mesh in meshes)
            for group in groups:
                ids = group.attributes.get("id", [])
                counts["buildings"] += sum(one is not None for one in ids)
            data = formats.glb(groups, about, merge=True)
            counts["bytes"] = _write(self.folder / f"{name}.glb", data)
            if lines:
                text = formats.cityjson_lines(*self._placed(groups, about))
                counts["bytes"] += _write(self.folder / f"{name}.city.jsonl", text.encode())
                counts["files"] += 1
            points = np.concatenate([mesh.points[mesh.triangles.ravel()] for mesh in meshes])
            least, most = (
                (float(x), float(y), float(z))
                for x, y, z in (points.min(axis=0), points.max(axis=0))
            )
            yield place, Content(f"{name}.glb", least, most, level.error), counts

    def _placed(self, groups: Sequence[Group], about: About) -> tuple[Sequence[Group], About]:
        """Convert groups and their description to the reference system of CityJSONSeq files."""
        if self.target is None:
            return groups, about
        from evocity.scene.reprojection import reproject_scene

        return reproject_scene(groups, about, self.scene.city, self.target)

    def _divided(self, groups: Sequence[Group], level: str) -> list[list[Group]]:
        """Divide the groups of a scene at a ``level``: the groups of each tile. A wall that crosses
        a border has the point on the ground at which the surfaces beside it are cut."""
        parts: list[list[Group]] = [[] for _ in self.grid.places]
        for group in map(self._moved, groups):
            if is_surface(group):
                pieces = cut_surfaces(group.polygons, self.grid.across, self.grid.down)
                for (row, column), (polygons, of) in pieces.items():
                    number = (self.grid.rows - 1 - row) * self.grid.columns + column
                    own = dataclasses.replace(group.take(of), polygons=polygons)
                    if group.kerbs is not None and len(polygons):
                        box = shapely.total_bounds(polygons)
                        own = dataclasses.replace(own, kerbs=kerbs_near(group.kerbs, box))
                    parts[number].append(own)
                continue
            tile = self._tiles(group)
            if self.scene.streets and level != "afar" and group.copies is None:
                feet = with_crossings(group.polygons, self.grid.across, self.grid.down)
                (group,) = join_nodes([group], [dataclasses.replace(group, polygons=feet)])
            for number, own_parts in enumerate(parts):
                own_parts.append(group.take(np.flatnonzero(tile == number)))
        return parts

    def _moved(self, group: Group) -> Group:
        """Move a group so that its metres count from the corner of the tiles."""
        if not self.shift:
            return group
        polygons = shapely.transform(group.polygons, lambda points: points - self.shift)
        copies = group.copies
        if copies is not None:
            copies = dataclasses.replace(copies, places=copies.places - self.shift)
        roofs = None if group.roofs is None else group.roofs.move((self.shift, self.shift))
        kerbs = group.kerbs
        if kerbs is not None:
            kerbs = shapely.transform(kerbs, lambda points: points - self.shift)
        changes = {"polygons": polygons, "copies": copies, "roofs": roofs, "kerbs": kerbs}
        return dataclasses.replace(group, **changes)

    def _tiles(self, group: Group) -> np.ndarray:
        """Choose the tile of each solid of a group: that of its building, or of its middle."""
        middle = shapely.get_coordinates(shapely.centroid(group.polygons)) + self.shift
        x, y = (middle / self.grid.pixel).reshape(-1, 2).T
        tile = self.grid.number(self.scene.city.shape[0] - y, x)
        for k, own in enumerate(group.attributes.get("id", [])):
            if own is not None:
                tile[k] = self.owners[own - 1]
        return tile


def check_side(side: int, high: int, wide: int) -> None:
    """Raise `MapError` unless tiles of ``side`` px divide a map of ``high`` × ``wide`` px."""
    if not is_whole(side, _LEAST_SIDE):
        raise MapError(
            f"{setting('side', side)} is out of range",
            f"a whole number of pixels, {_LEAST_SIDE} or more",
            "choose for example 256",
        )
    if high < side or wide < side or high % side or wide % side:
        fits = [n for n in range(_LEAST_SIDE, min(high, wide) + 1) if not (high % n or wide % n)]
        near = min(fits, key=lambda n: abs(n - side), default=None)
        whole = " × ".join(str(max(round(length / side), 1) * side) for length in (high, wide))
        raise MapError(
            f"tiles of {side} px do not divide the map of {high} × {wide} px",
            "a side that divides the height and the width of the map",
            f"choose tiles of {near} px" if near else f"choose a map of {whole} px",
        )


def at_level(scene: Scene, level: Level, owners: np.ndarray | None = None) -> Scene:
    """Return a scene at another level of detail, whose buildings stay apart where their ``owners``,
    int ``(n,)``, differ."""
    if level.name == scene.lod:
        return scene
    walls = walls_at(scene.city, level, scene.fitting, owners)
    return dataclasses.replace(scene, walls=walls, lod=level.name, substitution=None)


def _system(city: CityMap, crs: str | None) -> "tuple[CRS | None, str]":
    """Return the reference system ``crs`` of a map in metres, and its code."""
    if crs is None:
        return None, ""
    from evocity.io.export.reference_systems import export_system
    from evocity.io.projection import code_of  # slow to load

    target = export_system(city, crs, metres=True)
    assert target is not None
    return target, code_of(target)


def _levels(scene: Scene, levels: Sequence[str] | None) -> list[str]:
    """The levels to write, from the finest to the coarsest."""
    coarser = LEVELS[LEVELS.index(scene.lod) :]
    if levels is None:
        return [name for name in coarser if name != "0" or scene.lod == "0"]
    wrong = [name for name in map(check_level, levels) if name not in coarser]
    if wrong or not levels:
        raise MapError(
            f"LoD {', '.join(wrong)} is finer than the scene" if wrong else "no level of detail",
            f"levels of a scene of LoD {scene.lod}: {', '.join(coarser)}",
            f"leave {keyword('levels')} out, or make a finer scene",
        )
    return [name for name in coarser if name in levels]


def _digest(scene: Scene, grid: _Grid, levels: Sequence[str], crs: str) -> str:
    """Compute the digest of a fabric and of all that decides its tiles."""
    city, about = scene.city, scene.about
    described: list[Any] = [city.shape, dataclasses.astuple(grid), about.crs, about.offset, crs]
    described += [list(levels), scene.lod, scene.streets, scene.storey, dict(scene.measures)]
    digest = hashlib.sha256(json.dumps(described, default=str).encode())
    digest.update(np.ascontiguousarray(city.heights).tobytes())
    if scene.water is not None:
        digest.update(np.packbits(scene.water).tobytes())
    if scene.curved is not None:
        digest.update(f"{scene.curved.rise} {scene.curved.heights.shape}".encode())
        digest.update(scene.curved.heights.tobytes())
    classes, laid = scene.classes, scene.substitution
    described = [classes.table.names, classes.table.rgb.tolist(), list(scene.sources)]
    polygons: list[Any] = [scene.walls.polygons]
    numbers = [scene.walls.heights, classes.classes, classes.labels]
    if laid is not None:
        described.append(laid.ids)
        polygons.append(laid.polygons)
        numbers += [laid.heights, laid.transforms, laid.vertical]
    digest.update(json.dumps(described, default=str).encode())
    for array in numbers:
        digest.update(np.ascontiguousarray(array).tobytes())
    for own in polygons:
        digest.update(b"".join(shapely.to_wkb(np.array(own, dtype=object))))
    return digest.hexdigest()


def check_tiles_folder(
    folder: Path, settings: Mapping[str, Any] | None = None, fabric: str | None = None
) -> None:
    """Raise `MapError` if a folder holds anything but tiles with the same ``settings`` and of the
    same ``fabric``. None allows any settings, or any fabric."""
    check_place(folder / TILESET if folder.is_dir() else folder)
    if not folder.exists():
        return
    what = ""
    if (folder / TILESET).exists():
        try:
            document = json.loads((folder / TILESET).read_text(encoding="utf-8"))
            own = document["extras"][OWN]
            held, made = own["fabric"], own.get(SETTINGS, {})
            wrong = [] if settings is None else _differing(made, settings)
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            held, wrong = "unknown", []
        if wrong and made and settings:
            what = f"tiles of another fabric, which differs in {', '.join(wrong)}"
        elif wrong or (fabric is not None and held != fabric):
            what = "tiles of another fabric, or tiles with other options"
    elif any(path.name not in LEVELS for path in folder.iterdir()):
        what = "other files"
    if what:
        raise MapError(
            f"the folder {str(folder)!r} holds {what}",
            "a folder that does not exist, is empty, or holds the tiles of this fabric",
            "choose another folder, or remove this one first",
        )


def _differing(held: Mapping[str, Any], settings: Mapping[str, Any]) -> list[str]:
    """List the names of settings whose values differ."""
    same = json.loads(json.dumps(dict(settings)))
    return sorted(name for name in {*held, *same} if held.get(name, ...) != same.get(name, ...))


def _write(path: Path, data: bytes) -> int:
    with open_output(path) as temporary:
        temporary.write_bytes(data)
    return len(data)
