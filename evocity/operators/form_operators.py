"""Operators of shapes and curves: maps, control points, details, metamorphosis."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from evocity.errors import EvocityError, OperatorError
from evocity.kinds import CurveForm, Form, ShapeForm
from evocity.operators.parameters import SHARE, Check, check_parameters, check_parents

#: The checks of all parameters of these operators, by their names.
_CHECKS: dict[str, Check] = {
    "step": (lambda step: 0 <= step <= 10, "0…10"),
    "share": SHARE,
    "far": SHARE,
    "levels": (lambda levels: 1 <= levels <= 64, "1…64"),
    "gain": (lambda gain: 0 <= gain <= 100, "0…100"),
    "tries": (lambda tries: 1 <= tries <= 100, "1…100"),
}
# The largest distance from 0 or 1 of a control point's weight at a curve's end.
_SLACK = 1e-9


@dataclass(frozen=True, kw_only=True)
class Forming:
    """An operator of forms. A subclass is a frozen dataclass with ``name``, ``parents``, ``of``,
    its own parameters, their checks in `_CHECKS`, and a method ``_child(parents, rng)``, which
    returns a form and its ``made``.

    tries : the largest number of draws. After these the last child stays although its maps do not
        contract, or it crosses itself or leaves the window.
    """

    name: ClassVar[str]
    of: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    tries: int = 8

    def __post_init__(self):
        check_parameters(self, _CHECKS)

    def _child(self, parents: Sequence[Any], rng: np.random.Generator) -> tuple[Form, dict]:
        raise NotImplementedError

    def __call__(self, parents: Sequence[Form], rng: np.random.Generator) -> Form:
        """Breed a child of ``parents``; its ``made`` describes the birth.

        Raises `OperatorError` if the parents do not suit the operator or one another, and
        `evocity.shapes.ShapeError` if no try gave a form; it names the maps that do not contract.
        """
        remedy = f"choose an operator for these parents; this operator breeds {self.of}s"
        check_parents(
            self, parents, rng, self.of, lambda item: getattr(item, "kind", "") == self.of, remedy
        )
        windows = {(parent.pixels, parent.metres_per_pixel) for parent in parents}
        if len(windows) > 1:
            raise OperatorError(
                f"{self.name}: the parents have different windows, "
                + " and ".join(f"{n} px of {m:g} m" for n, m in sorted(windows)),
                "parents whose windows have the same pixels",
                "make the parents with the same pixels and metres_per_pixel",
            )
        last, fault = None, None
        for _ in range(self.tries):
            try:
                child, made = self._child(parents, rng)
                child = child.replace(made={"operator": self.name, **made})
                if child.problem is None:
                    return child
            except OperatorError:
                raise
            except EvocityError as error:
                fault = error
            else:
                last = child
        if last is None:
            assert fault is not None
            raise fault
        return last


@dataclass(frozen=True, kw_only=True)
class MapPerturbation(Forming):
    """Change some of the affine maps of a shape a little.

    Parameters
    ----------
    step : standard deviation of the change of each coefficient of an affine map, as a share of the
        window's side.
    share : probability that an affine map changes, 0…1; at least one affine map changes.
    """

    name = "map_perturbation"
    of = "shape"
    parents = (1, 1)

    step: float = 0.05
    share: float = 0.4

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        maps = parents[0].maps
        changed = _draw_mask(len(maps), self.share, rng)
        maps = maps + self.step * rng.standard_normal(maps.shape) * changed[:, None, None]
        return parents[0].replace(maps=maps), {"maps": np.flatnonzero(changed).tolist()}


@dataclass(frozen=True, kw_only=True)
class MapExchange(Forming):
    """Replace some affine maps of the first shape by the corresponding maps of the second shape.

    Parameters
    ----------
    share : probability that a map comes from the second shape, 0…1; at least one map comes from the
        second shape.
    """

    name = "map_exchange"
    of = "shape"
    parents = (2, 2)

    share: float = 0.5

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        first, second = (parent.maps for parent in parents)
        count = min(len(first), len(second))
        taken = _draw_mask(count, self.share, rng)
        maps = first.copy()
        maps[:count][taken] = second[:count][taken]
        return parents[0].replace(maps=maps), {"maps": np.flatnonzero(taken).tolist()}


@dataclass(frozen=True, kw_only=True)
class ShapeMetamorphosis(Forming):
    """Make a shape between the first shape and the second shape.

    Parts that are connected in both parents stay connected in the child. If the parents have
    different numbers of maps, the child's ``made`` lists the paired maps. See
    `evocity.shapes.metamorphosis`.

    Parameters
    ----------
    far : largest distance of the child from the first shape, 0…1; at 1 the child may be the second
        shape. The child's distance from the first shape is drawn evenly between 0 and ``far``.
    """

    name = "shape_metamorphosis"
    of = "shape"
    parents = (2, 2)

    far: float = 1.0

    def _child(self, parents: Sequence[ShapeForm], rng: np.random.Generator):
        from evocity.shapes import metamorphosis

        t = self.far * float(rng.random())
        path = metamorphosis(parents[0].shape, parents[1].shape)
        made: dict[str, Any] = {"t": t}
        if len(parents[0].maps) != len(parents[1].maps):
            made["pairs"] = [list(pair) for pair in path.pairs]
        return parents[0].replace(maps=path(t).maps), made


@dataclass(frozen=True, kw_only=True)
class PointPerturbation(Forming):
    """Move some control points of a curve.

    Parameters
    ----------
    step : standard deviation of the move along each axis, as a share of the window's side.
    share : probability that a point moves, 0…1; at least one point moves.
    ends : whether the first and the last control point may move.
    """

    name = "point_perturbation"
    of = "curve"
    parents = (1, 1)

    step: float = 0.05
    share: float = 0.5
    ends: bool = True

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        points = parent.points.copy()
        first = 0 if self.ends or len(points) < 3 else 1
        inner = slice(first, len(points) - first)
        mask = _draw_mask(len(points[inner]), self.share, rng)
        step = self.step * parent.side * rng.standard_normal(points[inner].shape)
        points[inner] += step * mask[:, None]
        # ends stop at the window's border, where they could hardly move otherwise
        points[[0, -1]] = np.clip(points[[0, -1]], 0, parent.side)
        return parent.replace(points=points), {"points": (np.flatnonzero(mask) + first).tolist()}


@dataclass(frozen=True, kw_only=True)
class PartPerturbation(Forming):
    """Change the matrices that make the parts of a curve.

    In the child, each part of the curve ends where the next part begins. The child's curve begins
    at the first control point of the child and ends at the last control point.

    Parameters
    ----------
    step : standard deviation of the change of each weight in the matrices.
    """

    name = "part_perturbation"
    of = "curve"
    parents = (1, 1)

    step: float = 0.05

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        maps = parent.maps
        count, size = len(maps), maps.shape[1]
        gap = np.abs(maps[:-1, :, -1] - maps[1:, :, 0]).max(initial=0.0)
        ends = np.eye(size)[[0, size - 1]]
        if np.abs(parent.curve.ends - ends).max() > _SLACK or gap > _SLACK:
            raise OperatorError(
                f"{self.name}: a curve does not begin and end at its first and last control points",
                "a curve from its first to its last control point, such as a Bézier curve",
                f"leave {self.name} out of the operators",
            )
        noise = rng.standard_normal((count, size, size))
        noise -= noise.mean(axis=1, keepdims=True)  # columns still sum to 1
        noise[0, :, 0] = noise[-1, :, -1] = 0.0
        noise[1:, :, 0] = noise[:-1, :, -1]
        return parent.replace(maps=maps + self.step * noise), {}


@dataclass(frozen=True, kw_only=True)
class PointExchange(Forming):
    """Take each control point from the first or the second curve, at random.

    All maps and details of the child come from a single curve of the two. Both curves must have the
    same number of control points.

    Parameters
    ----------
    share : probability that a point comes from the second curve, 0…1; at least one point comes from
        the second curve.
    """

    name = "point_exchange"
    of = "curve"
    parents = (2, 2)

    share: float = 0.5

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        taken = _draw_mask(len(first.points), self.share, rng)
        points = np.where(taken[:, None], second.points, first.points)
        at = int(rng.random() < self.share)
        made = {"points": np.flatnonzero(taken).tolist(), "maps": at}
        return parents[at].replace(points=points), made


@dataclass(frozen=True, kw_only=True)
class CurveMetamorphosis(Forming):
    """Make a curve between two curves that have equal numbers of control points.

    The control points and affine maps of the child are weighted means of the parents' control
    points and affine maps. Two parts of the curve that join in both parents also join in the child.
    The curve with fewer maps gets additional maps that shrink the whole curve to its end point. The
    child's ``made`` lists the pairs of maps. Details of the child lie between the details of the
    parents, if both parents have equal numbers of levels and of maps. If the parents differ in the
    number of levels or of maps, the child has no details.

    Parameters
    ----------
    far : largest distance of the child from the first curve, 0…1; at 1 the child may be the second
        curve. The child's distance from the first curve is drawn evenly between 0 and ``far``.
    """

    name = "curve_metamorphosis"
    of = "curve"
    parents = (2, 2)

    far: float = 1.0

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        t = self.far * float(rng.random())
        made: dict[str, Any] = {"t": t}
        counts = len(first.maps), len(second.maps)
        if counts[0] != counts[1]:
            # None stands for the end of the curve with fewer maps
            made["pairs"] = [
                [k if k < count else None for count in counts] for k in range(max(counts))
            ]
        ours, theirs = (_lengthen(parent, max(counts)) for parent in parents)
        details: tuple[np.ndarray, ...] = ()
        if counts[0] == counts[1] and len(first.details) == len(second.details):
            levels = zip(first.details, second.details, strict=True)
            details = tuple((1 - t) * one + t * other for one, other in levels)
        points, maps = (1 - t) * first.points + t * second.points, (1 - t) * ours + t * theirs
        return first.replace(points=points, maps=maps, details=details), made


@dataclass(frozen=True, kw_only=True)
class DetailExchange(Forming):
    """Give the first curve the finest details of the second curve.

    Details are relative to the polygons of the first curve, so place and size of the second curve
    do not matter. Both curves must have details, and equal numbers of levels, maps and control
    points.

    Parameters
    ----------
    levels : number of the finest levels whose details replace those of the first curve, 1…64; if
        the curves have fewer levels, all details are replaced.
    gain : factor that multiplies the size of the details from the second curve, 0…100.
    """

    name = "detail_exchange"
    of = "curve"
    parents = (2, 2)

    levels: int = 3
    gain: float = 1.0

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        first, second = parents
        _check_points(self.name, first, second)
        depths = len(first.details), len(second.details)
        if not depths[0] or depths[0] != depths[1] or len(first.maps) != len(second.maps):
            raise OperatorError(
                f"{self.name}: the first curve has {len(first.maps)} affine maps and {depths[0]} "
                f"levels of details; the second curve has {len(second.maps)} affine maps and "
                f"{depths[1]} levels of details",
                "two curves with details, with the same numbers of affine maps and of levels",
                f"read both curves as lines from files, or leave {self.name} out of the operators",
            )
        keep = max(0, depths[0] - self.levels)
        details = first.details[:keep] + tuple(self.gain * level for level in second.details[keep:])
        return first.replace(details=details), {"kept": keep}


@dataclass(frozen=True, kw_only=True)
class DetailScaling(Forming):
    """Enlarge or shrink the details of a curve, by a factor for each level.

    Parameters
    ----------
    step : standard deviation of the logarithm of the factor for each level.
    """

    name = "detail_scaling"
    of = "curve"
    parents = (1, 1)

    step: float = 0.3

    def _child(self, parents: Sequence[CurveForm], rng: np.random.Generator):
        (parent,) = parents
        if not parent.details:
            raise OperatorError(
                f"{self.name}: the curve has no details",
                "a curve that was read as a line from a file",
                f"leave {self.name} out of the operators",
            )
        gains = np.exp(self.step * rng.standard_normal(len(parent.details)))
        details = tuple(gain * level for gain, level in zip(gains, parent.details, strict=True))
        return parent.replace(details=details), {"gains": gains.tolist()}


def _draw_mask(count: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Draw each of ``count`` items with the chance ``share``, at least one: bool ``(count,)``."""
    mask = rng.random(count) < share
    if not mask.any():
        mask[rng.integers(count)] = True
    return mask


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
