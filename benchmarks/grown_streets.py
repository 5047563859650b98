"""Streets of grown fabric beside those of its city: python benchmarks/grown_streets.py [CITY …]
[--repeats] [--picture FOLDER]

Five windows of 512 m far from the original, grown by groups of cells and along streets: the length
of the street that a metre of street belongs to on average (each street weighted by its length), the
`street_distance` from the decoded original, and the built share of the ground. Then the seconds for
2048 × 2048 px, and with --repeats, the windows of 64 px that come twice within 4096 × 4096 px.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from _machine import description

import evocity
from evocity.coding import decode
from evocity.fitness import street_distance
from evocity.growth import grow

PLACES = (
    (20_000, 20_000),
    (-30_000, 15_000),
    (50_000, -40_000),
    (-25_000, -25_000),
    (1000, 70_000),
)


def stroke(city) -> float:
    """The length of the streets of a map, each weighted by its length, metres."""
    graph = city.alley_graph
    lengths = np.bincount(graph.street, graph.length)
    return float((lengths**2).sum() / max(lengths.sum(), 1e-9))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cities", nargs="*", default=evocity.cities())
    parser.add_argument("--repeats", action="store_true")
    parser.add_argument("--picture", type=Path)
    arguments = parser.parse_args()
    print(description())
    for name in arguments.cities:
        code = evocity.encode(evocity.read_map(name)).genome
        own = decode(code).city
        print(f"\n{name}: streets {stroke(own):.0f} m, built {own.built.mean():.2f}")
        for streets in (False, True):
            fabric = grow(code, 2048, 2048, np.random.default_rng(7), streets=streets)
            side = round(512 / own.metres_per_pixel)
            shown = [fabric.city(*place, side, side) for place in PLACES]
            lengths = [stroke(city) for city in shown]
            distances = [street_distance(city, reference=own) for city in shown]
            built = [city.built.mean() for city in shown]
            start, spent = time.perf_counter(), time.process_time()
            whole = fabric.city()
            spent, start = time.process_time() - spent, time.perf_counter() - start
            print(
                f"  {'along streets' if streets else 'by groups':14}"
                f"streets {np.mean(lengths):4.0f} m ({' '.join(f'{one:.0f}' for one in lengths)}), "
                f"distance {np.mean(distances):.2f} (most {max(distances):.2f}), "
                f"built {np.mean(built):.2f}; 2048²: {start:.1f} s ({spent:.1f} s of processor)",
                flush=True,
            )
            if arguments.picture:
                evocity.write_map(whole, arguments.picture / f"{name}-{int(streets)}.png")
            if arguments.repeats and streets:
                print(f"  windows twice in 4096²: {fabric.repeats(-30_000, 10_000, 4096, 4096)}")


if __name__ == "__main__":
    main()
