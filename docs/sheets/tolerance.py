"""Draws tolerance.png and prints its figures: what S, the tolerance along outlines, does to a
child of pavement fusion.

Run it with the Python that has evocity installed: python docs/sheets/tolerance.py
"""

from dataclasses import astuple, dataclass

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.coding import decode
from evocity.fitness import crumbs
from evocity.genome import Genome
from evocity.operators import make
from evocity.pictures import Shares
from evocity.pictures.picture import render_shares

PAIRS = (
    ("lyon-1er", "montpellier-pas-du-loup"),
    ("new-york-west-village", "montpellier-pas-du-loup"),
)
TOLERANCES = (1.0, 3.0, 6.0, 12.0, 24.0, 48.0)
#: Sides of the macro-blocks, metres: the default, the paper's small ones, its large ones.
SIZES = ((32, 128), (8, 64), (8, 256))
SEEDS = range(10)
#: The seed that is drawn.
DRAWN = 5


@dataclass(frozen=True)
class Figures:
    """What became of one child.

    fill : share of the second parent's range blocks; half was wanted.
    seam : metres of seam between the parents' range blocks, a hectare.
    step : mean difference of the parents' maps along the seam, on both its sides, metres.
    cut : of what the parents' buildings have in the child, the share that belongs to buildings
        of which a part is missing.
    joined : share of the child's built area that belongs to buildings with pixels of both.
    meant, child : crumbs a hectare of the map meant, and of the decoded child.
    """

    fill: float
    seam: float
    step: float
    cut: float
    joined: float
    meant: float
    child: float


def bred(parents: list[Genome], sides: tuple[int, int], tolerance: float, seed: int):
    """(figures, the decoded child, whose each pixel is: bool, the second parent's)."""
    fuse = make(
        "pavement_fusion", side_min=sides[0], side_max=sides[1], tolerance=tolerance, fill=0.5
    )
    draft = fuse.draft(parents, np.random.default_rng(seed))
    child = fuse(parents, np.random.default_rng(seed))
    city = decode(child).city
    second = child.pavement.raster(child.parent == 1).astype(bool)
    hectares = city.area / 1e4
    cities = [decode(parent).city for parent in parents]
    length, step = seam_of(second, [one.heights for one in cities])
    figures = Figures(
        fill=float(second.mean()),
        seam=length * city.metres_per_pixel / hectares,
        step=step,
        cut=cut_share(cities, second),
        joined=joined_share(city, second),
        meant=float(crumbs(city.replace(draft.intended))),
        child=float(crumbs(city)),
    )
    return figures, city, second


def seam_of(second: np.ndarray, maps: list[np.ndarray]) -> tuple[int, float]:
    """(pixel sides of the seam, mean difference of the two ``maps`` on both sides of it)."""
    apart = np.abs(maps[0] - maps[1])
    total, count = 0.0, 0
    for axis in (0, 1):
        others, gaps = np.moveaxis(second, axis, 0), np.moveaxis(apart, axis, 0)
        seam = others[1:] != others[:-1]
        total += float(gaps[1:][seam].sum(dtype=float) + gaps[:-1][seam].sum(dtype=float))
        count += np.count_nonzero(seam)
    return count, total / (2 * count) if count else 0.0


def cut_share(cities: list[evocity.CityMap], second: np.ndarray) -> float:
    """Share of the parents' buildings standing, by area, of which a part does not stand."""
    standing, cut = 0, 0
    for city, own in zip(cities, (~second, second), strict=True):
        labels = city.buildings.labels
        pixels = np.bincount(labels[labels > 0])
        here = np.bincount(labels[(labels > 0) & own], minlength=pixels.size)
        standing, cut = standing + here.sum(), cut + here[here < pixels].sum()
    return float(cut / standing)


def joined_share(city: evocity.CityMap, second: np.ndarray) -> float:
    """Share of the built area in buildings that have pixels of both parents."""
    labels = city.buildings.labels
    pixels = np.bincount(labels[labels > 0])
    theirs = np.bincount(labels[(labels > 0) & second], minlength=pixels.size)
    return float(pixels[(theirs > 0) & (theirs < pixels)].sum() / pixels.sum())


def main() -> None:
    rows, titles, thanks = [], [], {}
    for names in PAIRS:
        cities = [evocity.read_map(name) for name in names]
        parents = [evocity.encode(city).genome for city in cities]
        known = ", ".join(f"{crumbs(decode(parent).city):.2f}" for parent in parents)
        print(f"\n{' x '.join(names)}; crumbs a hectare of the parents' codes: {known}")
        thanks |= {city.name: city.attribution for city in cities}
        for sizes in SIZES:
            print(f"macro-blocks of {sizes[0]} to {sizes[1]} m, {len(SEEDS)} seeds")
            print("| S, m | fill | seam, m/ha | step, m | cut | joined | meant | child |")
            for tolerance in TOLERANCES:
                every = [astuple(bred(parents, sizes, tolerance, seed)[0]) for seed in SEEDS]
                f = Figures(*np.mean(every, axis=0))
                print(
                    f"| {tolerance:g} | {f.fill:.2f} | {f.seam:.0f} | {f.step:.1f} "
                    f"| {f.cut:.2f} | {f.joined:.2f} | {f.meant:.1f} | {f.child:.1f} |",
                    flush=True,
                )
        row = []
        for tolerance in TOLERANCES:
            figures, city, second = bred(parents, SIZES[0], tolerance, DRAWN)
            weights = np.stack([~second, second], axis=-1).astype(np.float32)
            picture = render_shares(Shares(city, weights, names, ""), legend=False)
            told = f"S = {tolerance:g} m: fill {figures.fill:.2f}, cut {figures.cut:.2f}"
            row.append((told, picture.resize((280, 280))))
        rows.append(row)
        titles.append(f"{names[0]} (blue) and {names[1]} (amber), fill .5 wanted")
    credits = [f"{name}: {attribution}" for name, attribution in thanks.items()]
    save(contact_sheet(rows, titles=titles, thanks=credits), "tolerance.png", colours=48)


if __name__ == "__main__":
    main()
