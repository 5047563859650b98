"""The grid of a run of MAP-Elites: the best birth of each cell."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Patch, Rectangle

from evocity.analysis import Run
from evocity.analysis.births import Births
from evocity.analysis.thumbnails import cities_of, highest_of, thumbnail
from evocity.errors import RunError
from evocity.pictures import city_colours
from evocity.pictures.colours import gradient
from evocity.plot import style
from evocity.plot.births import births_of
from evocity.plot.style import Panels
from evocity.search.record.grid import Binned, binned, grid_of_run

# Points of the smallest cell with a map, with its id, and with lines between cells; slices and maps
# at most.
_MAP, _NUMBER, _LINED = 14, 34, 4
_MOST_SLICES, _MOST_MAPS = 12, 900
_INCHES, _WIDEST = 6.6, 1.0
_WORSE = "#e8d6ce"


def grid(
    run: Run, island: str | None = None, goal: str | None = None, ax: object = None
) -> Axes | Panels:
    """Draw the grid of births of a run with the algorithm ``map_elites``. Each filled cell shows
    the map of its best birth, with the id of the birth if there is room. A bar below each map shows
    the quality of the birth; the best birth of all cells has a full bar. A cell with the genome of
    a source city has a frame in the city's colour. If the cells are too small for maps, colours
    show the quality of the births in the cells.

    island : name of the island whose grid to draw, in a run with islands.
    goal : name of a measure, or of a sum of measures, that defines the quality; required if there
        are several goals.
    ax : axes of matplotlib. For a grid with three descriptors, give axes for each filled interval
        of the third descriptor, at most 12.

    Returns the axes of matplotlib; a grid with three descriptors returns several axes. Raises
    `RunError` if the run, or the island, has no grid. Raises `RunError` if the argument ``goal`` is
    missing although there are several goals.
    """
    births = births_of(run)
    cells = grid_of_run(births.run, island)
    if cells is None:
        raise RunError(
            f"the run {births.run.path} has no grid of births",
            "a run with the algorithm map_elites, or an island with that algorithm",
            'name the island: island="…"'
            if births.run.header.islands
            else "draw plot.front or plot.gallery instead",
        )
    goal = births.quality_on(island) if goal is None else goal
    bins = binned(births.run, cells, births.last, goal)
    places = cells.places(bins.births["cell"].to_numpy())
    slices, left = [0], 0
    if len(cells.counts) == 3:
        every = sorted(set(places[:, 2].tolist())) or [0]
        slices, left = every[:_MOST_SLICES], len(every[_MOST_SLICES:])
    across, down = cells.counts[:2]
    columns = int(np.ceil(np.sqrt(len(slices))))
    inch = min(_WIDEST, _INCHES / (columns * max(across, down)))
    width = columns * (across * inch + 0.8) + 2.1
    axes = style.panels(len(slices), ax, columns=columns, width=width, height=down * inch + 1.4)
    maps = inch * 72 >= _MAP and len(bins) <= _MOST_MAPS
    cities = cities_of(births, bins.births["id"].to_pylist()) if maps else {}
    highest = highest_of(births)
    for one, number in zip(axes, slices, strict=True):
        kept = np.flatnonzero(places[:, 2] == number) if len(cells.counts) == 3 else slice(None)
        _slice(one, births, bins, places, kept, cities, highest, inch)
        if len(cells.counts) == 3:
            low, high = cells.edges(2)[number : number + 2]
            third = style.short(cells.descriptors[2], 30)
            one.set_title(f"{third}: {low:.4g} to {high:.4g}", **style.INK_TEXT,
                          loc="left")  # fmt: skip
    frames = _frames(axes, slices, births, cells)
    filled = style.plain(f"{len(bins)} of {len(cells)} cells filled, best of each by {goal}")
    filled += f"; {left} more slices are not drawn" if left else ""
    if len(axes) == 1:
        axes[0].set_title(filled, **style.FAINT_TEXT, loc="left")
    else:
        axes[0].figure.suptitle(filled, **style.FAINT_TEXT)
    if cities:
        city = next(iter(cities.values()))
        style.height_scale(axes[-1], highest)
        size = max(city.shape)
        axes[0].set_ylabel(axes[0].get_ylabel())
        style.scale_bar(axes[0], 0, 1, size * city.metres_per_pixel / 0.9, below=28)
    elif len(bins):
        worth = bins.worth
        scale = gradient((_WORSE, style.LIVING))(np.linspace(0, 1, 64))
        style.colour_scale(axes[-1], scale, 0, float(worth.max()) or 1.0, "worth")
    if frames:
        style.key(axes[-1], frames, loc="upper left", bbox_to_anchor=(1.01, 0.2))
    style.credit(axes[0], births.run.header.attribution, label="x")
    style.fit(axes[0])
    return axes[0] if len(cells.counts) < 3 else axes


def _slice(ax: Axes, births: Births, bins: Binned, places, kept, cities, highest, inch) -> None:
    """One slice: a unit per cell, the second descriptor to the north."""
    grid = bins.grid
    across, down = grid.counts[:2]
    style.bare(ax)
    ax.set_xlim(0, across)
    ax.set_ylim(down, 0)
    ax.add_patch(Rectangle((0, 0), across, down, facecolor=style.GROUNDS, zorder=0))
    if inch * 72 >= _LINED:
        ax.vlines(range(1, across), 0, down, style.PAPERS, linewidth=0.8, zorder=0.5)
        ax.hlines(range(1, down), 0, across, style.PAPERS, linewidth=0.8, zorder=0.5)
    ids = bins.births["id"].to_numpy()[kept]
    share = (bins.worth / max(float(bins.worth.max(initial=0)), 1e-300))[kept]
    left, top = places[kept, 0], down - 1 - places[kept, 1]
    if cities:
        for one, x, y in zip(ids.tolist(), left, top, strict=True):
            city = cities[one]
            size = 0.9 / max(city.shape)
            tall, wide = (side * size for side in city.shape)
            picture = thumbnail(city, highest, max(12, int(1.25 * inch * 100)))
            style.lay(ax, picture, (x + (1 - wide) / 2, y + 0.01 + (0.9 - tall) / 2, wide, tall))
            if inch * 72 >= _NUMBER:
                box = {"facecolor": style.PAPERS, "pad": 0.8, "linewidth": 0}
                ax.text(x + 0.08, y + 0.88, f"{one}", fontsize=style.SMALL - 1, color=style.INKS,
                        va="bottom", bbox=box)  # fmt: skip
        bars = [Rectangle((x + 0.05, y + 0.93), 0.9 * s, 0.05)
                for x, y, s in zip(left, top, share, strict=True)]  # fmt: skip
        ax.add_collection(PatchCollection(bars, facecolor=style.LIVING, linewidth=0))
    else:
        squares = [Rectangle((x, y), 1, 1) for x, y in zip(left, top, strict=True)]
        colours = gradient((_WORSE, style.LIVING))(share) / 255
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
    style.name_axes(ax, style.fold(grid.descriptors[0], 40), style.fold(grid.descriptors[1], 40))


def _frames(axes: Panels, slices, births: Births, cells) -> list[Patch]:
    """A frame about the cell of each source city's own code; the entries of the legend."""
    names, handles = births.run.header.cities, []
    for number, place in births.source_cells(cells).items():
        third = int(place[2]) if len(place) == 3 else 0
        if third not in slices:
            continue
        city, colour = names[number], city_colours(names)[number]
        at = int(place[0]), cells.counts[1] - 1 - int(place[1])
        frame = {"edgecolor": colour, "facecolor": "none", "linewidth": 2.2}
        axes[slices.index(third)].add_patch(Rectangle(at, 1, 1, zorder=3, clip_on=False, **frame))
        handles.append(Patch(label=f"code of {style.short(city)}", **frame))
    return handles
