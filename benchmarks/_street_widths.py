"""Chords across streets between the walls of sources, and how near the widths of a graph come:
python benchmarks/_street_widths.py

At 1 m a pixel: error of the width of each street against the median of its chords, one each metre.
Edges along places are not streets. *every chord* counts all places of all streets, in crossings
too, where a chord looks along another street. *across the street* leaves out places in a crossing
(nearer to it than the nearest wall), and chords that cross the middle line of another street.
"""

import json
from pathlib import Path

import numpy as np
import pyogrio
import shapely
from _machine import description
from _streets import SHARED
from _walls import originals
from pyproj import CRS, Transformer

import evocity

#: Metres: between two chords along an edge; to the points before and after that give the direction
#: there; the longest half of a chord.
STEP, BESIDE, REACH = 1.0, 4.0, 60.0
#: Other districts of the shared folder.
MORE = (
    *("tokyo-ginza", "barcelona-eixample", "heidelberg-altstadt"),
    *("st-petersburg-lines", "kathmandu-ward-7", "boulder-table-mesa"),
)


def bundled(name: str, metres_per_pixel: float) -> tuple[evocity.CityMap, np.ndarray]:
    """A bundled city and the footprints of its source."""
    source = originals(name, metres_per_pixel)
    return source.city, source.footprints


def prague(metres_per_pixel: float) -> tuple[evocity.CityMap, np.ndarray]:
    """Bubeneč of the shared folder, 512 m wide, and the footprints of its source."""
    path = SHARED / "original-prague-bubenec.gpkg"
    pixels = round(512 / metres_per_pixel)
    city = evocity.read_map(path, pixels=pixels, metres_per_pixel=metres_per_pixel)
    about, _, shapes, _ = pyogrio.raw.read(path, layer="buildings")
    return city, _within(city, shapely.from_wkb(shapes), about["crs"])


def more(path: Path, metres_per_pixel: float) -> tuple[evocity.CityMap, np.ndarray]:
    """The middle 512 m of a district of the shared folder, and the footprints of its source."""
    document = json.loads(path.read_text())
    city = evocity.read_map(
        path,
        pixels=round(512 / metres_per_pixel),
        metres_per_pixel=metres_per_pixel,
        center=tuple(document["window"]["center"]),
        default_height=9.0,
    )
    shapes = [json.dumps(one["geometry"]) for one in document["features"]]
    return city, _within(city, shapely.from_geojson(shapes), 4326)


def _within(city: evocity.CityMap, shapes: np.ndarray, crs) -> np.ndarray:
    """Those parts of ``shapes`` that lie on the map, in its metres."""
    into = Transformer.from_crs(crs, CRS.from_user_input(city.crs), always_xy=True)
    found = shapely.transform(shapely.make_valid(shapes), into.transform, interleaved=False)
    left, top = city.origin
    within = shapely.intersection(
        shapely.make_valid(found), shapely.box(left, top - 512, left + 512, top)
    )
    return within[shapely.area(within) > 1e-6]


def chords(
    edge: shapely.LineString, walls: shapely.Geometry
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chords square to an edge, every `STEP` metres, that end at ``walls`` on both sides: how far
    along the edge they are, their lengths, and lines."""
    count = max(int(edge.length // STEP), 1)
    at = (np.arange(count) + 0.5) * edge.length / count
    points, before, after = (
        shapely.get_coordinates(
            shapely.line_interpolate_point(edge, np.clip(place, 0, edge.length))
        )
        for place in (at, at - BESIDE, at + BESIDE)
    )
    way = after - before
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    ends, widths = [], np.zeros(count)
    for sign in (1, -1):
        rays = shapely.linestrings(np.stack([points, points + sign * REACH * aside], axis=1))
        hits = shapely.intersection(rays, walls)
        away = shapely.distance(hits, shapely.points(points))  # NaN where nothing is hit
        widths += away
        ends.append(points + sign * away[:, None] * aside)
    both = np.isfinite(widths)
    return at[both], widths[both], shapely.linestrings(np.stack(ends, axis=1)[both])


def errors(
    city: evocity.CityMap, footprints: np.ndarray
) -> tuple[dict[str, float], dict[str, float]]:
    """Mean and median error of the width of streets against the median of their chords, m; of the
    width between the nearest walls; and the number of streets: of every chord of all streets that
    have any, and of chords across the street of those that are measured."""
    graph, walls = city.street_graph, shapely.union_all(footprints)
    shapely.prepare(walls)
    edges = np.array(graph.edges, dtype=object)
    discs = np.where(graph.at_frame, 0, shapely.distance(shapely.points(graph.nodes), walls))
    every, across = np.full((2, len(graph)), np.nan)
    for k, edge in enumerate(edges):
        at, widths, lines = chords(edge, walls)
        if not len(at):
            continue
        every[k] = np.median(widths)
        first, last = discs[graph.ends[k]]
        own = (at >= first) & (at <= edge.length - last)
        own &= ~shapely.intersects(lines, shapely.multilinestrings(np.delete(edges, k)))
        across[k] = np.median(widths[own]) if own.any() else np.nan
    streets = graph.kind != "place"
    chosen = streets & np.isfinite(every), streets & np.isfinite(across) & (graph.measured > 0)
    return tuple(
        {
            "edges": int(own.sum()),
            "mean": float(np.abs(graph.width - true)[own].mean()),
            "median": float(np.median(np.abs(graph.width - true)[own])),
            "clear, mean": float(np.abs(graph.clear - true)[own].mean()),
        }
        for true, own in zip((every, across), chosen, strict=True)
    )


def main() -> None:
    print(description())
    cases = {name: bundled(name, 1.0) for name in ("lyon-1er", "new-york-west-village")}
    if SHARED.is_dir():
        cases["prague-bubenec"] = prague(1.0)
        folder = SHARED.parent / "more"
        cases |= {name: more(folder / f"{name}.geojson", 1.0) for name in MORE}
    columns = {"edges": 0, "mean": 2, "median": 2, "clear, mean": 2}
    row = "".join(f"{name:>13}" for name in columns)
    print(f"\n{'':24}{'every chord':>13}{'':39}{'across the street':>20}\n{'':24}{row}{row}")
    for name, case in cases.items():
        told = [
            f"{figures[key]:13.{columns[key]}f}" for figures in errors(*case) for key in columns
        ]
        print(f"{name:24}" + "".join(told), flush=True)


if __name__ == "__main__":
    main()
