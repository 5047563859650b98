"""Draws gallery/NAME.webp, bred cities, and writes docs/gallery.md, which says how each was bred.

Run it with the Python that has evocity installed: python docs/sheets/gallery.py [OPERATOR]...
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from _sheet import IMAGES

import evocity
from evocity.growth import grow
from evocity.operators import make
from evocity.pictures import render

PAGE = Path(__file__).parents[1] / "gallery.md"
BEGIN = "<!-- what follows is written by docs/sheets/gallery.py -->\n"
HIGHEST = 40.0  # one scale of heights for all, metres
LYON, MONTPELLIER, NEW_YORK, CAPE_TOWN, VILLEURBANNE = (
    *("lyon-1er", "montpellier-pas-du-loup", "new-york-west-village"),
    *("cape-town-salt-river", "villeurbanne-gratte-ciel"),
)


@dataclass(frozen=True)
class Bred:
    """One picture: its operator, its parents, and a description."""

    title: str
    words: str
    operator: str
    parents: tuple[str, ...]
    seed: int
    parameters: dict = field(default_factory=dict)

    @property
    def file(self) -> str:
        return f"gallery/{self.operator.replace('_', '-')}-{self.seed}.webp"


CITIES = (
    Bred(
        "The streets of Lyon, the houses of New York",
        "The child keeps the streets and squares of Lyon. Whole buildings of New York fill the "
        "street blocks of Lyon.",
        "quarter_fusion",
        (LYON, NEW_YORK),
        3,
        {"fill": 0.5},
    ),
    Bred(
        "The streets of New York, the houses of Villeurbanne",
        "The operator `quarter_fusion` made this child from New York and Villeurbanne. The source "
        "of Villeurbanne has no heights, so its houses have the default height of 6 m and appear "
        "pale.",
        "quarter_fusion",
        (NEW_YORK, VILLEURBANNE),
        11,
        {"fill": 0.4},
    ),
    Bred(
        "New York rearranged",
        "The operator `quarter_refill` fills the street blocks of a city with turned and moved "
        "buildings of the same city.",
        "quarter_refill",
        (NEW_YORK,),
        5,
        {"street_blocks": 12},
    ),
    Bred(
        "Whole groups of Cape Town in Montpellier",
        "The operator `region_fusion` copies whole buildings from the second parent, as groups of "
        "range blocks. In the child, buildings of the second parent replace buildings of the "
        "first parent.",
        "region_fusion",
        (MONTPELLIER, CAPE_TOWN),
        2,
    ),
    Bred(
        "Three cities in squares",
        "The operator `pavement_fusion` places square pieces (macro-blocks) of three parents side "
        "by side, from large to small. The seams between macro-blocks cut some buildings and "
        "create new buildings.",
        "pavement_fusion",
        (LYON, MONTPELLIER, NEW_YORK),
        4,
    ),
    Bred(
        "Lyon, higher and lower",
        "In the child, every building of Lyon keeps its footprint. Some buildings of the "
        "child become higher and some lower, by whole storeys.",
        "height_scaling",
        (LYON,),
        8,
    ),
    Bred(
        "New York moved",
        "The operator `relocation` moves groups of lifs to other places, together with their "
        "domain blocks.",
        "relocation",
        (NEW_YORK,),
        6,
    ),
    Bred(
        "Half-way from Lyon to Montpellier",
        "The child consists of patches, and all lifs of a patch come from the same parent. The "
        "edges of the patches cut buildings. Except for `relocation`, most operators avoid cutting "
        "buildings.",
        "lambda_crossover",
        (LYON, MONTPELLIER),
        1,
    ),
    Bred(
        "A fabric without end",
        "The picture shows one window of an endless fabric of streets and buildings. The fabric "
        "grows from Lyon and New York, beyond the extent of the two maps.",
        "grow",
        (LYON, NEW_YORK),
        9,
    ),
)


def main(operators: list[str]) -> None:
    (IMAGES / "gallery").mkdir(exist_ok=True)
    codes = {
        name: evocity.encode(evocity.read_map(name), settle="roofs").genome
        for name in evocity.cities()
    }
    for one in CITIES:
        if operators and one.operator not in operators:
            continue
        city = bred(one, [codes[name] for name in one.parents])
        picture = render(city.replace(city.heights, name=one.title), highest=HIGHEST, zoom=2)
        target = IMAGES / one.file
        picture.save(target, quality=78, method=6)
        print(f"wrote {target.relative_to(IMAGES.parent)}, {target.stat().st_size // 1024} KB")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


def bred(one: Bred, parents: list[evocity.Genome]) -> evocity.CityMap:
    rng = np.random.default_rng(one.seed)
    if one.operator == "grow":
        return grow(parents, 256, 256, rng).city(700, 900, 256, 256)
    return evocity.decode(make(one.operator, **one.parameters)(parents, rng)).city


def page(text: str) -> str:
    """Write the cities of the page ``text`` again."""
    return text.split(BEGIN)[0] + BEGIN + "".join(map(section, CITIES))


def section(one: Bred) -> str:
    given = "".join(f", {name}={value!r}" for name, value in one.parameters.items())
    parents = " × ".join(f"`{name}`" for name in one.parents)
    thanks = "; ".join(dict.fromkeys(map(evocity.io.attribution_of, one.parents)))
    made = (
        "grow(genomes, 256, 256, rng).city(700, 900, 256, 256)"
        if one.operator == "grow"
        else f'make("{one.operator}"{given})'
    )
    anchor = "fabric-that-grows" if one.operator == "grow" else one.operator
    return (
        f"\n## {one.title}\n\n{one.words}\n\n![{one.title}](images/{one.file})\n\n"
        "| parents | operator | seed | attribution of the maps |\n|---|---|---|---|\n"
        f"| {parents} | [`{one.operator}`](operators.md#{anchor}), `{made}` | {one.seed} "
        f"| {thanks} |\n"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
