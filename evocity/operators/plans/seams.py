"""Seams: two plans that meet along a street from frame to frame."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from evocity.operators.plans.changed import (
    LEAST_FACE,
    Draft,
    axes_of,
    check_streets,
    close_inner,
    refuse,
)
from evocity.operators.plans.laying import LEAST_PIECE
from evocity.operators.plans.plan import Plan, around_of
from evocity.views.connected_components import dilate, pieces

#: Longest seam, in units of the distance of its ends.
LONGEST = 1.5
#: Range of the share of the ground beyond a seam.
BEYOND = (0.25, 0.5)
#: Range of half the width of a seam street on the side of the second plan, metres.
HALF_WIDTHS = (3.0, 12.0)
#: Faces beyond a seam with a narrower core join a neighbour, metres.
NARROW = 10.0
# Pairs of exits that are tried; reach over which the width of a seam street is averaged, px.
_TRIES, _REACH = 20, 15


def join(draft: Draft, plan: Plan, other: Plan, faces: list[int]) -> None:
    """Replace ``faces`` by those of another plan at the same place, up to the street along them."""
    replaced = np.zeros(len(plan) + 1, bool)
    replaced[faces] = True
    if replaced[1:].all():
        raise refuse("the seam replaces all faces", "some faces stay")
    axes = axes_of(plan.labels)
    kept_side = dilate((plan.labels > 0) & ~replaced[plan.labels], corners=True)
    beyond = replaced[plan.labels] | (axes & ~kept_side)
    seam = axes & kept_side & dilate(beyond, corners=True)
    _check_path(plan, seam, beyond)
    labels, lots = draft.labels, draft.lots
    labels[beyond], lots[beyond] = 0, False
    _add_faces(draft, other, beyond)
    _join_remnants(draft, beyond, plan.metres_per_pixel)
    close_inner(labels, beyond)
    lots[beyond] = (other.lots > 0)[beyond]
    half, nearest = _half_widths(plan, seam)
    away = scipy.ndimage.distance_transform_edt(~seam)
    lots &= ~(beyond & ((away - 0.5) * plan.metres_per_pixel < half[tuple(nearest)]))
    _drop_small_lots(draft, beyond, plan.metres_per_pixel)
    draft.heights = np.where(beyond, other.heights, draft.heights)
    check_streets(axes, axes_of(labels), pieces(axes_of(other.labels), corners=True)[1])


def _check_path(plan: Plan, seam: np.ndarray, beyond: np.ndarray) -> None:
    """Check that a seam is one street from frame to frame, with one part of the map beyond it."""
    count = pieces(seam, corners=True)[1]
    frame = np.zeros(seam.shape, bool)
    frame[[0, -1]] = frame[:, [0, -1]] = True
    exits = pieces(seam & frame, corners=True)[1]
    parts = pieces(beyond, corners=True)[1]
    if (count, exits, parts) != (1, 2, 1):
        raise refuse(
            f"the faces of the seam form {parts} parts, with {count} streets along them and "
            f"{exits} exits to the frame",
            "one part, behind one street from frame to frame",
        )


def _add_faces(draft: Draft, other: Plan, beyond: np.ndarray) -> None:
    """Add the faces of the second plan, each in the parts that the seam leaves of it."""
    parts, _ = pieces(beyond & (other.labels > 0))
    # a part lies in one face: axes are between faces
    for part, window in enumerate(scipy.ndimage.find_objects(parts), start=1):
        here = parts[window] == part
        for face in np.unique(other.labels[window][here]).tolist():
            number = draft.new_face([(other, face)])
            draft.labels[window][here & (other.labels[window] == face)] = number


def _join_remnants(draft: Draft, beyond: np.ndarray, pixel: float) -> None:
    """Join small or narrow parts of faces to the neighbour beyond the seam with which they share
    most of their outline."""
    labels = draft.labels
    numbers = np.unique(labels[beyond])
    numbers = numbers[numbers > 0]
    depth = scipy.ndimage.distance_transform_edt(np.pad(labels > 0, 1, mode="edge"))[1:-1, 1:-1]
    core = scipy.ndimage.maximum(depth, labels, numbers)
    sizes = scipy.ndimage.sum_labels(np.ones(labels.shape), labels, numbers)
    small = (sizes * pixel**2 < LEAST_FACE) | (core * 2 * pixel < NARROW)
    for number in numbers[small][np.argsort(sizes[small], kind="stable")].tolist():
        shared = beyond & (labels == 0) & dilate(labels == number, corners=True)
        around = around_of(labels, shared)
        # crossings with a third face do not join two faces
        own = (around == number) | (around == 0)
        lengths = {
            int(face): int((own | (around == face)).all(axis=0).sum())
            for face in np.unique(around)
            if face in numbers and face != number
        }
        target = max(lengths, key=lambda face: (lengths[face], -face), default=0)
        if not lengths.get(target):
            continue
        labels[labels == number] = target
        known = [*draft.origins[target], *draft.origins.pop(number)]
        draft.origins[target] = list(dict.fromkeys(known))
        draft.changed.discard(number)
        close_inner(labels, shared)


def _drop_small_lots(draft: Draft, beyond: np.ndarray, pixel: float) -> None:
    """Leave out small parts of lots in faces that come from several."""
    joined = [number for number, origins in draft.origins.items() if len(origins) > 1]
    parts, _ = pieces(draft.lots & beyond & np.isin(draft.labels, joined))
    small = np.bincount(parts.ravel()) * pixel**2 < LEAST_PIECE
    small[0] = False
    draft.lots &= ~small[parts]


def _half_widths(plan: Plan, seam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find half the width of the ``seam`` street at each of its pixels, metres ``(H, W)``, and the
    nearest pixel of the seam from each pixel, ``(2, H, W)``."""
    away = scipy.ndimage.distance_transform_edt(plan.lots == 0) - 0.5
    half = np.clip(away * plan.metres_per_pixel, *HALF_WIDTHS)
    size = 2 * _REACH + 1
    total = scipy.ndimage.uniform_filter(np.where(seam, half, 0.0), size, mode="constant")
    many = scipy.ndimage.uniform_filter(seam.astype(float), size, mode="constant")
    nearest = scipy.ndimage.distance_transform_edt(
        ~seam, return_distances=False, return_indices=True
    )
    return total / np.maximum(many, 1e-9), nearest


