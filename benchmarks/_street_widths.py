"""Chords across streets between the walls of sources, and how near the widths of a graph come:
python benchmarks/_street_widths.py

At 1 m a pixel: error of the width of each street against the median of its chords. Edges along
places are not streets. Only walls of the source decide which chords count:

- *outside crossings*: a chord every 5 m, none within a crossing: nearer to it than half of the
  widest street that ends there, by its chords each metre
- *every chord*: a chord each metre, in crossings too, where a chord looks along another street
- *across the street*: a chord each metre; none nearer to a crossing than the nearest wall, none
  that crosses the middle line of another street
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

#: Metres: between two chords along an edge, and outside crossings; to the points before and after
#: that give the direction there; the longest half of a chord.
STEP, APART, BESIDE, REACH = 1.0, 5.0, 4.0, 60.0
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
    edge: shapely.LineString, walls: shapely.Geometry, step: float = STEP
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chords square to an edge, every ``step`` metres, that end at ``walls`` on both sides: how far
    along the edge they are, their lengths, and lines."""
    count = max(int(edge.length // step), 1)
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


def errors(city: evocity.CityMap, footprints: np.ndarray) -> dict[str, dict[str, float]]:
    """Error of the width of streets against the median of their chords, by the rule for chords:
    the number of streets and their share of the length of all streets, the mean and the median
    error, and the mean error of the width between the nearest walls, metres."""
    graph, walls = city.street_graph, shapely.union_all(footprints)
    shapely.prepare(walls)
    edges, streets = np.array(graph.edges, dtype=object), graph.kind != "place"
    found = [chords(edge, walls) for edge in edges]
    every = np.array([_median(widths) for _, widths, _ in found])
    widest = np.zeros(len(graph.nodes))
    for end in graph.ends[streets & np.isfinite(every)].T:
        np.maximum.at(widest, end, every[streets & np.isfinite(every)])
    crossing = np.where(graph.at_frame, 0, widest / 2)
    discs = np.where(graph.at_frame, 0, shapely.distance(shapely.points(graph.nodes), walls))
    outside, across = np.full((2, len(graph)), np.nan)
    for k, edge in enumerate(edges):
        at, widths, _ = chords(edge, walls, APART)
        first, last = crossing[graph.ends[k]]
        outside[k] = _median(widths[(at >= first) & (at <= edge.length - last)])
        at, widths, lines = found[k]
        first, last = discs[graph.ends[k]]
        own = (at >= first) & (at <= edge.length - last)
        own &= ~shapely.intersects(lines, shapely.multilinestrings(np.delete(edges, k)))
        across[k] = _median(widths[own]) if graph.measured[k] > 0 else np.nan
    rules = {"outside crossings": outside, "every chord": every, "across the street": across}
    told = {}
    for rule, true in rules.items():
        own = streets & np.isfinite(true)
        away = np.abs(graph.width - true)[own]
        told[rule] = {
            "streets": int(own.sum()),
            "length": float(graph.length[own].sum() / graph.length[streets].sum()),
            "mean": float(away.mean()),
            "median": float(np.median(away)),
            "clear, mean": float(np.abs(graph.clear - true)[own].mean()),
        }
    return told


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else np.nan


def main() -> None:
    print(description())
    cases = {name: bundled(name, 1.0) for name in ("lyon-1er", "new-york-west-village")}
    if SHARED.is_dir():
        cases["prague-bubenec"] = prague(1.0)
        folder = SHARED.parent / "more"
        cases |= {name: more(folder / f"{name}.geojson", 1.0) for name in MORE}
    for name, case in cases.items():
        print(f"\n{name}")
        for rule, figures in errors(*case).items():
            told = ", ".join(f"{key} {value:.4g}" for key, value in figures.items())
            print(f"  {rule:18} {told}", flush=True)


if __name__ == "__main__":
    main()
