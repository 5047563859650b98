"""A view of a run without widgets: its axes, and the first of its maps."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw

from evocity.analysis.view import View
from evocity.notebook.maps import fit_picture, page
from evocity.pictures.colours import FAINT, INK, PAPER
from evocity.pictures.legend import font, shorten_text
from evocity.templates import data_uri, number
from evocity.viewer.table import Column

# Maps, at most; px along their longer side.
_MOST, _SIDE = 14, 96
# Pixels of the axes, shown with two thirds as many; of the names above and the ends below; steps of
# an axis; characters of the picture's address.
_WIDE, _TALL, _ABOVE, _BELOW, _LEVELS, _LETTERS = 1080, 360, 63, 33, 96, 80_000
# The page's colours of all births, and of those that pass.
_OTHERS, _PASSING = (216, 209, 196), (63, 116, 163)


def view_html(view: View) -> str:
    """Return a `View` as HTML: the births that pass its filter, the first in its order as maps."""
    ids, chosen = view.filtered_ids, set(view.widget.chosen)
    shown = ids[:_MOST].tolist()
    pictures, lacking = view.page.thumbnails.of(shown, _SIDE)
    column = view.table.column(view.widget.order["name"])
    values = column.values[np.searchsorted(view.table.ids, shown)]
    maps = []
    for one, value in zip(shown, values.tolist(), strict=True):
        notes = [column.words[int(value)] if column.words else number(value, column.unit)]
        notes += ["chosen"] if one in chosen else []
        card = {"uri": "", "alt": "", "title": f"{one}", "note": ", ".join(notes)}
        if one in pictures:
            card["uri"] = data_uri(Image.fromarray(pictures[one]))
            card["alt"] = f"map of heights of birth {one}, north up"
        else:
            card["note"] += f"; {lacking[one]}"
        maps.append(card)
    axes = [view.table.column(one["name"]) for one in view.widget.axes]
    turned = [one["turned"] for one in view.widget.axes]
    kept = view.table.matches(view.brushes)
    return page(
        "view.html",
        title=f"run {view.run.name}",
        count=f"{len(ids)} of {len(view.table)} births pass the filter, {len(chosen)} chosen",
        by=column.name,
        lines=fit_picture(_axes(axes, turned, kept), _WIDE, _LETTERS)[0] if axes else "",
        alt=f"parallel coordinates of {', '.join(one.name for one in axes)}",
        maps=maps,
        left=len(ids) - len(shown),
        highest=view.page.thumbnails.highest,
        credit=view.run.header.attribution,
    )


def _axes(columns: Sequence[Column], turned: Sequence[bool], kept: np.ndarray) -> Image.Image:
    """Parallel coordinates as a picture; ``turned``: whether the lowest value is above."""
    apart = _WIDE // len(columns)
    picture = np.empty((_TALL, apart * len(columns), 3))
    picture[:] = PAPER
    levels = [_levels(*one) for one in zip(columns, turned, strict=True)]
    for rows, colour, most in ((kept | True, _OTHERS, 0.9), (kept, _PASSING, 0.95)):
        for place, pair in enumerate(pairwise(levels)):
            left = place * apart + apart // 2
            area = picture[_ABOVE : _TALL - _BELOW, left : left + apart]
            crossed = _crossings(*(one[rows] for one in pair), area.shape[:2])
            opaque = np.log1p(crossed) / np.log1p(max(1.0, crossed.max(initial=0)))
            opaque = np.where(crossed > 0, most * (0.25 + 0.75 * opaque), 0)[:, :, None]
            area += opaque * (np.array(colour) - area)
    sheet = Image.fromarray(np.round(picture).astype(np.uint8))
    draw = ImageDraw.Draw(sheet)
    for place, (column, is_turned) in enumerate(zip(columns, turned, strict=True)):
        _draw_axis(draw, place * apart + apart // 2, column, is_turned, apart - 12)
    return sheet


def _levels(column: Column, is_turned: bool) -> np.ndarray:
    """The step of each birth on the axis, from above, int ``(n,)``; -1 for no value."""
    low, high = (-0.5, len(column.words) - 0.5) if column.words else column.span
    shares = (
        (column.values.astype(float) - low) / (high - low)
        if high > low
        else column.values * 0 + 0.5
    )
    known = np.isfinite(shares)
    shares = np.where(known, shares if is_turned else 1 - shares, 0)
    return np.where(known, np.round(shares * (_LEVELS - 1)).astype(int), -1)


def _crossings(left: np.ndarray, right: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The number of lines across each pixel between two axes, float64 ``shape``."""
    tall, wide = shape
    known = (left >= 0) & (right >= 0)
    counts = np.bincount(left[known] * _LEVELS + right[known], minlength=_LEVELS**2)
    pairs = np.flatnonzero(counts)
    ends = (np.stack(np.divmod(pairs, _LEVELS)) + 0.5) * tall / _LEVELS
    across = np.linspace(0, 1, 2 * wide)  # twice, so that steep lines have no gaps
    rows = (ends[0, :, None] + across * (ends[1] - ends[0])[:, None]).astype(int)
    places = rows * wide + np.arange(2 * wide) // 2
    weights = np.repeat(counts[pairs] / 2, 2 * wide)
    return np.bincount(places.ravel(), weights, minlength=tall * wide).reshape(shape)


def _draw_axis(
    draw: ImageDraw.ImageDraw, x: int, column: Column, is_turned: bool, room: int
) -> None:
    draw.line((x, _ABOVE, x, _TALL - _BELOW), INK, 2)
    plain, small = font(20), font(17)
    name = column.name.replace("_", " ") + (f", {column.unit}" if column.unit else "")
    draw.text((x, 5), shorten_text(name, plain, room), INK, plain, "mt")
    ends = [number(end) for end in column.span]
    if column.words:
        ends = [column.words[0], column.words[-1]]
    low, high = ends[::-1] if is_turned else ends
    draw.text((x, _ABOVE - 5), shorten_text(high, small, room), FAINT, small, "mb")
    draw.text((x, _TALL - _BELOW + 6), shorten_text(low, small, room), FAINT, small, "mt")
