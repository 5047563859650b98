"""What the attractor fit gains, and what it costs: python benchmarks/fit.py

Every bundled city at 256², 2 m/px, D = 2B, σ cap .9, over the whole map and with reach 24: PSNR
of the code as searched and as fitted, and seconds of one core for the fit alone.
"""

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import time
from statistics import mean

from _machine import description

import evocity
from evocity.coding import encode, fit_attractor, psnr


def main() -> None:
    print(description())
    print("attractor fit at 256²; PSNR in dB, seconds of one core\n")
    fit_attractor(*code("lyon-1er", pixels=64))  # compiled, so not counted below
    for block in (8, 4):
        for reach in (None, 24):
            where = "whole map" if reach is None else f"reach {reach}"
            print(f"{f'B = {block}, {where}':28}{'before':>8}{'after':>8}{'gain':>8}{'seconds':>9}")
            rows = [measured(name, block, reach) for name in evocity.cities()]
            for name, (before, after, seconds) in zip(evocity.cities(), rows, strict=True):
                print(f"{name:28}{before:8.2f}{after:8.2f}{after - before:+8.2f}{seconds:9.2f}")
            gains = [after - before for before, after, _ in rows]
            slowest = max(seconds for *_, seconds in rows)
            print(
                f"{'mean gain, longest':28}{'':16}{mean(gains):+8.2f}{slowest:9.2f}"
                f"    least gain {min(gains):+.2f}\n"
            )


def code(name: str, block: int = 4, reach: int | None = 24, pixels: int = 256):
    city = evocity.read_map(name, pixels=pixels, metres_per_pixel=2.0)
    return encode(city, block=block, reach=reach).genome, city


def measured(name: str, block: int, reach: int | None) -> tuple[float, float, float]:
    """(PSNR as searched, as fitted, seconds of the fit)."""
    genome, city = code(name, block, reach)
    start = time.perf_counter()
    fitted = fit_attractor(genome, city)
    seconds = time.perf_counter() - start
    before, after = (psnr(city, evocity.decode(one).city) for one in (genome, fitted))
    return before, after, seconds


if __name__ == "__main__":
    main()
