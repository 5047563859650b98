"""Chords across streets between the walls of sources, and how near the widths of a graph come."""

import numpy as np
import pyogrio
import shapely
from _streets import SHARED
from _walls import originals
from pyproj import CRS, Transformer

import evocity

#: Metres: between two chords along an edge; to the points before and after that give the direction
#: there; the longest half of a chord.
STEP, BESIDE, REACH = 5.0, 4.0, 60.0


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
    into = Transformer.from_crs(about["crs"], CRS.from_user_input(city.crs), always_xy=True)
    found = shapely.make_valid(shapely.from_wkb(shapes))
    found = shapely.transform(found, into.transform, interleaved=False)
    left, top = city.origin
    within = shapely.intersection(found, shapely.box(left, top - 512, left + 512, top))
    return city, within[shapely.area(within) > 1e-6]


def chords(edge: shapely.LineString, walls: shapely.Geometry) -> np.ndarray:
    """Chords square to an edge, every `STEP` metres, that end at ``walls`` on both sides."""
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
    aside = REACH * np.column_stack([-way[:, 1], way[:, 0]])
    widths = np.zeros(count)
    for sign in (1, -1):
        rays = shapely.linestrings(np.stack([points, points + sign * aside], axis=1))
        hits = shapely.intersection(rays, walls)
        away = shapely.distance(hits, shapely.points(points))
        widths += np.where(shapely.is_empty(hits), np.nan, away)
    return widths[np.isfinite(widths)]


def errors(city: evocity.CityMap, footprints: np.ndarray) -> dict[str, float]:
    """Mean and median error of the width of streets against the median of their chords, m; of the
    width between the nearest walls; and how many streets have chords and façades. Edges along
    places are not streets."""
    graph, walls = city.street_graph, shapely.union_all(footprints)
    shapely.prepare(walls)
    found = [chords(edge, walls) for edge in graph.edges]
    true = np.array([np.median(own) if len(own) else np.nan for own in found])
    streets = np.isfinite(true) & (graph.measured > 0) & (graph.kind != "place")
    own, clear = (np.abs(values - true)[streets] for values in (graph.width, graph.clear))
    return {
        "edges": int(streets.sum()),
        "mean": float(own.mean()),
        "median": float(np.median(own)),
        "clear, mean": float(clear.mean()),
    }


def main() -> None:
    cases = {name: bundled(name, 1.0) for name in ("lyon-1er", "new-york-west-village")}
    if SHARED.is_dir():
        cases["prague-bubenec"] = prague(1.0)
    for name, case in cases.items():
        told = errors(*case)
        print(name, {key: round(value, 2) for key, value in told.items()})


if __name__ == "__main__":
    main()
