"""Scatter plots and curves as inline SVG: text only, no script, no network. All words in them are
escaped here, so templates insert them as they are."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np
from markupsafe import Markup

_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 14, 12, 46  # of the drawing's edge, px
_LABEL, _DIGIT = 34, 6.8  # px: the words beside the upright axis with their air; a digit of it
_LARGEST = 1e300  # the scale of an axis needs differences and their logarithms


@dataclass(frozen=True)
class Axis:
    """``label`` at the axis; ``note`` after it, fainter; ``target`` a line."""

    label: str
    note: str = ""
    target: float | None = None


@dataclass(frozen=True)
class Dots:
    """Points of one kind, crosses for ``broken``: ``kind`` are CSS classes, ``titles`` one per
    point."""

    x: np.ndarray
    y: np.ndarray
    kind: str
    radius: float = 2.0
    titles: Sequence[str] = ()
    links: Sequence[str] = ()


def scatter(
    layers: Sequence[Dots], x: Axis, y: Axis, *, width: int = 420, height: int = 340
) -> Markup:
    """Draw finite points over two axes, later layers above earlier ones."""
    layers = [replace(dots, x=_drawable(dots.x), y=_drawable(dots.y)) for dots in layers]
    x, y = _without_far_target(x), _without_far_target(y)
    frame = _Frame(
        np.concatenate([dots.x for dots in layers]),
        np.concatenate([dots.y for dots in layers]),
        (width, height),
        (x.target, y.target),
    )
    return frame.drawing(x, y, "".join(_dots(dots, frame) for dots in layers))


def curve(values: Sequence[float], y: Axis, *, width: int = 420, height: int = 220) -> Markup:
    """Draw one value per generation as a line, with gaps where a value is not finite."""
    heights = _drawable([math.nan if value is None else value for value in values])
    y = _without_far_target(y)
    frame = _Frame(np.arange(len(heights)), heights, (width, height), (None, y.target))
    frame.ticks_x = [tick for tick in frame.ticks_x if tick == int(tick)]
    kept = [
        f"{frame.x(number):.1f},{frame.y(value):.1f}"
        for number, value in _thinned(heights)
        if math.isfinite(value)
    ]
    line = f'<polyline class="line" points="{" ".join(kept)}"/>'
    if kept:
        px, py = kept[-1].split(",")
        line += f'<circle class="front" cx="{px}" cy="{py}" r="3"/>'
    return frame.drawing(Axis("generation"), y, line)


def _drawable(values) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    return np.where(np.abs(values) <= _LARGEST, values, math.nan)


def _without_far_target(axis: Axis) -> Axis:
    far = axis.target is not None and not abs(axis.target) <= _LARGEST
    return replace(axis, target=None) if far else axis


class _Frame:
    """Scales from values to pixels, with the axes."""

    def __init__(self, x, y, size, targets):
        self.width, self.height = size
        self.low_x, self.high_x, self.ticks_x = _span(x, targets[0])
        self.low_y, self.high_y, self.ticks_y = _span(y, targets[1])
        longest = max((len(f"{tick:.6g}") for tick in self.ticks_y), default=0)
        self.left = max(_LEFT, round(_LABEL + _DIGIT * longest))

    def x(self, value):
        share = (value - self.low_x) / (self.high_x - self.low_x)
        return self.left + share * (self.width - self.left - _RIGHT)

    def y(self, value):
        share = (value - self.low_y) / (self.high_y - self.low_y)
        return self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM)

    def drawing(self, x: Axis, y: Axis, inside: str) -> Markup:
        right, low = self.width - _RIGHT, self.height - _BOTTOM

        def upright(value: float, kind: str) -> str:
            px = self.x(value)
            return f'<line class="{kind}" x1="{px:.1f}" y1="{_TOP}" x2="{px:.1f}" y2="{low}"/>'

        def level(value: float, kind: str) -> str:
            py = self.y(value)
            ends = f'x1="{self.left}" y1="{py:.1f}" x2="{right}" y2="{py:.1f}"'
            return f'<line class="{kind}" {ends}/>'

        parts = [
            f'<svg viewBox="0 0 {self.width} {self.height}" role="img" '
            f'aria-label="{escape(y.label)} over {escape(x.label)}">'
        ]
        for tick in self.ticks_x:
            place = f'x="{self.x(tick):.1f}" y="{low + 15}"'
            parts += [upright(tick, "grid"), f'<text class="tick" {place}>{tick:.6g}</text>']
        for tick in self.ticks_y:
            place = f'x="{self.left - 6}" y="{self.y(tick) + 3.5:.1f}"'
            parts += [level(tick, "grid"), f'<text class="tick side" {place}>{tick:.6g}</text>']
        parts += [upright(x.target, "target")] if x.target is not None else []
        parts += [level(y.target, "target")] if y.target is not None else []
        middle_x, middle_y = (self.left + right) / 2, (_TOP + low) / 2
        parts.append(f'<text class="axis" x="{middle_x:.0f}" y="{low + 36}">{_label(x)}</text>')
        parts.append(
            f'<text class="axis" transform="translate(13 {middle_y:.0f}) rotate(-90)">'
            f"{_label(y)}</text>"
        )
        return Markup("".join([*parts, inside, "</svg>"]))


def _label(axis: Axis) -> str:
    note = f'<tspan class="note" dx="6">{escape(axis.note)}</tspan>' if axis.note else ""
    return escape(axis.label) + note


def _dots(dots: Dots, frame: _Frame) -> str:
    parts = []
    for index, (x, y) in enumerate(zip(dots.x, dots.y, strict=True)):
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        px, py, radius = frame.x(x), frame.y(y), dots.radius
        if "broken" in dots.kind.split():
            low, side = f"M{px - radius:.1f} {py - radius:.1f}", f"{2 * radius:g}"
            shape = f'path d="{low}l{side} {side}m0-{side}l-{side} {side}"'
        else:
            shape = f'circle cx="{px:.1f}" cy="{py:.1f}" r="{radius:g}"'
        title = f"<title>{escape(dots.titles[index])}</title>" if dots.titles else ""
        mark = f"<{shape}>{title}</{shape.split()[0]}>" if title else f"<{shape}/>"
        if dots.links:
            mark = f'<a href="{escape(dots.links[index])}">{mark}</a>'
        parts.append(mark)
    return f'<g class="{dots.kind}">{"".join(parts)}</g>'


def _span(values, target: float | None) -> tuple[float, float, list[float]]:
    """The ends of an axis around the finite ``values``, and its ticks."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    if target is not None:
        finite = np.append(finite, target)
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if high - low < 1e-9 * max(abs(low), abs(high), 1e-9):  # one value: a little air around it
        air = 0.05 * abs(low) or 0.5
        low, high = low - air, high + air
    marks = ticks(low, high)
    air = 0.04 * (high - low)
    return low - air, high + air, marks


def ticks(low: float, high: float) -> list[float]:
    """Return about five round numbers from ``low`` to ``high``, evenly apart."""
    least = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(least))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= least * 0.999)
    return [
        step * n for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    ]


def _thinned(values: np.ndarray, most: int = 800) -> list[tuple[int, float]]:
    stride = max(1, -(-len(values) // most))
    kept = [*range(0, len(values), stride)]
    if kept and kept[-1] != len(values) - 1:
        kept.append(len(values) - 1)
    return [(number, float(values[number])) for number in kept]
