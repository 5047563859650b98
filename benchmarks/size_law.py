"""Salingaros' law on fixed and own ranges: python benchmarks/size_law.py [--maps FOLDER …]

The cities of the folders that evocity reads, or the bundled ones, 512 m at 2 m a pixel, in the
order of the new score; then sizes drawn exactly from the law, all alike, or from other laws. Of
each the buildings that count, `salingaros_buildings`, `salingaros_law` with its exponent, range,
buildings within it, their share, and p; the exponent and the range of Clauset's choice, by the
least distance; milliseconds of `salingaros_law` once the map has its buildings.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from _machine import description, timed

import evocity
from evocity import CityMap
from evocity.errors import EvocityError
from evocity.fitness import fit_size_law, get, salingaros_buildings, salingaros_law
from evocity.fitness.size_law import NUMBERS, counted_sizes
from evocity.fitness.sizes import _law_score

HEAD = (
    f"{'':34}{'N':>5}{'old':>9}{'new':>7}{'m':>7}  {'range, m':>11}{'n':>5}{'share':>7}{'p':>7}"
    f"   {'Clauset: m, range, m':>21}{'ms':>6}"
)


def line(name: str, city: CityMap) -> tuple[float, str]:
    """(new score, row of the table) of a map."""
    sizes = counted_sizes(city)
    old, new = salingaros_buildings(city), salingaros_law(city)
    row = f"{name[:33]:34}{sizes.size:5}{old:9.5f}{new:7.3f}"
    if math.isnan(new) or not new:
        return (-1.0, row)
    number = {one: get(f"salingaros_law.{one}")(city) for one in NUMBERS[1:]}
    least, _ = timed(lambda: fit_size_law(counted_sizes(city), city.metres_per_pixel))
    clauset = fit_size_law(sizes, city.metres_per_pixel, "distance")
    return new, (
        f"{row}{number['exponent']:7.2f}  {span(number['smallest'], number['largest'])}"
        f"{number['sizes']:5.0f}{number['share']:7.2f}{number['p']:7.3f}"
        f"   {clauset.m:8.2f}  {span(clauset.smallest, clauset.largest)}{least:6.2f}"
    )


def span(smallest: float, largest: float) -> str:
    return f"{f'{smallest:.1f} – {largest:.0f}':>11}"


def drawn() -> dict[str, np.ndarray]:
    """Sizes of towns by name, metres."""
    ranks, rng = (np.arange(200) + 0.5) / 200, np.random.default_rng(7)
    law = {
        f"exact, m = {m:g}, {low} to {10 * low} m": low
        * np.exp(-np.log1p(ranks * np.expm1(-m * math.log(10))) / m)
        for m, low in ((1.0, 8), (1.5, 8), (2.0, 8), (1.5, 5), (1.5, 20))
    }
    return law | {
        "exact, m = 0.5, 8 to 80 m": 8 / (1 - ranks * (1 - 10**-0.5)) ** 2,
        "exact, m = 3, 8 to 80 m": 8 / np.cbrt(1 - 0.999 * ranks),
        "uniform, 8 to 80 m": rng.uniform(8, 80, 200),
        "log-normal, deviation .2": np.exp(rng.normal(3, 0.2, 200)),
        "log-normal, deviation .5": np.exp(rng.normal(3, 0.5, 200)),
        "log-normal, deviation 1": np.exp(rng.normal(3, 1, 200)),
        "20 m, within 10 %": rng.uniform(18, 22, 200),
        "half 8 m, half 80 m": np.repeat([8.0, 80.0], 100),
    }


def is_map(path: Path | str) -> bool:
    """Whether a path is neither a text, nor ground below another raster, nor a copy in a zip."""
    return Path(path).suffix not in (".md", ".zip") and "-dem" not in str(path)


def read(path: Path | str) -> CityMap:
    """512 m of a city at 2 m; of a surface model, the heights above its terrain model."""
    if "-dsm" not in str(path):
        return evocity.read_map(path, pixels=256, metres_per_pixel=2.0)
    surface, ground = (
        evocity.read_map(str(path).replace("-dsm", kind), metres_per_pixel=2.0)
        for kind in ("-dsm", "-dem")
    )
    return surface.replace(np.maximum(surface.heights - ground.heights, 0))


def main(folders: list[Path]) -> None:
    print(description())
    rows, left_out = [], []
    paths = [path for folder in folders for path in sorted(folder.iterdir())]
    for path in paths or evocity.cities():
        try:
            rows.append(line(Path(path).name, read(path)) if is_map(path) else None)
        except EvocityError as error:
            left_out.append(str(error).splitlines()[0])
    rows = [row for row in rows if row]
    print(HEAD)
    for _, row in sorted(rows, reverse=True):
        print(row)
    print(f"\n{'drawn':34}{'N':>5}{'old':>9}{'new':>7}{'m':>7}  {'range, m':>11}{'n':>5}")
    for name, sizes in drawn().items():
        law = fit_size_law(sizes)
        old = _law_score(sizes**2, "sizes")
        print(
            f"{name:34}{sizes.size:5}{old:9.5f}{law.score:7.3f}{law.m:7.2f}  "
            f"{span(law.smallest, law.largest)}{law.n:5}"
        )
    print("\nleft out", *left_out, sep="\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--maps", type=Path, nargs="*", default=[], help="folders of maps")
    main(parser.parse_args().maps)
