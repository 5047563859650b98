"""Street graphs beside real streets: python benchmarks/streets.py [--picture FOLDER]

Maps of 512 m at 2 m a pixel, and the highways of the same files within 30 m of buildings: what is
driven on, and streets given to walkers; footways, paths and steps are told apart. Of their length
the share that the graph comes within 8 m of, and of the part with buildings within 30 m on both
sides; of the graph's length the share within 8 m of a highway, and of a highway or footway; of real
crossings (three arms and more, pooled within 20 m) the share with one of ours within 15 m, and 8 m;
of ours the share with a real one within 15 m. Then the same of West Village read 50 to 90 m aside,
and at other widths; then seconds, by the size of the map.

--picture draws each town: real streets green, missed ones magenta; ours blue, false ones red.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import shapely
from _machine import description
from _streets import NEAR, WEST_VILLAGE, Real, real, told

from evocity import CityMap, read_map

NEW_YORK, MOSCOW, PRAGUE = (
    "original-new-york-west-village.osm.pbf",
    "original-moscow-north.osm",
    "original-prague-bubenec.gpkg",
)
#: The two densest windows of Moscow's extract, a quarter built.
MOSCOW_NORTH, MOSCOW_SOUTH = (37.599019, 55.814197), (37.590791, 55.807657)
#: Degrees of longitude and latitude aside.
ASIDE = [(0.0008, 0.0), (-0.0008, 0.0004), (0.0, -0.0006), (0.0004, 0.0006)]

COLUMNS = {
    "found": "found",
    "between": "between",
    "true": "true",
    "or walk": "or walk",
    "crossings found": "crossings",
    "within 8 m": "in 8 m",
    "crossings true": "true ones",
    "real m": "real m",
    "ours m": "ours m",
}


def line(title: str, figures: dict[str, float]) -> None:
    row = ""
    for key, name in COLUMNS.items():
        digits = 0 if key in ("real m", "ours m") else 3
        row += f"{figures[key]:{len(name) + 2}.{digits}f}"
    print(f"{title:30}{row}", flush=True)


def main(asked: argparse.Namespace) -> None:
    print(description())
    print(f"\n{'':30}" + "".join(f"  {name}" for name in COLUMNS.values()))
    towns = {
        "West Village": real(NEW_YORK, center=WEST_VILLAGE),
        "Bubeneč": real(PRAGUE),
        "Moscow, north": real(MOSCOW, center=MOSCOW_NORTH),
        "Moscow, south": real(MOSCOW, center=MOSCOW_SOUTH),
        "Moscow, north, no service": real(MOSCOW, service=False, center=MOSCOW_NORTH),
    }
    for title, town in towns.items():
        line(title, told(town.city.street_graph, town))
        if asked.picture:
            picture(town, Path(asked.picture) / f"{title.lower().replace(' ', '-')}.png")
    for aside in ASIDE:
        moved = tuple(np.add(WEST_VILLAGE, aside).tolist())
        town = real(NEW_YORK, center=moved)
        line(f"West Village, {aside[0]:+.4f} {aside[1]:+.4f}", told(town.city.street_graph, town))
    town = towns["West Village"]
    for how in (
        {"least_width": 0.0},
        {"least_width": 6.0},
        {"least_width": 10.0},
        {"spurs": 0.0},
        {"spurs": 2.0},
        {"places": False},
        {"closed": True},
        {"least_width": 0.0, "spurs": 0.0, "places": False, "courts": True},
    ):
        title = ", ".join(f"{name} {value:g}" for name, value in how.items())
        line(title[:29], told(town.city.street_graph_of(**how), town))
    print("\nseconds of CPU, the least of three")
    for name in ("new-york-west-village", "lyon-1er"):
        city = read_map(name)
        for tiles in (1, 2, 4):
            large = CityMap(np.tile(city.heights, (tiles, tiles)), 2.0)
            large.building_labels  # noqa: B018, of the map and not of its streets
            spent = []
            for _ in range(3):
                start = time.process_time()
                graph = large.street_graph_of()
                spent.append(time.process_time() - start)
            print(f"{name:24}{256 * tiles:5}² {min(spent):8.3f}  {len(graph):6} edges")


def picture(town: Real, path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    graph, city = town.city.street_graph, town.city
    figure, axis = pyplot.subplots(figsize=(14, 14), layout="constrained")
    left, top = city.origin
    axis.imshow(city.built, extent=(left, left + 512, top - 512, top), cmap="Greys", alpha=0.35)
    ours = np.array(graph.edges, dtype=object)
    missed = shapely.difference(town.lines, shapely.buffer(shapely.union_all(ours), NEAR))
    false = shapely.difference(shapely.union_all(ours), shapely.buffer(town.all, NEAR))
    for some, style in (
        (town.walks, {"color": "orange", "lw": 0.8}),
        (town.all, {"color": "#2ca02c", "lw": 4, "alpha": 0.4}),
        (shapely.union_all(ours), {"color": "#1f77b4", "lw": 1.5}),
        (missed, {"color": "magenta", "lw": 5}),
        (false, {"color": "red", "lw": 2}),
    ):
        for part in shapely.get_parts(some):
            if part.length:
                axis.plot(*part.xy, **style)
    axis.plot(*graph.nodes[graph.degree > 2].T, "b.", ms=8)
    axis.plot(*town.crossings.T, "gx", ms=12)
    axis.set(xlim=(left, left + 512), ylim=(top - 512, top), aspect="equal", xticks=[], yticks=[])
    figure.savefig(path, dpi=70)
    pyplot.close(figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", metavar="FOLDER")
    main(parser.parse_args())