def draw_seam(
    plan: Plan, rng: np.random.Generator, plans: Mapping[str, Plan]
) -> dict[str, Any] | None:
    """Draw a seam with one of ``plans``: a street from frame to frame, at most 1.5 times as long as
    the distance of its ends, with 25 to 50 % of the ground beyond it. None if no street is so."""
    seed = rng.integers(2**32)
    if not plans or len(plan) < 2:
        return None
    rng = np.random.default_rng(seed)
    names = list(plans)
    city = names[rng.integers(len(names))]
    axes = axes_of(plan.labels)
    places, graph = _axis_graph(axes)
    height, width = axes.shape
    row, column = places.T
    border = (row == 0) | (column == 0) | (row == height - 1) | (column == width - 1)
    exits = np.flatnonzero(border)
    if exits.size < 2:
        return None
    own = plan.labels > 0
    for start in rng.permutation(exits)[:_TRIES].tolist():
        lengths, before = scipy.sparse.csgraph.dijkstra(
            graph, directed=False, indices=start, return_predecessors=True
        )
        chord = np.hypot(*(places[exits] - places[start]).T)
        good = np.isfinite(lengths[exits]) & (lengths[exits] <= LONGEST * chord) & (chord > 0)
        for end in rng.permutation(exits[good])[:4].tolist():
            path = np.zeros(axes.shape, bool)
            at = end
            while at >= 0:
                path[tuple(places[at])] = True
                at = int(before[at])
            faces = _side(plan, path, own)
            if faces is not None:
                return {"kind": "seam", "city": city, "faces": faces}
    return None


def _side(plan: Plan, path: np.ndarray, own: np.ndarray) -> list[int] | None:
    """Find the faces on the smaller side of a ``path``, if they have 25 to 50 % of the ground."""
    parts, count = pieces(own | (axes_of(plan.labels) & ~path))
    sizes = np.bincount(parts[own], minlength=count + 1)[1:]
    if count < 2:
        return None
    side = int(np.argsort(-sizes, kind="stable")[1]) + 1
    low, high = BEYOND
    if not low <= sizes[side - 1] / own.sum() <= high:
        return None
    faces = np.unique(plan.labels[(parts == side) & own])
    return [int(face) for face in faces if face > 0]


def _axis_graph(axes: np.ndarray) -> "tuple[np.ndarray, scipy.sparse.csr_array]":
    """Join neighbouring pixels of axes: their rows and columns, ``(n, 2)``, and a graph with the
    distances, px."""
    places = np.argwhere(axes)
    number = np.full((axes.shape[0] + 2, axes.shape[1] + 2), -1)
    number[1:-1, 1:-1][axes] = np.arange(len(places))
    first, second, weights = [], [], []
    for down, along in ((0, 1), (1, 0), (1, 1), (1, -1)):
        there = number[places[:, 0] + 1 + down, places[:, 1] + 1 + along]
        found = np.flatnonzero(there >= 0)
        first.append(found)
        second.append(there[found])
        weights.append(np.full(found.size, np.hypot(down, along)))
    pairs = np.concatenate(first), np.concatenate(second)
    size = len(places)
    return places, scipy.sparse.csr_array((np.concatenate(weights), pairs), shape=(size, size))


__all__ = ["BEYOND", "LONGEST", "draw_seam", "join"]
