"""Random pavements of leaves, and random codes on them, drawn without a map."""

import numpy as np

from evocity.genome import Genome, packed
from evocity.pavement import Pavement


def draw_pavement(
    seed: int, height: int = 32, width: int = 48, finest: int = 2, root: int = 16, chance=0.5
) -> Pavement:
    """Quadtree leaves of ``root`` px down to ``finest``, each split with the given chance."""
    rng = np.random.default_rng(seed)
    squares = [(y, x, root) for y in range(0, height, root) for x in range(0, width, root)]
    leaves = []
    while squares:
        y, x, side = squares.pop()
        if side > finest and rng.random() < chance:
            half = side // 2
            squares += [(y + a * half, x + b * half, half) for a in (0, 1) for b in (0, 1)]
        else:
            leaves.append((y, x, side))
    return Pavement(height, width, [side for _, _, side in sorted(leaves)])


def draw_leaves(seed: int, pavement: Pavement | None = None, cities: int = 3, **drawn) -> Genome:
    """A code on random leaves: a quarter of them uniform, the others with domain blocks of twice
    to three times their side along either axis, anywhere; stones from anywhere, turned."""
    p = draw_pavement(seed, **drawn) if pavement is None else pavement
    rng = np.random.default_rng([seed, 1])
    n, side = len(p), p.side.astype(int)
    dy, dx = (side * rng.integers(2, 4, n) for _ in range(2))
    has = (rng.random(n) < 0.75) & (dy <= p.height) & (dx <= p.width)
    dy, dx = np.where(has, dy, 0), np.where(has, dx, 0)
    return Genome(
        p,
        sigma=np.where(has, rng.uniform(-0.9, 0.9, n), 0),
        beta=rng.uniform(-5, 20, n),
        y=np.where(has, rng.integers(0, p.height - dy + 1), 0),
        x=np.where(has, rng.integers(0, p.width - dx + 1), 0),
        dy=dy,
        dx=dx,
        iso=np.where(has, rng.integers(0, 8, n), 0),
        parent=rng.integers(0, cities, n),
        source=packed(rng.integers(0, 200, n), rng.integers(0, 200, n)),
        turn=rng.integers(0, 8, n),
        other=rng.integers(0, cities, n),
        part=rng.uniform(0.5, 1, n),
        metres_per_pixel=2.0,
        cities=tuple(f"city-{number}" for number in range(cities)),
        attribution="drawn",
    )
