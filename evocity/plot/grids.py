"""The grid of a run of MAP-Elites: the best birth of each cell."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Patch, Rectangle

from evocity.analysis import Run
from evocity.analysis.births import Told
from evocity.errors import RunError
from evocity.pictures import city_colours
from evocity.pictures.colours import gradient
from evocity.plot.chosen import cities_of, highest_of, thumbnail, told_of
from evocity.plot.style import (
    FAINTS,
    GROUNDS,
    INKS,
    LIVING,
    PAPERS,
    SMALL,
    Panels,
    bare,
    colour_scale,
    credit,
    fit,
    folded,
    height_scale,
    key,
    lay,
    name_axes,
    panels,
    plain,
    scale_bar,
    short,
)
from evocity.search.binning import Binned, binned, grid_of_run

# Cells as wide as this many points hold a map, and its number; so many slices of a third
# descriptor are drawn, and so many maps.
_MAP, _NUMBER = 14, 34
_MOST_SLICES, _MOST_MAPS = 12, 900
_INCHES, _WIDEST = 6.6, 1.0
_WORSE = "#e8d6ce"


def grid(
    run: Run, island: str | None = None, goal: str | None = None, ax: object = None
) -> Axes | Panels:
    """The cells of a run of ``map_elites``: in each filled one the map of its best birth of all,
    with its id where there is room, and beneath it a bar, full for the best of all. Cells into
    which the codes of the source cities fall have a frame in the city's colour. Of many or small
    cells a colour tells how good they are.

    island : of a run with islands, whose grid.
    goal : a measure or a sum, where the run, or the island, has several goals.
    ax : one of matplotlib's axes; of a grid of three descriptors as many as slices of the third
        are filled, at most 12.

    Returns the axes, of three descriptors several. Raises `RunError` for a run, or an island,
    without a grid, and where several goals are wanted and none is named.
    """
    told = told_of(run)
    cells = grid_of_run(told.run, island)
    if cells is None:
        raise RunError(
            f"{told.run.path} fills no grid",
            "a run of map_elites, or the name of an island that is one",
            'give island="…"' if told.run.header.islands else "see plot.front, or plot.gallery",
        )
    goal = told.quality_on(island) if goal is None else goal
    bins = binned(told.run, cells, told.last, goal)
    places = cells.places(bins.births["cell"].to_numpy())
    slices = [0]
    if len(cells.counts) == 3:
        slices = sorted(set(places[:, 2].tolist()))[:_MOST_SLICES] or [0]
    across, down = cells.counts[:2]
    columns = int(np.ceil(np.sqrt(len(slices))))
    inch = min(_WIDEST, _INCHES / (columns * max(across, down)))
    axes = panels(len(slices), ax, columns=columns, width=columns * (across * inch + 0.8) + 2.1,
                  height=down * inch + 1.4)  # fmt: skip
    maps = inch * 72 >= _MAP and len(bins) <= _MOST_MAPS
    cities = cities_of(told, bins.births["id"].to_pylist()) if maps else {}
    highest = highest_of(told)
    for one, number in zip(axes, slices, strict=True):
        kept = np.flatnonzero(places[:, 2] == number) if len(cells.counts) == 3 else slice(None)
        _slice(one, told, bins, places, kept, cities, highest, inch)
        if len(cells.counts) == 3:
            low, high = cells.edges(2)[number : number + 2]
            third = short(cells.descriptors[2], 30)
            one.set_title(f"{third}: {low:.4g} to {high:.4g}", fontsize=SMALL, color=INKS,
                          loc="left")  # fmt: skip
    frames = _frames(axes, slices, told, cells)
    filled = plain(f"{len(bins)} of {len(cells)} cells filled, best of each by {goal}")
    if len(axes) == 1:
        axes[0].set_title(filled, fontsize=SMALL, color=FAINTS, loc="left")
    else:
        axes[0].figure.suptitle(filled, fontsize=SMALL, color=FAINTS)
    if cities:
        city = next(iter(cities.values()))
        height_scale(axes[-1], highest)
        size = max(city.shape)
        axes[0].set_ylabel(axes[0].get_ylabel())
        scale_bar(axes[0], 0, 1, size * city.metres_per_pixel / 0.9, below=28)
    elif len(bins):
        worth = bins.worth
        scale = gradient((_WORSE, LIVING))(np.linspace(0, 1, 64))
        colour_scale(axes[-1], scale, 0, float(worth.max()) or 1.0, "worth")
    if frames:
        key(axes[-1], frames, loc="upper left", bbox_to_anchor=(1.01, 0.2))
    credit(axes[0], told.run.header.attribution, label="x")
    fit(axes[0])
    return axes[0] if len(cells.counts) < 3 else axes


def _slice(ax: Axes, told: Told, bins: Binned, places, kept, cities, highest, inch) -> None:
    """One slice: a unit a cell, the second descriptor to the north."""
    grid = bins.grid
    across, down = grid.counts[:2]
    bare(ax)
    ax.set_xlim(0, across)
    ax.set_ylim(down, 0)
    ax.add_patch(Rectangle((0, 0), across, down, facecolor=GROUNDS, zorder=0))
    for line in range(1, across):
        ax.axvline(line, color=PAPERS, linewidth=0.8, zorder=0.5)
    for line in range(1, down):
        ax.axhline(line, color=PAPERS, linewidth=0.8, zorder=0.5)
    ids = bins.births["id"].to_numpy()[kept]
    share = (bins.worth / max(float(bins.worth.max(initial=0)), 1e-300))[kept]
    left, top = places[kept, 0], down - 1 - places[kept, 1]
    if cities:
        for one, x, y in zip(ids.tolist(), left, top, strict=True):
            city = cities[one]
            size = 0.9 / max(city.shape)
            tall, wide = (side * size for side in city.shape)
            picture = thumbnail(city, highest, max(12, int(1.25 * inch * 100)))
            lay(ax, picture, (x + (1 - wide) / 2, y + 0.01 + (0.9 - tall) / 2, wide, tall))
            if inch * 72 >= _NUMBER:
                ax.text(x + 0.08, y + 0.88, f"{one}", fontsize=SMALL - 1, color=INKS, va="bottom",
                        bbox={"facecolor": PAPERS, "pad": 0.8, "linewidth": 0})  # fmt: skip
        bars = [Rectangle((x + 0.05, y + 0.93), 0.9 * s, 0.05)
                for x, y, s in zip(left, top, share, strict=True)]  # fmt: skip
        ax.add_collection(PatchCollection(bars, facecolor=LIVING, linewidth=0))
    else:
        squares = [Rectangle((x, y), 1, 1) for x, y in zip(left, top, strict=True)]
        colours = gradient((_WORSE, LIVING))(share) / 255
        ax.add_collection(PatchCollection(squares, facecolor=colours, linewidth=0, zorder=1))
    _ticks(ax, grid, inch)


def _ticks(ax: Axes, grid, inch: float) -> None:
    across, down = grid.counts[:2]
    for axis, count, apart in ((0, across, 0.5), (1, down, 0.3)):
        stride = max(1, int(np.ceil(apart / inch)))
        at = np.unique([*range(0, count + 1, stride)])
        at = np.append(at[count - at >= stride], count)
        values = [f"{value:.3g}" for value in grid.edges(axis)[at]]
        if axis == 0:
            ax.set_xticks(at, values)
        else:
            ax.set_yticks(count - at, values)
    ax.grid(False)
    name_axes(ax, folded(grid.descriptors[0], 40), folded(grid.descriptors[1], 40))


def _frames(axes: Panels, slices, told: Told, cells) -> list[Patch]:
    """A frame about the cell of each source city's own code; what a legend tells of them."""
    names, handles = told.run.header.cities, []
    for row in np.flatnonzero((told.operator == "source") & (told.ids < len(names))):
        city = names[int(told.ids[row])]
        values = np.array([[told.value(name)[row] for name in cells.descriptors]])
        cell = cells.cells(values)
        if cell[0] < 0:
            continue
        place = cells.places(cell)[0]
        third = int(place[2]) if len(place) == 3 else 0
        if third not in slices:
            continue
        colour = city_colours(names)[int(told.ids[row])]
        at = int(place[0]), cells.counts[1] - 1 - int(place[1])
        style = {"edgecolor": colour, "facecolor": "none", "linewidth": 2.2}
        axes[slices.index(third)].add_patch(Rectangle(at, 1, 1, zorder=3, clip_on=False, **style))
        handles.append(Patch(label=f"code of {short(city)}", **style))
    return handles


__all__ = ["grid"]
