"""What low-pass filters simplify: python benchmarks/low_pass.py [--block B …] [--pixel M --side PX]

For districts coded with range blocks of one side and domain blocks from the whole map, as in the
papers (Marsault 2002 §5.5, 2005 §2.4): buildings, crumbs a hectare, vertices of the outlines along
pixels' edges, and GSI. First without a filter, then at f_c = 1, 10 and 100: pixels to ground by the
calls of pixels (2002), in each iteration or only in the decoded picture; range blocks flat by the
calls of their domain blocks (2005), and whole buildings to ground. The papers' maps have 2048² px,
and no size of a pixel. Range blocks "must be at least of the mean size of buildings" (2002 §6.1):
the first line says both.
"""

import argparse

import numpy as np
import shapely
from _machine import description

import evocity
from evocity.citymap import CityMap
from evocity.coding import low_pass, usage
from evocity.fitness import crumbs, gsi
from evocity.io import cities

FREQUENCIES = (1, 10, 100)
WAYS = {
    "pixels, 2002": {},
    "range blocks to ground": {"count": "ranges"},
    "range blocks, 2005": {"count": "ranges", "part": "blocks"},
    "buildings": {"part": "buildings"},
}


def row(city: CityMap) -> tuple[float, ...]:
    polygons = np.array(city.outline, dtype=object)
    vertices = int(shapely.get_num_coordinates(polygons).sum()) if polygons.size else 0
    return len(city.buildings.area), float(crumbs(city)), vertices, float(gsi(city))


def window(name: str, pixel: float | None, side: int | None) -> CityMap:
    given = {"metres_per_pixel": pixel, "pixels": side}
    return evocity.read_map(name, **{key: value for key, value in given.items() if value})


def main(blocks: list[int], names: list[str], pixel: float | None, side: int | None) -> None:
    print(description())
    for block in blocks:
        for name in names:
            real = window(name, pixel, side)
            genome = evocity.encode(real, block=block, reach=None).genome
            wide = block * real.metres_per_pixel
            mean = float(np.sqrt(real.buildings.area.mean()))
            print(f"\n{name}, B = {block}: {wide:g} m; sides of buildings {mean:.0f} m")
            print(f"{'':40}{'buildings':>12}{'crumbs':>10}{'vertices':>10}{'GSI':>8}")
            city, calls = evocity.decode(genome).city, usage(genome).pixels
            rows = {"no filter": row(city)}
            for f_c in FREQUENCIES:
                filtered = city.replace(np.where(calls > f_c, 0, city.heights))
                rows[f"pixels of the picture, f_c = {f_c}"] = row(filtered)
            for way, how in WAYS.items():
                for f_c in FREQUENCIES:
                    filtered = evocity.decode(low_pass(genome, f_c, **how)).city
                    rows[f"{way}, f_c = {f_c}"] = row(filtered)
            for text, (buildings, broken, vertices, built) in rows.items():
                print(f"{text:40}{buildings:12}{broken:10.2f}{vertices:10}{built:8.2f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", default=list(cities()))
    parser.add_argument("--block", type=int, nargs="+", default=[4, 8], help="side, px")
    parser.add_argument("--pixel", type=float, help="metres a pixel, by default of the district")
    parser.add_argument("--side", type=int, help="side of a window in the middle, px")
    given = parser.parse_args()
    main(given.block, given.names, given.pixel, given.side)
