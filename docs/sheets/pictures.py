"""Draws leaves.png, usage.png, low-pass.png, high-pass.png, ancestry.png and towns.png of
docs/pictures.md.

Run it with the Python that has evocity installed: python docs/sheets/pictures.py
"""

import numpy as np
from _sheet import contact_sheet, save

import evocity
from evocity.coding import ancestry, high_pass, low_pass, usage
from evocity.operators import make
from evocity.pictures import Field, Leaves, Shares, render_leaves
from evocity.pictures.picture import render, render_field, render_shares
from evocity.towns import PATTERNS, substitution_town

LYON, NEW_YORK = "lyon-1er", "new-york-west-village"
NEAR, ALL = 24, None  # how far domain blocks are searched for


def coded(name: str, reach: int | None) -> evocity.Genome:
    return evocity.encode(evocity.read_map(name), reach=reach).genome


def map_of(genome: evocity.Genome):
    return render(evocity.decode(genome).city, highest=30, legend=False)


def draw_leaves() -> None:
    row = []
    for told, block in (("leaves of 2 to 16 px", None), ("B = 4", 4)):
        city = evocity.read_map(LYON, pixels=128)
        code = evocity.encode(city, block=block).genome
        leaves = Leaves(evocity.decode(code).city, code.pavement)
        picture = render_leaves(leaves, legend=False, zoom=4)
        row.append((f"{len(code)} lifs, {told}", picture))
    thanks = [f"{LYON}: {evocity.io.attribution_of(LYON)}"]
    save(contact_sheet([row], thanks=thanks), "leaves.png", colours=128)


def draw_usage() -> None:
    row = []
    for reach, told in ((NEAR, "within 24 px"), (ALL, "over the whole map")):
        genome = coded(LYON, reach)
        city = evocity.decode(genome).city
        field = Field(city, usage(genome).pixels.astype(np.float32), "calls of each pixel", "calls")
        row.append((f"Domain blocks searched for {told}", render_field(field, zoom=2)))
    save(contact_sheet([row]), "usage.png")


#: What filters count and change, with the title of a row.
PIXELS = {"By the calls of each pixel: pixels to ground (2002)": {}}
WAYS = {
    **PIXELS,
    "By the calls of what range blocks are made of: flat range blocks (2005)": {
        "count": "ranges",
        "part": "blocks",
    },
    "By the calls of each pixel: whole buildings to ground": {"part": "buildings"},
}


def draw_filter(filtering, frequencies: tuple[int, ...], name: str, ways: dict, block=None) -> None:
    genome = evocity.encode(evocity.read_map(LYON), reach=ALL, block=block).genome
    rows = []
    for how in ways.values():
        row = [("decoded", map_of(genome))]
        for f_c in frequencies:
            row.append((f"f_c = {f_c}", map_of(filtering(genome, f_c, **how))))
        rows.append(row)
    thanks = [f"{LYON}: {evocity.io.attribution_of(LYON)}"]
    save(contact_sheet(rows, titles=list(ways), thanks=thanks), name, colours=40)


def draw_ancestry() -> None:
    rows = []
    for reach, repair in ((ALL, None), (NEAR, 0.5)):
        parents = [coded(name, reach) for name in (LYON, NEW_YORK)]
        fuse = make("pavement_fusion", fill=0.5, repair=repair)
        child = fuse(parents, np.random.default_rng(7))
        city = evocity.decode(child).city
        row = []
        for depth in (0, 1, 8):
            shares = Shares(city, ancestry(child, depth=depth), child.cities, "")
            picture = render_shares(shares, legend=False, zoom=2).resize((360, 360))
            row.append((f"depth {depth}", picture))
        rows.append(row)
    titles = [
        "Domain blocks from the whole map, no repair: New York is built of Lyon's stones",
        "Domain blocks from within 24 px, collage repair: they mix along the seams alone",
    ]
    thanks = [f"blue, {LYON}: {evocity.io.attribution_of(LYON)}"]
    thanks += [f"amber, {NEW_YORK}: {evocity.io.attribution_of(NEW_YORK)}"]
    save(contact_sheet(rows, titles=titles, thanks=thanks), "ancestry.png", colours=48)


def draw_towns() -> None:
    def drawn(city):
        return render(city, highest=24, legend=False, zoom=2).resize((300, 300))

    steps = [
        (f"iteration {count}" if count > 1 else "the motif", drawn(town))
        for count in (1, 2, 3, 4)
        for town in [substitution_town(iterations=count)]
    ]
    towns = [(name, drawn(town(rng=np.random.default_rng(7)))) for name, town in PATTERNS.items()]
    titles = ["A motif put in the place of each of its own shapes", "The towns, each by seed 7"]
    save(contact_sheet([steps, towns], titles=titles), "towns.png", colours=64)


if __name__ == "__main__":
    draw_leaves()
    draw_usage()
    draw_filter(low_pass, (100, 10, 1), "low-pass.png", WAYS, block=4)
    by_ranges = {"By the calls of what each range block is made of": {"count": "ranges"}}
    draw_filter(high_pass, (1, 2, 10), "high-pass.png", PIXELS | by_ranges)
    draw_ancestry()
    draw_towns()
