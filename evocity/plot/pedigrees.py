"""Where an individual comes from: its ancestors as pictures, and how many there were when."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from evocity.analysis import Individual, Run
from evocity.analysis.asked import ids_of
from evocity.analysis.births import Told
from evocity.analysis.pedigree import Pedigree, steps_of
from evocity.citymap import CityMap
from evocity.pictures import city_colours
from evocity.plot.chosen import highest_of, thumbnail, told_of
from evocity.plot.maps import city_patches
from evocity.plot.style import (
    DPI,
    FAINTS,
    GROUNDS,
    INKS,
    LIVING,
    OTHERS,
    SMALL,
    bare,
    credit,
    fit,
    key,
    lay,
    name_axes,
    panel,
    scale_bar,
    short,
    whole_numbers,
)

#: Pictures in a row, at most; steps back that have room.
MOST_IN_A_ROW, MOST_STEPS = 10, 12
_WIDTH = 10.0  # inches
_WIDE = 0.86  # of the room of a picture
_BAR, _WORDS, _BETWEEN = 0.07, 0.3, 0.3  # heights: of the shares, the caption, the lines


@dataclass(frozen=True)
class _Row:
    """Ancestors so many steps back: their rows in `Told`, those left out, where they stand."""

    rows: np.ndarray
    left_out: int
    x: np.ndarray


def pedigree(
    run: Run,
    individual: int | Individual,
    generations: int | None = 6,
    ax: Axes | None = None,
) -> Axes:
    """An individual below, its parents above it, theirs above these: as pictures, each with its id,
    the generation of its birth, its operator, and a bar of whose stones it is. Above all, how many
    of its ancestors were born in each generation, all the way back.

    Who is an ancestor in several ways stands in several rows. Of more than 10 in a row those are
    shown that most lines of descent go through.

    individual : an id, or an individual of the run.
    generations : steps back from child to parent; 12, which are drawn at most, if it is None.

    Raises `RunError` if there is no such birth, `EvocityError` for other ``generations``.
    """
    told = told_of(run)
    asked = steps_of(generations)
    steps = MOST_STEPS if asked is None else min(asked, MOST_STEPS)
    (own,) = told.rows(ids_of(individual, told))
    kin = Pedigree(told)
    rows, links = _rows(kin, own, steps)
    across = max(4.0, *(2 * np.abs(one.x).max() + 1 for one in rows))
    width = _WIDTH if ax is None else ax.get_position().width * ax.figure.get_figwidth()
    inch = min(1.0, (width - 2.2) / across)
    drawn = np.unique(np.concatenate([one.rows for one in rows]))
    births = {birth.id: birth for birth in told.run.individuals(told.ids[drawn].tolist())}
    cities = {one: told.expressed(birth).city for one, birth in births.items()}
    known = [city for city in cities.values() if city is not None]
    tall = _WIDE * (known[0].shape[0] / known[0].shape[1] if known else 1.0)
    words, between = _WORDS / inch, _BETWEEN / inch
    step = tall + _BAR + words + between
    height = len(rows) * step - between
    ax = panel(ax, across * inch + 2.2, height * inch + 1.7)
    bare(ax)
    ax.set_xlim(-across / 2, across / 2)
    ax.set_ylim(height, 0)
    highest = highest_of(told)
    for back, row in enumerate(rows):
        top = (len(rows) - 1 - back) * step
        for at, x in zip(row.rows, row.x, strict=True):
            one = int(told.ids[at])
            _draw(ax, told, births[one], cities[one], (x - _WIDE / 2, top, _WIDE, tall), highest,
                  inch)  # fmt: skip
        if row.left_out:
            ax.text(across / 2, top, f"+ {row.left_out}\nmore", fontsize=SMALL, color=FAINTS,
                    ha="left", va="top")  # fmt: skip
    lines = []
    for back, pairs in enumerate(links):
        low = (len(rows) - 1 - back) * step
        lines += [[(px, low - between), (cx, low)] for cx, px in pairs]
    ax.add_collection(LineCollection(lines, color=FAINTS, linewidth=0.7, zorder=1))
    if known:
        scale_bar(ax, -across / 2, _WIDE, known[0].shape[1] * known[0].metres_per_pixel / _WIDE)
    credit(ax, told.run.header.attribution)
    cut = asked != steps and steps < len(rows) and len(kin.parents(rows[-1].rows)[0]) > 0
    _density(ax, told, kin.ancestors(np.array([own])), drawn, height * inch, cut)
    key(ax, city_patches(told.run.header.cities))
    return fit(ax)


def _rows(kin: Pedigree, own: int, steps: int) -> tuple[list[_Row], list[np.ndarray]]:
    """The rows of the tree from the individual's own on, and of each the lines to the next, as
    (x of the child, x of the parent)."""
    rows, links = [_Row(np.array([own]), 0, np.zeros(1))], []
    paths = np.ones(1)
    for _ in range(steps):
        below = rows[-1]
        parents, children = kin.parents(below.rows)
        if not len(parents):
            break
        child = np.searchsorted(below.rows, children)
        found, which = np.unique(parents, return_inverse=True)
        through = np.bincount(which, paths[child])
        kept = np.sort(np.lexsort((found, -through))[:MOST_IN_A_ROW])
        # each near its children: the mean of where these stand
        mean = np.bincount(which, below.x[child]) / np.bincount(which)
        order = np.argsort(mean[kept], kind="stable")
        x = np.empty(len(kept))
        x[order] = np.arange(len(kept)) - (len(kept) - 1) / 2
        if 1 < len(kept) <= 4:  # a few stand apart
            x *= 1.25
        rows.append(_Row(found[kept], len(found) - len(kept), x))
        paths = through[kept]
        at = np.full(len(found), -1)
        at[kept] = np.arange(len(kept))
        shown = at[which] >= 0
        links.append(np.column_stack([below.x[child[shown]], x[at[which[shown]]]]))
    return rows, links


def _draw(ax: Axes, told: Told, birth, city: CityMap | None, place, highest, inch: float) -> None:
    left, top, width, tall = place
    if city is None:
        ax.add_patch(Rectangle((left, top), width, tall, facecolor=GROUNDS))
    else:
        lay(ax, thumbnail(city, highest, max(16, int(1.25 * inch * DPI))), place)
    fabric = birth.genome and told.run.header.chromosome.fabric(birth.genome)
    if fabric is not None:
        cities, at = fabric.cities, left
        for colour, share in zip(city_colours(cities), fabric.shares, strict=True):
            ax.add_patch(Rectangle((at, top + tall + 0.015), share * width, _BAR, facecolor=colour,
                                   linewidth=0))  # fmt: skip
            at += share * width
    letters = max(6, int(inch * 72 / (0.57 * SMALL)))
    cities = told.run.header.cities
    source = birth.operator == "source" and birth.id < len(cities)
    came = cities[birth.id] if source else birth.operator.replace("_", " ")
    text = f"{birth.id}, gen. {birth.generation}\n{short(came, letters)}"
    ax.text(left, top + tall + _BAR + 0.03, text, va="top", fontsize=SMALL, color=INKS,
            linespacing=1.1)  # fmt: skip


def _density(
    ax: Axes, told: Told, everyone: np.ndarray, drawn: np.ndarray, inches: float, cut: bool
) -> None:
    """How many of ``everyone`` were born in each generation; the ``drawn`` ones darker. ``cut``:
    more steps back were asked for, and there are some."""
    tall = 0.6 / max(inches, 0.6)
    at = ax.inset_axes([0, 1 + 0.55 * tall, 1, tall])
    at.set_facecolor("none")
    for side in ("top", "right"):
        at.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        at.spines[side].set_color(FAINTS)
    at.tick_params(colors=FAINTS, labelcolor=INKS, labelsize=SMALL, length=2)
    last = int(told.generation[everyone].max())
    for some, colour in ((everyone, OTHERS), (drawn, LIVING)):
        counts = np.bincount(told.generation[some], minlength=last + 1)
        at.bar(np.arange(last + 1), counts, 0.9 if last < 60 else 1.0, color=colour)
    at.set_xlim(-0.6, last + 0.6)
    whole_numbers(at)
    at.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=2))
    name_axes(at)
    at.set_title(
        f"{len(everyone) - 1} ancestors by the generation of their birth; red: drawn below"
        + f", {MOST_STEPS} steps back at most" * cut,
        fontsize=SMALL, color=INKS, loc="left",
    )  # fmt: skip


__all__ = ["MOST_IN_A_ROW", "MOST_STEPS", "pedigree"]
