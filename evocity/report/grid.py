"""The grid of a run of MAP-Elites as a picture, with the map of the best birth in each cell."""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from evocity.analysis import Run
from evocity.analysis.births import Births
from evocity.analysis.thumbnails import cities_of, highest_of
from evocity.citymap import CityMap
from evocity.pictures.colours import FAINT, GROUND, INK, PAPER
from evocity.pictures.legend import font
from evocity.pictures.picture import render
from evocity.pictures.sheet import draw_scale
from evocity.report.contact_sheet import contact_sheet
from evocity.search.record.grid import Binned
from evocity.selection.cells import Grid

# Pixels of all cells together, about, and of the widest cell.
_WIDTH, _WIDEST = 1440, 160
# Pixels of the smallest cell that holds a map, and maps at most; else cells are coloured.
_LEAST, _MOST_MAPS = 14, 1600
# Slices of a third descriptor, at most.
_MOST_SLICES = 36
# Individuals whose genomes are held at a time.
_AT_A_TIME = 128
# Pixels of the smallest cell with the id of its birth.
_NUMBERED = 40

_LEFT, _TOP, _GAP, _LINE, _TICK = 92, 64, 28, 17, 5
_BAR = (176, 64, 63)  # quality of a cell; the report's colour of a front
_WORST = (232, 214, 206)
_PARENT = (63, 116, 163)  # the report's colour of the first population


def grid_picture(run: Run, island: str | None = None) -> Image.Image:
    """Draw the grid of births of a run, or of an ``island``. The first descriptor increases to the
    right, and the second descriptor increases upwards. If the grid has a third descriptor, each
    interval of the third descriptor has a separate picture. Each filled cell shows the map of its
    best birth, with the id of the birth if there is room. A bar below each map shows the quality of
    the birth. The scale of the bars runs from the reference point of the hypervolume to the best
    birth of all cells. A frame marks the cells that contain the genomes of the parents.

    Raises ValueError if the run, or the island, has no grid.
    """
    births = run.columns
    binned = births.grids.get(island)
    if binned is None:
        raise ValueError("a run without a grid")
    plain, title = font(13), font(22)
    layout = _Layout.of(binned)
    highest = highest_of(births)
    codes = births.source_cells(binned.grid)
    texts = _texts(binned, layout, births.quality_on(island), [run.header.cities[n] for n in codes])
    lines = [line for text in texts for line in _wrapped(text, layout)]
    lines += _wrapped(run.header.attribution, layout)
    low = layout.low
    sheet = Image.new("RGB", (layout.width, layout.words + _LINE * len(lines) + 16), PAPER)
    draw = ImageDraw.Draw(sheet)
    of = run.name if island is None else f"{run.name}, {island}"
    draw.text((20, 18), f"{of}, generation {births.last}", INK, title)
    for number in range(len(layout.slices)):
        _draw_axes(sheet, draw, layout, number, plain)
    _fill(sheet, draw, births, binned, layout, highest)
    for place in codes.values():
        if (at := layout.corner(place)) is not None:
            draw.rectangle((at[0] - 1, at[1] - 1, *(x + layout.side for x in at)), None, _PARENT, 3)
    if layout.maps:
        draw_scale(sheet, draw, (20, low), min(layout.width - 40, 420), highest, plain)
    for index, text in enumerate(lines):
        draw.text((20, layout.words + index * _LINE), text, FAINT, plain)
    return sheet


def run_picture(run: Run) -> Image.Image:
    """Draw a run as one picture. The picture is the grid if the run has a grid, otherwise a
    `contact_sheet`. Raises `RunError` if the run has no complete generation yet, or is damaged."""
    return grid_picture(run) if None in run.columns.grids else contact_sheet(run)


