"""Skeleton of open ground for streets: middle lines with its topology, around open places."""

from dataclasses import dataclass

import numpy as np

from evocity.views.connected_components import dilate, pieces
from evocity.views.ground._kernels import thin, widths_across
from evocity.views.ground.lines import DENT
from evocity.views.ground.space import nearest_built
from evocity.views.streets._kernels import exits


@dataclass(frozen=True, eq=False)
class Ground:
    """Open ground and its middle lines, with a border of a pixel: arrays ``(H + 2, W + 2)``.

    open : bool, the ground. frame : bool, its pixels at the edge, where an open city continues
    beyond the map or its site. squares : int32, squared distance to the centre of the nearest
    wall's pixel, px. room : the same, but the middle of a place does not count as a wall. beside :
    int32, the nearest wall: 0 a building; 1 the frame, or the middle of a place that reaches it; 2
    and more, the middles of other places. middles : int32, the middles of places, labelled from 1.
    hubs : int32, the number of each middle in ``beside``, with a 0 first. lines : bool. exits :
    bool, the pixels where lines leave the map. across : float32, width from wall to wall, px, on
    all ground.
    """

    open: np.ndarray
    frame: np.ndarray
    squares: np.ndarray
    room: np.ndarray
    beside: np.ndarray
    middles: np.ndarray
    hubs: np.ndarray
    lines: np.ndarray
    exits: np.ndarray
    across: np.ndarray


def skeleton(
    ground: np.ndarray,
    site: np.ndarray | None,
    closed: bool,
    place: float | None,
    least: float = 0.0,
) -> Ground:
    """Thin ``ground``, bool ``(H, W)``, to lines in the middle between walls.

    In an open city the frame is not a wall. On each of its four sides lines leave the stretches
    of ground half of ``least`` px or more from walls, each at its farthest pixel. A street whose
    other wall is not on the map keeps its distance from the wall on the map. In a ``closed`` city
    the frame is a wall.

    place : px. Ground at half of it or more from all walls is the middle of a place, and counts as
    a wall: lines run round it. None makes no places.
    """
    within = np.pad(np.ones(ground.shape, bool) if site is None else site, 1)
    ground = np.pad(ground, 1)
    frame = np.zeros(ground.shape, bool) if closed else ground & dilate(~within)
    walls = ~ground if closed else within & ~ground
    if not walls.any():  # in an open city without walls the frame counts as a wall
        walls, place = ~ground, None
    squares, nearest = nearest_built(walls)
    room, what = squares, (~within).astype(np.int32)
    middles, hubs = np.zeros(ground.shape, np.int32), np.zeros(1, np.int32)
    if place is not None:
        middles, count = pieces(ground & (4 * squares >= place**2))
        if count:
            hubs = np.arange(1, count + 2, dtype=np.int32)
            hubs[0] = 0
            hubs[np.setdiff1d(middles[frame], 0)] = 1
            what += hubs[middles]
            walls, ground = walls | (middles > 0), ground & (middles == 0)
            frame &= ground
            squares, nearest = nearest_built(walls)
    out = np.zeros(ground.shape, bool)
    if not closed:
        wide, beyond = ground & (4 * squares >= least**2), ~within
        for step, axis in ((1, 0), (-1, 0), (1, 1), (-1, 1)):
            side = wide & np.roll(beyond, step, axis)
            exits(pieces(side, corners=True)[0], squares, out)
    lines, across = ground.copy(), np.empty(ground.shape, np.float32)
    thin(~ground, squares, nearest, out, DENT, lines)
    widths_across(squares, ground, across)
    beside = what[nearest[0], nearest[1]]
    return Ground(ground, frame, squares, room, beside, middles, hubs, lines, out, across)
