"""Pedigrees: the ancestors of an individual as pictures, and their number by generation."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from evocity.analysis import Individual, Run
from evocity.analysis.arguments import ids_of
from evocity.analysis.births import Births
from evocity.analysis.pedigree import Pedigree, steps_of
from evocity.analysis.thumbnails import highest_of, thumbnail
from evocity.citymap import CityMap
from evocity.pictures import city_colours
from evocity.plot import style
from evocity.plot.births import births_of
from evocity.plot.maps import city_patches

#: Pictures in a row, and steps back, at most.
MOST_IN_A_ROW, MOST_STEPS = 10, 12
_WIDTH = 10.0  # inches
_WIDE = 0.86  # of the room of a picture
_BAR, _WORDS, _BETWEEN = 0.07, 0.3, 0.3  # heights: of the shares, the caption, the lines


@dataclass(frozen=True)
class _Row:
    """Ancestors some steps back: their rows in `Births`, the number left out, their places."""

    rows: np.ndarray
    left_out: int
    x: np.ndarray


def pedigree(
    run: Run, individual: int | Individual, generations: int | None = 6, ax: Axes | None = None
) -> Axes:
    """Draw the pedigree of an individual, with the individual at the bottom and its parents in the
    row above. Each row shows the parents of the individuals in the row below it. The label of a
    picture shows id, generation of birth, operator, and a bar with the shares of the source cities.
    The chart at the top counts all ancestors of the individual by the generation of their birth.

    An ancestor appears in several rows if lines of descent with different numbers of steps lead to
    it. A row shows at most 10 ancestors, namely those with the most lines of descent to the
    individual.

    individual : individual whose pedigree to draw, or its id.
    generations : number of steps back from child to parent, at most 12; None means 12.

    Raises `RunError` if the run does not contain the individual, and `EvocityError` if the number
    of generations is out of range.
    """
    births = births_of(run)
    requested = steps_of(generations)
    steps = MOST_STEPS if requested is None else min(requested, MOST_STEPS)
    (own,) = births.rows(ids_of(individual, births))
    kin = run.pedigree
    rows, links = _rows(kin, own, steps)
    across = max(4.0, *(2 * np.abs(one.x).max() + 1 for one in rows))
    width = _WIDTH if ax is None else ax.get_position().width * ax.figure.get_figwidth()
    inch = min(1.0, (width - 2.2) / across)
    drawn = np.unique(np.concatenate([one.rows for one in rows]))
    logged = {birth.id: birth for birth in births.run.individuals(births.ids[drawn].tolist())}
    cities = {one: births.expressed(birth).city for one, birth in logged.items()}
    known = [city for city in cities.values() if city is not None]
    tall = _WIDE * (known[0].shape[0] / known[0].shape[1] if known else 1.0)
    words, between = _WORDS / inch, _BETWEEN / inch
    step = tall + _BAR + words + between
    height = len(rows) * step - between
    ax = style.panel(ax, across * inch + 2.2, height * inch + 1.7)
    style.bare(ax)
    ax.set_xlim(-across / 2, across / 2)
    ax.set_ylim(height, 0)
    highest = highest_of(births)
    for back, row in enumerate(rows):
        top = (len(rows) - 1 - back) * step
        for at, x in zip(row.rows, row.x, strict=True):
            one = int(births.ids[at])
            _draw(ax, births, logged[one], cities[one], (x - _WIDE / 2, top, _WIDE, tall), highest,
                  inch)  # fmt: skip
        if row.left_out:
            ax.text(across / 2, top, f"+ {row.left_out}\nmore", **style.FAINT_TEXT,
                    ha="left", va="top")  # fmt: skip
    lines = []
    for back, pairs in enumerate(links):
        low = (len(rows) - 1 - back) * step
        lines += [[(px, low - between), (cx, low)] for cx, px in pairs]
    ax.add_collection(LineCollection(lines, color=style.FAINTS, linewidth=0.7, zorder=1))
    if known:
        style.scale_bar(
            ax, -across / 2, _WIDE, known[0].shape[1] * known[0].metres_per_pixel / _WIDE
        )
    style.credit(ax, births.run.header.attribution)
    cut = requested != steps and steps < len(rows) and len(kin.parents(rows[-1].rows)[0]) > 0
    _density(ax, births, kin.ancestors(np.array([own])), drawn, height * inch, cut)
    style.key(ax, city_patches(births.run.header.cities))
    return style.fit(ax)


def _rows(kin: Pedigree, own: int, steps: int) -> tuple[list[_Row], list[np.ndarray]]:
    """The rows of the tree, and the lines from each to the next, as (x of the child, x of the
    parent)."""
    rows, links = [_Row(np.array([own]), 0, np.zeros(1))], []
    paths = np.ones(1)
    for _ in range(steps):
        below = rows[-1]
        parents, children = kin.parents(below.rows)
        if not len(parents):
            break
        child = np.searchsorted(below.rows, children)
        unique, which = np.unique(parents, return_inverse=True)
        through = np.bincount(which, paths[child])
        kept = np.sort(np.lexsort((unique, -through))[:MOST_IN_A_ROW])
        # each near its children: the mean of where these stand
        mean = np.bincount(which, below.x[child]) / np.bincount(which)
        order = np.argsort(mean[kept], kind="stable")
        x = np.empty(len(kept))
        x[order] = np.arange(len(kept)) - (len(kept) - 1) / 2
        if 1 < len(kept) <= 4:  # a few have wider gaps
            x *= 1.25
        rows.append(_Row(unique[kept], len(unique) - len(kept), x))
        paths = through[kept]
        at = np.full(len(unique), -1)
        at[kept] = np.arange(len(kept))
        shown = at[which] >= 0
        links.append(np.column_stack([below.x[child[shown]], x[at[which[shown]]]]))
    return rows, links


def _draw(
    ax: Axes, births: Births, birth, city: CityMap | None, place, highest, inch: float
) -> None:
    left, top, width, tall = place
    if city is None:
        ax.add_patch(Rectangle((left, top), width, tall, facecolor=style.GROUNDS))
    else:
        style.lay(ax, thumbnail(city, highest, max(16, int(1.25 * inch * style.DPI))), place)
    fabric = birth.genome and births.run.header.chromosome.fabric(birth.genome)
    if fabric is not None:
        cities, at = fabric.cities, left
        for colour, share in zip(city_colours(cities), fabric.shares, strict=True):
            ax.add_patch(Rectangle((at, top + tall + 0.015), share * width, _BAR, facecolor=colour,
                                   linewidth=0))  # fmt: skip
            at += share * width
    letters = max(6, int(inch * 72 / (0.57 * style.SMALL)))
    cities = births.run.header.cities
    source = birth.operator == "source" and birth.id < len(cities)
    came = cities[birth.id] if source else birth.operator.replace("_", " ")
    text = f"{birth.id}, gen. {birth.generation}\n{style.short(came, letters)}"
    ax.text(left, top + tall + _BAR + 0.03, text, va="top", **style.INK_TEXT,
            linespacing=1.1)  # fmt: skip


def _density(
    ax: Axes, births: Births, everyone: np.ndarray, drawn: np.ndarray, inches: float, cut: bool
) -> None:
    """The number of ancestors, ``everyone``, by generation of birth; the ``drawn`` ones darker."""
    tall = 0.6 / max(inches, 0.6)
    at = ax.inset_axes([0, 1 + 0.55 * tall, 1, tall])
    at.set_facecolor("none")
    for side in ("top", "right"):
        at.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        at.spines[side].set_color(style.FAINTS)
    at.tick_params(colors=style.FAINTS, labelcolor=style.INKS, labelsize=style.SMALL, length=2)
    last = int(births.generation[everyone].max())
    for some, colour in ((everyone, style.OTHERS), (drawn, style.LIVING)):
        counts = np.bincount(births.generation[some], minlength=last + 1)
        at.bar(np.arange(last + 1), counts, 0.9 if last < 60 else 1.0, color=colour)
    at.set_xlim(-0.6, last + 0.6)
    style.whole_numbers(at)
    at.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=2))
    style.name_axes(at)
    at.set_title(
        f"{len(everyone) - 1} ancestors by the generation of their birth; red: drawn below"
        + f", {MOST_STEPS} steps back at most" * cut,
        **style.INK_TEXT, loc="left"
    )  # fmt: skip
