"""Operators of curves: control points moved and exchanged, maps changed so that parts stay joined,
and one curve on its way to another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.errors import OperatorError
from evocity.forms import CurveForm
from evocity.operators.forming import Forming, chosen, step_checks
from evocity.operators.parameters import Check

# Of a weight of a control point at a curve's end, how far it may be from 0 or 1.
_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class PointPerturbation(Forming):
    """Some control points moved.

    Parameters
    ----------
    step : standard deviation of how far, along each axis, in sides of the window.
    share : of the points that move, one at least.
    ends : whether the first and the last point may move too.
    """

    name: ClassVar[str] = "point_perturbation"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (1, 1)

    step: float = 0.05
    share: float = 0.5
    ends: bool = True

    def _checks(self) -> dict[str, Check]:
        return step_checks()

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        points = parent.points.copy()
        inner = slice(None) if self.ends or len(points) < 3 else slice(1, -1)
        moved = chosen(len(points[inner]), self.share, rng)
        step = self.step * parent.side * rng.standard_normal(points[inner].shape)
        points[inner] += step * moved[:, None]
        # what would leave the window stays at its border: else ends there could hardly move
        points[[0, -1]] = np.clip(points[[0, -1]], 0, parent.side)
        first = 0 if inner == slice(None) else 1
        return parent.replace(points=points), {"points": (np.flatnonzero(moved) + first).tolist()}


@dataclass(frozen=True, kw_only=True)
class PartPerturbation(Forming):
    """The maps that make the parts of a curve, changed so that each part still ends where the next
    begins, and the curve at its first and last control point.

    Parameters
    ----------
    step : standard deviation of what is added to each weight.
    """

    name: ClassVar[str] = "part_perturbation"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (1, 1)

    step: float = 0.05

    def _checks(self) -> dict[str, Check]:
        return {"step": step_checks()["step"]}

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
    """Each control point of the first curve, or of the second; maps and details of one of them.
    Both have as many points.

    Parameters
    ----------
    share : of the points that are the second's.
    """

    name: ClassVar[str] = "point_exchange"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (2, 2)

    share: float = 0.5

    def _checks(self) -> dict[str, Check]:
        return {"share": step_checks()["share"]}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_alike(self.name, first, second)
        taken = chosen(len(first.points), self.share, rng)
        points = np.where(taken[:, None], second.points, first.points)
        at = int(rng.random() < self.share)
        made = {"points": np.flatnonzero(taken).tolist(), "maps": at}
        chosen_one = parents[at]
        return chosen_one.replace(points=points), made


@dataclass(frozen=True, kw_only=True)
class CurveMetamorphosis(Forming):
    """A curve on the way from the first to the second, of as many control points: points and maps
    in between, so that parts which join at both ends join in between. Where the one has fewer maps,
    its end counts as more of them, and ``made`` tells the pairs. Details are in between where both
    have as many levels of them and as many maps; else the child has none.

    Parameters
    ----------
    far : how far on the way at most, 0…1; drawn evenly up to there.
    """

    name: ClassVar[str] = "curve_metamorphosis"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (2, 2)

    far: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {"far": (lambda far: 0 <= far <= 1, "0…1")}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_alike(self.name, first, second)
        t, made = self.far * float(rng.random()), {}
        counts = len(first.maps), len(second.maps)
        if counts[0] != counts[1]:
            # beyond its last map the poorer one has its end alone
            made["pairs"] = [
                [k if k < counts[0] else None, k if k < counts[1] else None]
                for k in range(max(counts))
            ]
        maps = [_lengthened(one, max(counts)) for one in parents]
        details = ()
        if counts[0] == counts[1] and len(first.details) == len(second.details):
            levels = zip(first.details, second.details, strict=True)
            details = tuple((1 - t) * one + t * other for one, other in levels)
        child = first.replace(
            points=(1 - t) * first.points + t * second.points,
            maps=(1 - t) * maps[0] + t * maps[1],
            details=details,
        )
        return child, {"t": t, **made}


@dataclass(frozen=True, kw_only=True)
class DetailExchange(Forming):
    """The first curve with the second's details in its finest levels, as they stand in the frames
    of its polygons: how the second lies and how large it is does not matter. Both have details, of
    as many levels, and as many maps and control points.

    Parameters
    ----------
    levels : how many of the finest, all if there are fewer.
    gain : how many times as large.
    """

    name: ClassVar[str] = "detail_exchange"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (2, 2)

    levels: int = 3
    gain: float = 1.0

    def _checks(self) -> dict[str, Check]:
        return {
            "levels": (lambda levels: 1 <= levels <= 64, "1…64"),
            "gain": (lambda gain: 0 <= gain <= 100, "0…100"),
        }

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_alike(self.name, first, second)
        depths = len(first.details), len(second.details)
        if not depths[0] or depths[0] != depths[1] or len(first.maps) != len(second.maps):
            raise OperatorError(
                f"{self.name}: curves of {len(first.maps)} and {len(second.maps)} maps with "
                f"{depths[0]} and {depths[1]} levels of details",
                "as many maps, and as many levels",
                "begin both by lines in files, or leave the operator out",
            )
        keep = max(0, depths[0] - self.levels)
        details = first.details[:keep] + tuple(self.gain * one for one in second.details[keep:])
        return first.replace(details=details), {"kept": keep}


@dataclass(frozen=True, kw_only=True)
class DetailScaling(Forming):
    """The details of a curve larger or smaller, those of each level alike.

    Parameters
    ----------
    step : standard deviation of the logarithm of how many times, drawn for each level.
    """

    name: ClassVar[str] = "detail_scaling"
    of: ClassVar[str] = "curve"
    parents: ClassVar[tuple[int, int | None]] = (1, 1)

    step: float = 0.3

    def _checks(self) -> dict[str, Check]:
        return {"step": step_checks()["step"]}

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        if not parent.details:
            raise OperatorError(
                f"{self.name}: a curve without details",
                "one that began as a line in a file",
                "leave the operator out",
            )
        gains = np.exp(self.step * rng.standard_normal(len(parent.details)))
        details = tuple(gain * one for gain, one in zip(gains, parent.details, strict=True))
        return parent.replace(details=details), {"gains": gains.tolist()}


def _lengthened(curve: CurveForm, count: int) -> np.ndarray:
    """Its maps, and so many that shrink all to its end that there are ``count``."""
    end, size = curve.curve.ends[1], curve.maps.shape[1]
    more = np.repeat(end[None, :, None], size, axis=2)
    return np.concatenate([curve.maps, *[more] * (count - len(curve.maps))])


def _check_alike(name: str, first: CurveForm, second: CurveForm) -> None:
    if len(first.points) != len(second.points):
        raise OperatorError(
            f"{name}: curves of {len(first.points)} and {len(second.points)} control points",
            "curves of as many",
            "give all parents the same number of control points",
        )


def _check_ends(name: str, curve: CurveForm) -> None:
    size = len(curve.points)
    wanted = np.eye(size)[[0, size - 1]]
    maps = curve.maps
    apart = np.abs(maps[:-1, :, -1] - maps[1:, :, 0]).max(initial=0.0)
    if np.abs(curve.curve.ends - wanted).max() > _SLACK or apart > _SLACK:
        raise OperatorError(
            f"{name}: a curve that does not end in its first and last control points",
            "one that does, and whose parts join so, such as a Bézier curve",
            "leave the operator out",
        )


__all__ = [
    "CurveMetamorphosis",
    "DetailExchange",
    "DetailScaling",
    "PartPerturbation",
    "PointExchange",
    "PointPerturbation",
]
