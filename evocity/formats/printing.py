"""STL and 3MF for printers: the solids of a scene on a plate, in millimetres.

Each solid is closed, and reaches half into the plate, so that slicers join all solids.
"""

import io
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import shapely

from evocity.errors import MapError, check_number
from evocity.formats.ascii_text import to_ascii
from evocity.formats.solids import About, Group, Mesh

#: The longest side of a print by default, and the thickness of its plate, millimetres.
SIDE, PLATE = 200.0, 2.0
#: The smallest and the largest side of a print, millimetres.
SIDES = (10.0, 10_000.0)
#: Bytes of the header of an STL file.
HEADER = 80

# Holes of a plate below this area, and steps of its outline, are rounding; m² and metres.
_HOLE, _GRAIN = 1.0, 0.01

_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_TYPES = """<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""
_RELATIONS = """<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="model"
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""

Part = tuple[str, tuple[float, float, float], Mesh]


def stl(groups: Sequence[Group], about: About, side: float = SIDE) -> bytes:
    """Write a binary STL. ``side`` is the longest side of the print, mm. Raises `MapError` unless
    it is in `SIDES`."""
    corners, normals = [], []
    for _, _, mesh in _parts(groups, about, side):
        corners.append(mesh.points[mesh.triangles])
        normals.append(mesh.normals)
    rows = np.concatenate(corners)
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    table = np.zeros(len(rows), kind)
    table["normal"], table["corners"] = np.concatenate(normals), rows
    header = f"{stl_credit(about)}, {to_ascii(about.name)}"[:HEADER].ljust(HEADER).encode()
    return header + np.uint32(len(rows)).astype("<u4").tobytes() + table.tobytes()


def stl_credit(about: About) -> str:
    """Return the attribution that the header of an STL file begins with, in ASCII. A header has
    room for `HEADER` bytes; `stl` cuts the rest."""
    # a header that begins with "solid" would mean text
    return ", ".join(filter(None, ("evocity", to_ascii(about.attribution))))


def threemf(groups: Sequence[Group], about: About, side: float = SIDE) -> bytes:
    """Write a 3MF package: an object for the plate and for each class, with colours. Source: 3MF
    Core Specification 1.3. ``side`` and errors as of `stl`."""
    parts = list(_parts(groups, about, side))
    colours = "".join(
        f'<base name={quoteattr(name)} displaycolor="{_hex(colour)}"/>' for name, colour, _ in parts
    )
    objects = "".join(_object(k, name, mesh) for k, (name, _, mesh) in enumerate(parts))
    items = "".join(f'<item objectid="{k + 2}"/>' for k in range(len(parts)))
    notes = {"Title": about.name, "Copyright": about.attribution, "Application": "evocity"}
    metadata = "".join(
        f'<metadata name="{name}">{escape(text)}</metadata>' for name, text in notes.items() if text
    )
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" '
        f'xmlns="{_CORE}">{metadata}<resources><basematerials id="1">{colours}</basematerials>'
        f"{objects}</resources><build>{items}</build></model>\n"
    )
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in (
            ("[Content_Types].xml", _TYPES),
            ("_rels/.rels", _RELATIONS),
            ("3D/3dmodel.model", model),
        ):
            # a fixed date, so that equal scenes make equal files
            package.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), text,
                             zipfile.ZIP_DEFLATED)  # fmt: skip
    return data.getvalue()


def _object(number: int, name: str, mesh: Mesh) -> str:
    used, index = np.unique(mesh.triangles, return_inverse=True)
    vertices = "".join(
        f'<vertex x="{x:.4f}" y="{y:.4f}" z="{z:.4f}"/>' for x, y, z in mesh.points[used].tolist()
    )
    triangles = "".join(
        f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in index.reshape(-1, 3).tolist()
    )
    return (
        f'<object id="{number + 2}" type="model" name={quoteattr(name)} pid="1" '
        f'pindex="{number}"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object>"
    )


def _parts(groups: Sequence[Group], about: About, side: float) -> Iterator[Part]:
    """Yield name, colour and mesh of the plate and of each class, in mm."""
    check_number("side", side, *SIDES, "millimetres, 10 to 10000", MapError)
    scale = side / max(about.size)
    plate = _plate(groups)
    mesh = Group("plate", (0.86, 0.84, 0.79), plate, np.ones(len(plate))).mesh
    yield "plate", (0.86, 0.84, 0.79), _scale(mesh, scale, np.where(mesh.points[:, 2], 0, -PLATE))
    for group in groups:
        high = np.flatnonzero(group.heights > 0)
        if not len(high):
            continue
        mesh = replace(group, floors=True).mesh
        mesh = mesh.select(np.isin(mesh.owner, high))
        z = mesh.points[:, 2]
        yield group.name, group.colour, _scale(mesh, scale, np.where(z > 0, z * scale, -PLATE / 2))


def _scale(mesh: Mesh, scale: float, z: np.ndarray) -> Mesh:
    points = np.column_stack([mesh.points[:, :2] * scale, z])
    return Mesh(points, mesh.triangles, mesh.owner, mesh.part)


def _plate(groups: Sequence[Group]) -> np.ndarray:
    """Return the polygons below all surfaces and solids, without gaps of rounding."""
    whole = shapely.union_all(
        shapely.set_precision(np.concatenate([group.polygons for group in groups]), _GRAIN)
    )
    parts = shapely.get_parts(whole)
    parts = parts[shapely.get_type_id(parts) == 3]
    kept = [
        shapely.Polygon(
            part.exterior, [hole for hole in part.interiors if shapely.Polygon(hole).area > _HOLE]
        )
        for part in parts.tolist()
    ]
    return np.array(kept, dtype=object)


def _hex(colour: tuple[float, float, float]) -> str:
    return "#" + bytes(round(255 * channel) for channel in colour).hex().upper()
