"""What asymmetric fusion changes, with range blocks of 4 and 8 px: python
benchmarks/asymmetric_fusion.py

For pairs of real and of drawn towns, for squares of five range blocks and for single blocks
(``side`` = 0), with and without collage repair: the share of pixels that differ by more than 1.5 m
from the first parent; crumbs a hectare of the first parent, of the second, and of the child; the
fabric distance of the child to the second parent's code; the share of the built ground in whole
buildings of the sources. The papers find the results better with blocks of 8 px (Marsault 2002
§5.3): the last line counts the pairs of which that holds.
"""

import numpy as np
from _machine import description

import evocity
from evocity.fitness import crumbs, fabric_distance
from evocity.fitness.heredity import integrity_of
from evocity.operators import AsymmetricFusion
from evocity.towns.patterns import chessboard_town, concentric_town

LYON, MONTPELLIER, NEW_YORK = "lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"
CONCENTRIC, CHESSBOARD = "concentric", "chessboard"
PAIRS = (
    (LYON, NEW_YORK), (NEW_YORK, LYON), (LYON, MONTPELLIER), (MONTPELLIER, LYON),
    (CONCENTRIC, CHESSBOARD), (CHESSBOARD, CONCENTRIC),
)  # fmt: skip
CHANGED = 1.5
WAYS = ({}, {"side": 0.0}, {"side": 0.0, "repair": None})


def changed(child, frame) -> float:
    """The share of pixels that differ from the ``frame``."""
    return float((np.abs(child.heights - frame.heights) > CHANGED).mean())


def main() -> None:
    print(description())
    cities = {name: evocity.read_map(name) for name in (LYON, MONTPELLIER, NEW_YORK)}
    cities |= {CONCENTRIC: concentric_town(256, 1.0), CHESSBOARD: chessboard_town(256, 1.0)}
    columns = ("changed", "crumbs 1", "crumbs 2", "crumbs", "fabric", "integrity")
    rows = {}
    for block in (4, 8):
        genomes = {name: evocity.encode(city, block=block).genome for name, city in cities.items()}
        decoded = {name: evocity.decode(genome).city for name, genome in genomes.items()}
        print(f"\nB = {block}\n{'':58}" + "".join(f"{column:>10}" for column in columns))
        for pair in PAIRS:
            for way in WAYS:
                fuse = AsymmetricFusion(**way)
                child = fuse([genomes[name] for name in pair], np.random.default_rng(0))
                city = evocity.decode(child).city
                row = (
                    changed(city, decoded[pair[0]]),
                    *(float(crumbs(one)) for one in (*(decoded[name] for name in pair), city)),
                    float(fabric_distance(city, [decoded[pair[1]]])),
                    integrity_of(child, list(cities.values())),
                )
                if not way:
                    rows[block, pair] = row
                text = " mod ".join(pair) + "".join(f", {key} {one}" for key, one in way.items())
                print(f"{text:58.58}" + "".join(f"{one:10.2f}" for one in row), flush=True)
    least = min(row[0] for row in rows.values())
    nearer = sum(rows[8, pair][4] < rows[4, pair][4] for pair in PAIRS)
    whole = sum(rows[8, pair][5] > rows[4, pair][5] for pair in PAIRS)
    print(
        f"\nsquares: at least {least:.0%} of the pixels change; with B = 8, {nearer} of the "
        f"{len(PAIRS)} children are nearer to the second fabric, and {whole} are wholer"
    )


if __name__ == "__main__":
    main()
