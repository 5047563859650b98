"""The grid of a run of MAP-Elites as a picture: in each filled cell the map of its best birth."""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from evocity.analysis.thumbnails import highest_of
from evocity.citymap import CityMap
from evocity.pictures.colours import FAINT, GROUND, INK, PAPER
from evocity.pictures.legend import font
from evocity.pictures.picture import render
from evocity.pictures.sheet import draw_scale
from evocity.report.facts import Facts
from evocity.report.pictures import contact_sheet
from evocity.search.binning import Binned
from evocity.search.cells import Grid
from evocity.store import Run

#: All cells of the picture together are about so wide, px; one is no wider than `_WIDEST`.
_WIDTH, _WIDEST = 1440, 160
#: Cells hold maps if they are so wide, px, and there are no more of them; else a colour.
_LEAST, _MOST_MAPS = 14, 1600
#: Of a third descriptor, so many slices are drawn.
_MOST_SLICES = 36
#: Individuals whose genomes are held at a time.
_AT_A_TIME = 128
#: Cells so wide, px, tell whose map they show.
_NUMBERED = 40

_LEFT, _TOP, _GAP, _LINE, _TICK = 92, 64, 28, 17, 5
_BAR = (176, 64, 63)  # how good a cell is; the report's colour of a front
_WORST = (232, 214, 206)
_PARENT = (63, 116, 163)  # the report's colour of the first population


def grid_picture(facts: Facts, island: str | None = None) -> Image.Image:
    """The grid of a run that fills one, or of an ``island``: the first descriptor to the right,
    the second upwards, of a third a slice beside the other. Each filled cell shows the map of its
    best birth of all, with its number if there is room, and beneath it a bar: how far its quality
    lies from the reference towards the best of all. Cells that parents' codes fall into have a
    frame.

    Raises ValueError if there is no grid, see `Facts.grids`.
    """
    binned = facts.grids.get(island)
    if binned is None:
        raise ValueError("a run without a grid")
    plain, title = font(13), font(22)
    layout = _Layout.of(binned)
    highest = highest_of(facts.told)
    told = _told(facts, binned, layout, facts.told.quality_on(island))
    lines = [line for text in told for line in _wrapped(text, layout)]
    lines += _wrapped(facts.run.header.attribution, layout)
    low = layout.low
    sheet = Image.new("RGB", (layout.width, layout.words + _LINE * len(lines) + 16), PAPER)
    draw = ImageDraw.Draw(sheet)
    of = facts.title if island is None else f"{facts.title}, {island}"
    draw.text((20, 18), f"{of}, generation {facts.told.last}", INK, title)
    for number in range(len(layout.slices)):
        _draw_axes(sheet, draw, layout, number, plain)
    _fill(sheet, draw, facts, binned, layout, highest)
    for place in _parents(facts, binned.grid).values():
        if (at := layout.corner(place)) is not None:
            draw.rectangle((at[0] - 1, at[1] - 1, *(x + layout.side for x in at)), None, _PARENT, 3)
    if layout.maps:
        draw_scale(sheet, draw, (20, low), min(layout.width - 40, 420), highest, plain)
    for index, text in enumerate(lines):
        draw.text((20, layout.words + index * _LINE), text, FAINT, plain)
    return sheet


def run_picture(run: Run) -> Image.Image:
    """A run as one picture: its grid if it fills one, else `contact_sheet`. Raises `RunError` if
    the run has no whole generation yet, or is damaged."""
    facts = Facts(run)
    return contact_sheet(run) if facts.binned is None else grid_picture(facts)


@dataclass(frozen=True)
class _Layout:
    """Where cells lie in the picture: ``side`` of a cell, px; ``slices``, the third descriptor's
    cells that are drawn, (0,) without one; ``across`` of them beside each other."""

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
        """Where the words beneath begin: below the scale of heights, if there are maps."""
        return self.low + 44 * self.maps

    def origin(self, number: int) -> tuple[int, int]:
        """The north-west corner of the cells of a slice."""
        row, column = divmod(number, self.across)
        return column * self.tile[0] + _LEFT, _TOP + row * self.tile[1] + _LINE

    def corner(self, place) -> tuple[int, int] | None:
        """The north-west corner of a cell; None if its slice is not drawn."""
        third = int(place[2]) if len(place) == 3 else 0
        if third not in self.slices:
            return None
        left, top = self.origin(self.slices.index(third))
        row = self.grid.counts[1] - 1 - int(place[1])
        return left + int(place[0]) * self.side, top + row * self.side


def _told(facts: Facts, binned: Binned, layout: _Layout, goal: str) -> list[str]:
    cells = (
        f"{len(binned)} of {len(binned.grid)} cells are filled ({binned.coverage:.1%}), "
        f"QD-score {binned.qd_score:.4g}."
    )
    named = ", with its number" if layout.maps and layout.side >= _NUMBERED else ""
    best = f"In each filled cell the best by {goal} of all births{named}"
    bar = "; the bar tells how good it is, full for the best of all." if layout.maps else "."
    colours = "" if layout.maps else " The redder, the better."
    drawn = len(layout.slices)
    third = binned.grid.descriptors[2:]
    filled = len(set(binned.births[f"cell.{third[0]}"].to_pylist())) if third else drawn
    left = f" {filled - drawn} more slices are not drawn." if filled > drawn else ""
    ends = " Values beyond a range lie in the cell at its end."
    names = " and ".join(_parents(facts, binned.grid))
    framed = f" Blue frames: the codes of {names}." if names else ""
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
        told = f"{names[2]}: {edges[third]:.4g} to {edges[third + 1]:.4g}"
        draw.text((left, top - _LINE - 3), told, INK, plain)


def _short(name: str) -> str:
    return name if len(name) <= 40 else name[:39] + "…"


def _ticks(edges: np.ndarray, side: int, apart: int) -> Iterator[tuple[int, str]]:
    """(number of an edge, its value) of edges that lie so many px ``apart``, both ends among
    them."""
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


def _fill(sheet, draw, facts: Facts, binned: Binned, layout: _Layout, highest: float) -> None:
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
    for one, city in _cities(facts, sorted(shown)):
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


def _cities(facts: Facts, ids: list[int]) -> Iterator[tuple[int, CityMap]]:
    for start in range(0, len(ids), _AT_A_TIME):
        for birth in facts.run.individuals(ids[start : start + _AT_A_TIME], stones=False):
            yield birth.id, facts.decoded(birth)


def _parents(facts: Facts, grid: Grid) -> dict[str, np.ndarray]:
    """Source city -> where the cell lies that its code falls into."""
    found = {}
    for birth in facts.source_births:
        values = [birth.values.get(name, np.nan) for name in grid.descriptors]
        cell = grid.cells(np.array([values]))
        if cell[0] >= 0:
            found[facts.run.header.cities[birth.id]] = grid.places(cell)[0]
    return found
