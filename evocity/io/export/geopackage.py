"""Writer of GeoPackage: footprints of buildings, the ground between them, and the street graph,
with styles for QGIS."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from evocity.citymap import CityMap, Classes, StreetGraph, Walls
from evocity.formats.materials import GROUND, surface_colour
from evocity.io.export import styles
from evocity.io.export.layers import write_layer
from evocity.io.export.reference_systems import LOCAL, export_system, geotiff_text, is_code
from evocity.io.footprint_files import LAYER, footprints_of, moved, orient
from evocity.pictures.colours import scale_end

if TYPE_CHECKING:
    from evocity.citymap import GroundCover

#: Names of the layers with the streets.
EDGES, NODES, PLACES = "street_edges", "street_nodes", "places"
#: Name of the layer with the ground between buildings.
BETWEEN = "ground"


def write_geopackage(
    city: CityMap,
    path: Path,
    raw: bool = False,
    streets: bool = False,
    water: np.ndarray | None = None,
    walls: Walls | None = None,
    columns: Mapping[str, np.ndarray] | None = None,
    classes: Classes | None = None,
    crs: str | None = None,
) -> None:
    """Write the layer `LAYER` of a GeoPackage 1.2, as `footprints_of`. ``streets``: also the layers
    `EDGES`, `NODES` and `PLACES` of `CityMap.street_graph`, the quarter of each building, and the
    layer `BETWEEN` of `CityMap.ground_cover`, which is one coverage with the buildings.
    ``water``: open ground that is water, bool ``(H, W)``. Each layer has a style for QGIS."""
    how: dict[str, Any] = {"raw": raw, "walls": walls, "columns": columns, "classes": classes}
    polygons, fields, tags, system = footprints_of(city, path.name, crs=crs, **how)
    layers, target = None, export_system(city, crs, metres=False)
    if streets:
        graph = city.street_graph if water is None else city.street_graph_of(water=water)
        fields["quarter"] = graph.quarters[fields["id"] - 1] + np.int32(1)
        cover = _cover(city, raw, walls, water)
        layers = _street_layers(city, graph, cover)
        if "object" not in (columns or {}):  # objects of a library keep their shapes
            polygons = orient(moved(_placed(city, cover.buildings), city, target))
    _layer(city, path, system or LOCAL, LAYER, "Polygon", polygons, fields, tags)
    table = (city.classes if classes is None else classes).table
    colours = dict(zip(table.names, map(tuple, table.rgb.tolist()), strict=True))
    looks: list[styles.Style] = [
        (LAYER, "heights", styles.height_style(scale_end(city)), True),
        (LAYER, "classes", styles.class_style(colours), False),
    ]
    if layers is not None:
        about = {key: tags[key] for key in ("NAME", "ATTRIBUTION")}
        for name, kind, shapes, columns in layers:
            shapes = moved(shapes, city, target)
            _layer(city, path, system or LOCAL, name, kind, shapes, columns, about)
        looks += [
            (EDGES, "widths", styles.street_style(), True),
            (NODES, "nodes", styles.node_style(), True),
            (PLACES, "places", styles.place_style(_ground_colours()["square"]), True),
            (BETWEEN, "kinds of ground", styles.class_style(_ground_colours(), "kind"), True),
        ]
    text: str | None = LOCAL
    if system is not None:
        text = None if is_code(system) else geotiff_text(system)
    styles.add_styles(path, looks, text)


def _layer(
    city: CityMap,
    path: Path,
    crs: str,
    name: str,
    kind: str,
    shapes: np.ndarray,
    fields: dict[str, np.ndarray],
    tags: dict[str, str],
) -> None:
    """Write one layer: `LAYER` makes the file, the others are added. Raises `OSError`."""
    write_layer(
        path,
        shapes,
        fields,
        tags,
        layer=name,
        driver="GPKG",
        geometry_type=kind,
        crs=crs,
        layer_options={
            "IDENTIFIER": city.name if name == LAYER else f"{city.name}: {name}",
            "DESCRIPTION": city.attribution,
        },
        dataset_options=_options(crs) if name == LAYER else None,
        append=name != LAYER,
    )


def _options(crs: str) -> dict[str, str]:
    """Return the options of a new GeoPackage: the version that QGIS 3.22 reads, and the WKT of a
    reference system without a code."""
    options = {"VERSION": "1.2"}
    return options if is_code(crs) else options | {"CRS_WKT_EXTENSION": "YES"}


def _cover(
    city: CityMap, raw: bool, walls: Walls | None, water: np.ndarray | None
) -> "GroundCover":
    """Make the coverage of the footprints that `footprints_of` returns, and the ground."""
    walls = city.walls if walls is None else walls
    own = np.array(city.outline if raw else walls.polygons, dtype=object)
    corner = np.array(city.south_west)
    return city.ground_cover(shapely.transform(own, lambda points: points - corner), water)


def _placed(city: CityMap, polygons: np.ndarray) -> np.ndarray:
    """Move polygons from the map's south-west corner to its place."""
    corner = np.array(city.south_west)
    return shapely.transform(polygons, lambda points: points + corner)


def _ground_colours() -> dict[str, styles.Colour]:
    colours = {kind: surface_colour(kind) for kind in GROUND}
    return {
        kind: (round(255 * red), round(255 * green), round(255 * blue))
        for kind, (red, green, blue) in colours.items()
    }


def _street_layers(
    city: CityMap, graph: StreetGraph, cover: "GroundCover"
) -> Iterator[tuple[str, str, np.ndarray, dict]]:
    """Yield name, kind of geometry, geometry and columns of each layer of the streets and the
    ground. Nodes, streets, quarters and places count from 1; 0 means no place."""
    one = np.int32(1)
    used = graph.degree > 0
    ends = np.cumsum(used, dtype=np.int32)[graph.ends]
    edges = {
        "id": np.arange(1, len(graph) + 1, dtype=np.int32),
        "u": np.ascontiguousarray(ends[:, 0]),
        "v": np.ascontiguousarray(ends[:, 1]),
        "length": np.round(graph.length, 3),
        "width": np.round(graph.width, 3),
        "width_low": np.round(graph.low, 3),
        "width_high": np.round(graph.high, 3),
        "measured": graph.measured,
        "least": np.round(graph.least, 3),
        "kind": graph.kind.astype(object),
        "street": graph.street + one,
        "place": graph.place + one,
        "leaves": graph.leaves,
    }
    yield EDGES, "LineString", np.array(graph.edges, dtype=object), edges
    nodes = {
        "id": np.arange(1, np.count_nonzero(used) + 1, dtype=np.int32),
        "degree": graph.degree[used],
        "at_frame": graph.at_frame[used],
    }
    yield NODES, "Point", shapely.points(graph.nodes[used]), nodes
    squares = _placed(city, cover.surfaces[cover.squares >= 0])
    number = cover.squares[cover.squares >= 0]
    order = np.lexsort((-shapely.area(squares), number))
    order = order[np.unique(number[order], return_index=True)[1]]  # the largest part of each
    squares, number = squares[order], number[order]
    columns = {
        "id": number + one,
        "area": np.round(shapely.area(squares), 3),
        "width": np.round(graph.places.width[number], 3),
    }
    yield PLACES, "Polygon", orient(squares), columns
    surfaces = {
        "id": np.arange(1, len(cover) + 1, dtype=np.int32),
        "kind": cover.kinds.astype(object),
        "street": cover.streets.astype(object),
        "place": cover.squares + one,
        "area": np.round(shapely.area(cover.surfaces), 3),
    }
    yield BETWEEN, "Polygon", orient(_placed(city, cover.surfaces)), surfaces
