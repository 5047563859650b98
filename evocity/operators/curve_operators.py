"""Operators of curves: control points, maps of parts, details, metamorphosis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.errors import OperatorError
from evocity.kinds import CurveForm
from evocity.operators.form_common import STEP, Forming, draw_mask
from evocity.operators.parameters import SHARE, Check

# The largest distance from 0 or 1 of a control point's weight at a curve's end.
_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class PointPerturbation(Forming):
    """Move some control points.

    Parameters
    ----------
    step : standard deviation of the move along each axis, as a share of the window's side.
    share : share of the points that move; at least one point moves.
    ends : whether the first and the last point may move too.
    """

    name = "point_perturbation"
    of = "curve"
    parents = (1, 1)

    step: float = 0.05
    share: float = 0.5
    ends: bool = True

    def _checks(self) -> dict[str, Check]:
        return {"step": STEP, "share": SHARE}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        points = parent.points.copy()
        inner = slice(None) if self.ends or len(points) < 3 else slice(1, -1)
        mask = draw_mask(len(points[inner]), self.share, rng)
        step = self.step * parent.side * rng.standard_normal(points[inner].shape)
        points[inner] += step * mask[:, None]
        # ends stop at the window's border, where they could hardly move otherwise
        points[[0, -1]] = np.clip(points[[0, -1]], 0, parent.side)
        first = 0 if inner == slice(None) else 1
        return parent.replace(points=points), {"points": (np.flatnonzero(mask) + first).tolist()}


@dataclass(frozen=True, kw_only=True)
class PartPerturbation(Forming):
    """Change the maps of a curve's parts.

    Each part still ends where the next part begins. The curve still begins at its first control
    point and ends at its last.

    Parameters
    ----------
    step : standard deviation of the change of each weight.
    """

    name = "part_perturbation"
    of = "curve"
    parents = (1, 1)

    step: float = 0.05

    def _checks(self) -> dict[str, Check]:
        return {"step": STEP}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        maps = parent.maps
        _check_ends(self.name, parent)
        count, size = len(maps), maps.shape[1]
        noise = rng.standard_normal((count, size, size))
        noise -= noise.mean(axis=1, keepdims=True)  # columns still sum to 1
        noise[0, :, 0] = noise[-1, :, -1] = 0.0
        noise[1:, :, 0] = noise[:-1, :, -1]
        return parent.replace(maps=maps + self.step * noise), {}


@dataclass(frozen=True, kw_only=True)
class PointExchange(Forming):
    """Draw each control point from the first curve or the second. Maps and details come from one of
    the two curves. Both curves must have the same number of points.

    Parameters
    ----------
    share : share of the points that come from the second curve.
    """

    name = "point_exchange"
    of = "curve"
    parents = (2, 2)

    share: float = 0.5

    def _checks(self) -> dict[str, Check]:
        return {"share": SHARE}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        taken = draw_mask(len(first.points), self.share, rng)
        points = np.where(taken[:, None], second.points, first.points)
        at = int(rng.random() < self.share)
        made = {"points": np.flatnonzero(taken).tolist(), "maps": at}
        return parents[at].replace(points=points), made


@dataclass(frozen=True, kw_only=True)
class CurveMetamorphosis(Forming):
    """Make a curve between the first curve and the second, with the same number of control points.

    Points and maps of the child lie between those of the parents. So parts that join in both curves
    also join in the child. The curve with fewer maps repeats its last map; the child's ``made``
    lists the pairs. Details also lie between, if both curves have equal numbers of levels and of
    maps. Otherwise the child has no details.

    Parameters
    ----------
    far : largest distance of the child from the first curve, 0…1, as a share of the way. The
        distance is drawn evenly up to there.
    """

    name = "curve_metamorphosis"
    of = "curve"
    parents = (2, 2)

    far: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {"far": SHARE}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        t, made = self.far * float(rng.random()), {}
        counts = len(first.maps), len(second.maps)
        if counts[0] != counts[1]:
            # None stands for the end of the curve with fewer maps
            made["pairs"] = [
                [k if k < count else None for count in counts] for k in range(max(counts))
            ]
        maps = [_lengthen(parent, max(counts)) for parent in parents]
        details = ()
        if counts[0] == counts[1] and len(first.details) == len(second.details):
            levels = zip(first.details, second.details, strict=True)
            details = tuple((1 - t) * ours + t * theirs for ours, theirs in levels)
        child = first.replace(
            points=(1 - t) * first.points + t * second.points,
            maps=(1 - t) * maps[0] + t * maps[1],
            details=details,
        )
        return child, {"t": t, **made}


@dataclass(frozen=True, kw_only=True)
class DetailExchange(Forming):
    """Give the first curve the finest details of the second.

    The details lie in the frames of the first curve's polygons, so place and size of the second
    curve do not matter. Both curves must have details, and equal numbers of levels, maps and
    control points.

    Parameters
    ----------
    levels : number of the finest levels to give. If there are fewer, all are given.
    gain : factor of the size of the given details.
    """

    name = "detail_exchange"
    of = "curve"
    parents = (2, 2)

    levels: int = 3
    gain: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {
            "levels": (lambda levels: 1 <= levels <= 64, "1…64"),
            "gain": (lambda gain: 0 <= gain <= 100, "0…100"),
        }

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        depths = len(first.details), len(second.details)
        if not depths[0] or depths[0] != depths[1] or len(first.maps) != len(second.maps):
            raise OperatorError(
                f"{self.name}: the curves have {len(first.maps)} and {len(second.maps)} maps, and "
                f"{depths[0]} and {depths[1]} levels of details",
                "the same number of maps and the same number of levels",
                "start both curves from lines in files, or leave the operator out",
            )
        keep = max(0, depths[0] - self.levels)
        details = first.details[:keep] + tuple(self.gain * level for level in second.details[keep:])
        return first.replace(details=details), {"kept": keep}


@dataclass(frozen=True, kw_only=True)
class DetailScaling(Forming):
    """Enlarge or shrink the details of a curve, by a factor for each level.

    Parameters
    ----------
    step : standard deviation of the logarithm of each factor.
    """

    name = "detail_scaling"
    of = "curve"
    parents = (1, 1)

    step: float = 0.3

    def _checks(self) -> dict[str, Check]:
        return {"step": STEP}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        if not parent.details:
            raise OperatorError(
                f"{self.name}: the curve has no details",
                "a curve that was read as a line from a file",
                "leave the operator out",
            )
        gains = np.exp(self.step * rng.standard_normal(len(parent.details)))
        details = tuple(gain * level for gain, level in zip(gains, parent.details, strict=True))
        return parent.replace(details=details), {"gains": gains.tolist()}


def _lengthen(curve: CurveForm, count: int) -> np.ndarray:
    """Extend a curve's maps to ``count`` by maps that shrink everything to its end."""
    end, size = curve.curve.ends[1], curve.maps.shape[1]
    more = np.repeat(end[None, :, None], size, axis=2)
    return np.concatenate([curve.maps, *[more] * (count - len(curve.maps))])


def _check_points(name: str, first: CurveForm, second: CurveForm) -> None:
    if len(first.points) != len(second.points):
        raise OperatorError(
            f"{name}: the curves have {len(first.points)} and {len(second.points)} control points",
            "curves with the same number of control points",
            "give all parents the same number of control points",
        )


def _check_ends(name: str, curve: CurveForm) -> None:
    size = len(curve.points)
    ends = np.eye(size)[[0, size - 1]]
    maps = curve.maps
    gap = np.abs(maps[:-1, :, -1] - maps[1:, :, 0]).max(initial=0.0)
    if np.abs(curve.curve.ends - ends).max() > _SLACK or gap > _SLACK:
        raise OperatorError(
            f"{name}: a curve does not end in its first and last control points",
            "a curve that ends in these points, as its parts do, for example a Bézier curve",
            "leave the operator out",
        )
