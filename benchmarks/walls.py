"""Walls beside the originals, and beside other ways to straighten them: python benchmarks/walls.py
[CITY …] [--picture FILE.png]

Bundled districts at 1 and 2 m a pixel, told apart by gaps and heights. Each way's polygons beside
the footprints the maps were burnt from: vertices, also as a share of the staircase's; IoU of all
that is built, and 1 − IoU beside the staircase's; of façades, weighted by length, the median angle
to the nearest original wall and its distance; share of corners that are right angles, and of the
originals; m² that overlap; party walls kept, of pairs that share 4 pixels and more; seconds.
"""

import argparse
import time

import numpy as np
import shapely
from _machine import description
from _walls import Originals, originals, told

WAYS = {}


def _valid(polygons: np.ndarray) -> np.ndarray:
    return shapely.make_valid(polygons, method="structure", keep_collapsed=False)


def way(function):
    WAYS[function.__name__.replace("_", " ")] = function
    return function


@way
def staircase(source: Originals) -> np.ndarray:
    return np.array(source.city.outline)


@way
def douglas_peucker_each(source: Originals) -> np.ndarray:
    outlines = np.array(source.city.outline)
    return _valid(shapely.simplify(outlines, source.city.metres_per_pixel))


@way
def coverage_simplify(source: Originals) -> np.ndarray:
    outlines = np.array(source.city.outline)
    return shapely.coverage_simplify(outlines, 2 * source.city.metres_per_pixel)


@way
def topojson(source: Originals) -> np.ndarray:
    import geopandas
    from topojson import Topology

    table = geopandas.GeoDataFrame(geometry=list(source.city.outline))
    topology = Topology(table, prequantize=False)
    simple = topology.toposimplify(source.city.metres_per_pixel).to_gdf()
    return _valid(simple.geometry.to_numpy())


@way
def buildingregulariser(source: Originals) -> np.ndarray:
    import geopandas
    from buildingregulariser import regularize_geodataframe

    table = geopandas.GeoDataFrame(
        {"id": range(len(source.city.outline))},
        geometry=list(source.city.outline),
        crs=source.city.crs,
    )
    regular = regularize_geodataframe(
        table, simplify_tolerance=source.city.metres_per_pixel, num_cores=1
    )
    return _valid(regular.sort_values("id").geometry.to_numpy())


@way
def walls(source: Originals) -> np.ndarray:
    return np.array(source.city.walled().polygons)


@way
def walls_squared(source: Originals) -> np.ndarray:
    return np.array(source.city.walled(squared=True).polygons)


def kept(polygons: np.ndarray, outlines: np.ndarray, least: float) -> float:
    """Share of the pairs of ``outlines`` that share a wall of ``least`` metres and more of which
    the ``polygons`` share one still."""
    one, other = shapely.STRtree(outlines).query(outlines, predicate="touches")
    one, other = one[one < other], other[one < other]
    pairs = shapely.length(shapely.intersection(outlines[one], outlines[other])) >= least
    one, other = one[pairs], other[pairs]
    if not len(one) or len(polygons) != len(outlines):
        return np.nan
    shared = shapely.intersection(
        shapely.boundary(polygons[one]), shapely.boundary(polygons[other])
    )
    return float((shapely.length(shared) > 0.1).mean())


def main(asked: argparse.Namespace) -> None:
    print(description())
    for name in asked.cities:
        for pixel in (1.0, 2.0):
            source = originals(name, pixel)
            outlines = np.array(source.city.outline)
            own = told(source.footprints, source)
            stairs = told(outlines, source)
            print(
                f"\n{name}, {pixel:g} m a pixel: {len(outlines)} buildings told apart; "
                f"{own['right']:.2f} of the originals' corners are right angles"
            )
            print(
                f"{'':22}{'vertices':>9}{'share':>7}{'IoU':>7}{'1−IoU':>7}{'angle':>7}{'off':>6}"
                f"{'right':>7}{'overlap':>9}{'shared':>8}{'s':>7}"
            )
            for title, function in WAYS.items():
                function(source)  # compiled, loaded
                start = time.perf_counter()
                polygons = function(source)
                spent = time.perf_counter() - start
                row = told(polygons, source)
                rest = (1 - row["IoU"]) / (1 - stairs["IoU"])
                print(
                    f"{title:22}{row['vertices']:9}{row['vertices'] / stairs['vertices']:7.2f}"
                    f"{row['IoU']:7.3f}{rest:7.2f}{row['bearing']:7.2f}{row['off']:6.2f}"
                    f"{row['right']:7.2f}{row['overlap']:9.1f}"
                    f"{kept(polygons, outlines, 4 * pixel):8.2f}{spent:7.2f}",
                    flush=True,
                )
    if asked.picture:
        picture(originals(asked.cities[0], 2.0), asked.picture)


def picture(source: Originals, path: str) -> None:
    """A part of the map: pixels' edges, walls over the originals, walls squared."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(18, 6.4), layout="constrained")
    left, top = source.city.origin
    shown = {"staircase": staircase, "walls": walls, "walls, squared": walls_squared}
    for axis, (title, function) in zip(axes, shown.items(), strict=True):
        for polygon in source.footprints:
            for ring in shapely.get_rings(polygon):
                axis.fill(*shapely.get_coordinates(ring).T, color="#cfd8dc", zorder=1)
        for ring in shapely.get_rings(function(source)):
            axis.plot(*shapely.get_coordinates(ring).T, color="#b71c1c", lw=1, zorder=2)
        axis.set_xlim(left + 150, left + 350)
        axis.set_ylim(top - 350, top - 150)
        axis.set_aspect("equal")
        axis.set_title(title)
        axis.set_xticks([])
        axis.set_yticks([])
    figure.savefig(path, dpi=70)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    towns = ["lyon-1er", "new-york-west-village", "montpellier-pas-du-loup"]
    parser.add_argument("cities", nargs="*", default=towns)
    parser.add_argument("--picture", metavar="FILE.png")
    main(parser.parse_args())
