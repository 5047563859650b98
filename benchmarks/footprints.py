"""Footprints of decoded districts beside the originals, as momepy measures them:
python benchmarks/footprints.py [CITY …]

Each district at 2 m is coded with the default partition and decoded; buildings of 24 m² and more
are compared with those of the source in the same window. Told: how many there are; the median of
the equivalent rectangular index (ERI), of corners, and of footprints, m².
"""

import argparse

import geopandas
import momepy
import numpy as np
import shapely
from _machine import description
from _walls import originals

import evocity

LEAST = 24.0


def told(polygons: np.ndarray) -> tuple[float, ...]:
    parts = shapely.get_parts(np.asarray(polygons))
    kept = [one for one in parts if one.geom_type == "Polygon" and one.area >= LEAST]
    table = geopandas.GeoDataFrame(geometry=kept)
    eri = momepy.equivalent_rectangular_index(table)
    with np.errstate(invalid="ignore"):  # momepy's, of corners of 180°
        corners = momepy.corners(table)
    return len(kept), float(eri.mean()), float(corners.mean()), float(table.area.median())


def main(cities: list[str]) -> None:
    print(description())
    print(f"{'':24} {'':14} {'buildings':>9} {'ERI':>6} {'corners':>8} {'median m2':>9}")
    for name in cities or evocity.cities():
        source = originals(name, 2.0)
        city = evocity.decode(evocity.encode(source.city).genome).city
        ways = {
            "originals": source.footprints,
            "walls": city.walls.polygons,
            "walls, squared": city.walled(squared=True).polygons,
            "walls of the map": source.city.walls.polygons,
            "staircase": city.outline,
        }
        first = None
        for way, polygons in ways.items():
            count, eri, corners, area = told(polygons)
            first = first or (eri, corners)
            off = f"{eri / first[0] - 1:+7.1%} {corners / first[1] - 1:+8.1%}"
            print(f"{name:24} {way:16} {count:7d} {eri:6.3f} {corners:8.2f} {area:9.1f} {off}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("cities", nargs="*")
    main(parser.parse_args().cities)