@dataclass(frozen=True)
class _Layout:
    """The places of cells: the ``side`` of a cell, px; ``slices`` of the third descriptor;
    ``across`` of them in a row; ``maps`` in the cells."""

    grid: Grid
    side: int
    slices: tuple[int, ...]
    across: int
    maps: bool

    @classmethod
    def of(cls, binned: Binned) -> "_Layout":
        grid = binned.grid
        slices: tuple[int, ...] = (0,)
        if len(grid.counts) == 3:
            filled = sorted(set(binned.births[f"cell.{grid.descriptors[2]}"].to_pylist()))
            slices = tuple(filled[:_MOST_SLICES]) or (0,)
        across = int(np.ceil(np.sqrt(len(slices))))
        side = min(_WIDEST, max(1, _WIDTH // (across * max(grid.counts[:2]))))
        return cls(grid, side, slices, across, side >= _LEAST and len(binned) <= _MOST_MAPS)

    @property
    def tile(self) -> tuple[int, int]:
        """Width and height of a slice with its axes, px."""
        columns, rows = self.grid.counts[:2]
        return _LEFT + columns * self.side + _GAP, rows * self.side + 84

    @property
    def width(self) -> int:
        return max(self.across * self.tile[0], 480)

    @property
    def low(self) -> int:
        return _TOP + -(-len(self.slices) // self.across) * self.tile[1]

    @property
    def words(self) -> int:
        """The top of the text, below the scale of heights if there are maps."""
        return self.low + 44 * self.maps

    def origin(self, number: int) -> tuple[int, int]:
        """Return the north-west corner of the cells of a slice."""
        row, column = divmod(number, self.across)
        return column * self.tile[0] + _LEFT, _TOP + row * self.tile[1] + _LINE

    def corner(self, place) -> tuple[int, int] | None:
        """Return the north-west corner of a cell; None if its slice is not drawn."""
        third = int(place[2]) if len(place) == 3 else 0
        if third not in self.slices:
            return None
        left, top = self.origin(self.slices.index(third))
        row = self.grid.counts[1] - 1 - int(place[1])
        return left + int(place[0]) * self.side, top + row * self.side


def _texts(binned: Binned, layout: _Layout, goal: str, parents: list[str]) -> list[str]:
    cells = (
        f"{len(binned)} of {len(binned.grid)} cells are filled ({binned.coverage:.1%}), "
        f"QD-score {binned.qd_score:.4g}."
    )
    named = ", with its id" if layout.maps and layout.side >= _NUMBERED else ""
    best = f"Each filled cell shows the best of all births by {goal}{named}"
    bar = "; the bar shows its quality, full for the best of all." if layout.maps else "."
    colours = "" if layout.maps else " The redder, the better."
    drawn = len(layout.slices)
    third = binned.grid.descriptors[2:]
    filled = len(set(binned.births[f"cell.{third[0]}"].to_pylist())) if third else drawn
    left = f" {filled - drawn} more slices are not drawn." if filled > drawn else ""
    ends = " Values beyond a range lie in the cell at its end."
    framed = f" Blue frames: the codes of {' and '.join(parents)}." if parents else ""
    return [cells, best + bar + colours + ends + framed + left]


def _wrapped(text: str, layout: _Layout) -> list[str]:
    return textwrap.wrap(text, max(20, (layout.width - 40) // 7))


def _draw_axes(sheet, draw, layout: _Layout, number: int, plain) -> None:
    grid, side = layout.grid, layout.side
    left, top = layout.origin(number)
    columns, rows = grid.counts[:2]
    right, low = left + columns * side, top + rows * side
    draw.rectangle((left - 1, top - 1, right, low), GROUND, FAINT)
    if side >= 6:
        for column in range(1, columns):
            draw.line((left + column * side - 1, top, left + column * side - 1, low - 1), PAPER)
        for row in range(1, rows):
            draw.line((left, top + row * side - 1, right - 1, top + row * side - 1), PAPER)
    for place, value in _ticks(grid.edges(0), side, 56):
        x = left + place * side - 1
        draw.line((x, low, x, low + _TICK), FAINT)
        draw.text((x, low + _TICK + 3), value, INK, plain, "mt")
    for place, value in _ticks(grid.edges(1), side, 24):
        y = low - place * side - 1
        draw.line((left - _TICK - 1, y, left - 1, y), FAINT)
        draw.text((left - _TICK - 4, y), value, INK, plain, "rm")
    names = [_short(one) for one in grid.descriptors]
    name = font(16)
    draw.text(((left + right) // 2, low + 27), names[0], INK, name, "mt")
    _draw_upwards(sheet, (left - _LEFT + 18, (top + low) // 2), names[1], name)
    if len(grid.counts) == 3:
        edges, third = grid.edges(2), layout.slices[number]
        span = f"{names[2]}: {edges[third]:.4g} to {edges[third + 1]:.4g}"
        draw.text((left, top - _LINE - 3), span, INK, plain)


def _short(name: str) -> str:
    return name if len(name) <= 40 else name[:39] + "…"


def _ticks(edges: np.ndarray, side: int, apart: int) -> Iterator[tuple[int, str]]:
    """(number, value) of edges at least ``apart`` px from each other, with both ends."""
    last = len(edges) - 1
    stride = max(1, -(-apart // side))
    shown = [place for place in range(0, last, stride) if last - place >= stride]
    for place in dict.fromkeys([0, *shown, last]):
        yield place, f"{edges[place]:.3g}"


def _draw_upwards(sheet, middle, text: str, plain) -> None:
    box = plain.getbbox(text)
    label = Image.new("RGB", (box[2] + 2, box[3] + 2), PAPER)
    ImageDraw.Draw(label).text((0, 0), text, INK, plain)
    turned = label.rotate(90, expand=True)
    sheet.paste(turned, (middle[0] - turned.width // 2, max(0, middle[1] - turned.height // 2)))


def _fill(sheet, draw, births: Births, binned: Binned, layout: _Layout, highest: float) -> None:
    ids = binned.births["id"].to_pylist()
    places = binned.grid.places(binned.births["cell"].to_numpy())
    share = binned.worth / max(float(np.max(binned.worth, initial=0)), 1e-300)
    corners = [layout.corner(place) for place in places]
    shown = {
        one: (at, float(good))
        for one, at, good in zip(ids, corners, share, strict=True)
        if at is not None
    }
    if not layout.maps:
        for (left, top), good in shown.values():
            pairs = zip(_WORST, _BAR, strict=True)
            colour = tuple(round(pale + good * (full - pale)) for pale, full in pairs)
            size = max(layout.side - 2, 0) if layout.side >= 6 else layout.side - 1
            draw.rectangle((left, top, left + size, top + size), colour)
        return
    side, bar = layout.side - 1, max(2, layout.side // 18)
    number = font(min(13, max(9, layout.side // 7)))
    for one, city in _cities(births, sorted(shown)):
        (left, top), good = shown[one]
        picture = render(city, highest=highest, legend=False)
        tall, wide = city.shape
        scale = min(side / wide, (side - bar) / tall)
        size = max(1, round(wide * scale)), max(1, round(tall * scale))
        small = picture.resize(
            size, Image.Resampling.BOX if scale < 1 else Image.Resampling.NEAREST
        )
        sheet.paste(small, (left + (side - size[0]) // 2, top))
        low = top + side - bar
        if layout.side >= _NUMBERED:
            at = left + 2, low - 2
            box = draw.textbbox(at, str(one), number, "lb")
            draw.rectangle((box[0] - 2, box[1] - 1, box[2] + 1, box[3] + 1), PAPER)
            draw.text(at, str(one), INK, number, "lb")
        draw.rectangle((left, low, left + side - 1, low + bar - 1), PAPER)
        if good > 0:
            draw.rectangle((left, low, left + max(0, round(good * side) - 1), low + bar - 1), _BAR)


def _cities(births: Births, ids: list[int]) -> Iterator[tuple[int, CityMap]]:
    for start in range(0, len(ids), _AT_A_TIME):
        yield from cities_of(births, ids[start : start + _AT_A_TIME]).items()
