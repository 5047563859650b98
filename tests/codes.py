"""Random codes, drawn without a map: any nucleotides within their bounds."""

import numpy as np

from evocity.coding import encode
from evocity.genome import Genome, packed
from evocity.genome.writer import lifs_at
from evocity.pavement import Pavement


def draw_code(
    seed: int, rows: int = 5, columns: int = 6, block: int = 4, cities: int = 3, few: int = 0
) -> Genome:
    """A code of ``rows`` × ``columns`` range blocks: a quarter of them uniform, the others with
    domain blocks of any extents, anywhere; of ``few`` domain blocks, if that is above 0."""
    rng = np.random.default_rng(seed)
    pavement = Pavement(rows * block, columns * block, block)
    n = len(pavement)
    kinds = few or n
    dy = block * rng.integers(2, rows + 1, kinds)
    dx = block * rng.integers(2, columns + 1, kinds)
    y, x = rng.integers(0, pavement.height - dy + 1), rng.integers(0, pavement.width - dx + 1)
    which = rng.integers(0, kinds, n)
    has = rng.random(n) < 0.75
    return Genome(
        pavement,
        sigma=np.where(has, rng.uniform(-0.9, 0.9, n), 0),
        beta=rng.uniform(-5, 20, n),
        **{name: np.where(has, corner[which], 0) for name, corner in (("y", y), ("x", x))},
        **{name: np.where(has, extent[which], 0) for name, extent in (("dy", dy), ("dx", dx))},
        iso=np.where(has, rng.integers(0, 8, n), 0),
        parent=rng.integers(0, cities, n),
        source=packed(*(corner[rng.integers(0, n, n)] for corner in pavement.corners)),
        metres_per_pixel=2.0,
        cities=tuple(f"city-{number}" for number in range(cities)),
        attribution="drawn",
    )


def uniformly(city, **how):
    """`evocity.encode` as in the papers unless told otherwise: range blocks of one side, B = 4,
    neither fitted nor settled."""
    return encode(city, **{"block": 4, "fit": False, "settle": False} | how)


def stones(genome: Genome) -> np.ndarray:
    """Of a uniform pavement: which lifs of its source city each range block is the stone of."""
    return lifs_at(genome.pavement, genome.source)
