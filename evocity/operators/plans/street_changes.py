"""Changes of streets in a plan: new alleys, closed streets, wider and narrower streets."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from evocity.operators.plans.changed import (
    LEAST_FACE,
    Draft,
    axes_of,
    check_size,
    check_streets,
    close_inner,
    faces_of,
    refuse,
)
from evocity.operators.plans.plan import Plan, around_of
from evocity.views.connected_components import dilate, pieces

#: Range of the width of a new alley, metres, and of a change of a street's width.
ALLEY_WIDTHS, WIDTH_STEPS = (3.0, 6.0), (2.0, 4.0)
#: Widest street that a closing closes, metres from lot to lot.
WIDEST_CLOSED = 12.0
#: Least width that a narrowed street keeps on each side of its axis, metres.
LEAST_HALF = 3.0
#: Least area of a face that an alley cuts, m², and the least share of each part.
LARGE_FACE, LEAST_HALVES = 2400.0, 0.25


def cut_alley(draft: Draft, plan: Plan, change: Mapping[str, Any]) -> None:
    """Cut a face by a straight alley from street to street."""
    face = faces_of(plan, change, 1, 1)[0]
    width = check_size("alley", "width", change["width"], *ALLEY_WIDTHS)
    row, column, angle = (float(change[name]) for name in ("row", "column", "angle"))
    window = plan.window(face)
    here = plan.labels[window] == face
    rows, columns = np.indices(here.shape)
    down, along = rows + window[0].start - row, columns + window[1].start - column
    across = down * math.cos(angle) - along * math.sin(angle)
    half = max(abs(math.cos(angle)), abs(math.sin(angle))) / 2
    line, _ = pieces(here & (across >= -half) & (across < half), corners=True)
    if not line.any():
        raise refuse(f"the alley does not cross face {face}", "a place within the face")
    middle = np.where(line > 0, down**2 + along**2, np.inf).argmin()
    line = line == line.ravel()[middle]
    alley = _spread(line, window, plan.labels.shape)
    if not (dilate(alley, corners=True) & (plan.labels == 0)).any():
        raise refuse(f"the alley in face {face} reaches no street", "a street at one end or both")
    halves, count = pieces(here & ~line)
    sizes = np.bincount(halves.ravel(), minlength=count + 1)[1:]
    least = max(LEAST_FACE / plan.metres_per_pixel**2, LEAST_HALVES * here.sum())
    # corners that the raster leaves beside the line join the larger parts
    large = np.flatnonzero(sizes >= least) + 1
    if large.size != 2:
        raise refuse(
            f"the alley cuts face {face} in {large.size} large parts",
            f"two parts with {100 * LEAST_HALVES:.0f} % of the face each",
        )
    if sizes.sum() - sizes[large - 1].sum() > LEAST_FACE / plan.metres_per_pixel**2:
        raise refuse(f"the alley leaves small parts of face {face}", "two parts")
    labels = draft.labels[window]
    labels[line] = 0
    for part in large.tolist():
        labels[halves == part] = draft.new_face(draft.origins[face])
    loose = (halves > 0) & ~np.isin(halves, large)
    labels[loose] = 0
    _absorb(labels, loose)
    close_inner(draft.labels, alley | _spread(loose, window, plan.labels.shape))
    parallel = np.abs(across) * plan.metres_per_pixel < width / 2 + 0.25
    reach = scipy.ndimage.distance_transform_edt(~line) * plan.metres_per_pixel
    draft.lots[window] &= ~(here & parallel & (reach < width))


def _absorb(labels: np.ndarray, loose: np.ndarray) -> None:
    """Give ``loose`` pixels to the nearest face in the window."""
    if loose.any():
        nearest = scipy.ndimage.distance_transform_edt(
            labels == 0, return_distances=False, return_indices=True
        )
        labels[loose] = labels[tuple(nearest)][loose]


def _spread(mask: np.ndarray, window, shape: tuple[int, int]) -> np.ndarray:
    whole = np.zeros(shape, bool)
    whole[window] = mask
    return whole


def draw_alley(plan: Plan, rng: np.random.Generator) -> dict[str, Any] | None:
    """Draw an alley through a large face, near the middle of its lot."""
    large = np.flatnonzero(~plan.open & (plan.lot_area >= LARGE_FACE))
    pick, side, shift, width = rng.random(4).tolist()
    if not large.size:
        return None
    face = int(
        large[np.searchsorted(np.cumsum(plan.lot_area[large]), pick * plan.lot_area[large].sum())]
    )
    angle = plan.angle[face] + (math.pi / 2 if side < 0.5 else 0)
    reach = math.sqrt(plan.lot_area[face]) / plan.metres_per_pixel * 0.4 * (shift - 0.5)
    row, column = plan.centre[face]
    return {
        "kind": "alley",
        "face": face + 1,
        "row": round(float(row + reach * math.cos(angle)), 2),
        "column": round(float(column - reach * math.sin(angle)), 2),
        "angle": round(float(angle), 4),
        "width": round(4 + 2 * width, 1),
    }


def _between(labels: np.ndarray, first: int, second: int) -> np.ndarray:
    """Mark the axes that only two faces touch, bool ``(H, W)``."""
    shared = labels == 0
    around = around_of(labels, shared)
    ours = (around == first) | (around == second) | (around == 0)
    both = (around == first).any(axis=0) & (around == second).any(axis=0)
    shared[shared] = both & ours.all(axis=0)
    return shared


def close_street(draft: Draft, plan: Plan, change: Mapping[str, Any]) -> None:
    """Close the street between two faces."""
    first, second = faces_of(plan, change, 2, 2)
    shared = _between(plan.labels, first, second)
    if not shared.any():
        raise refuse(f"faces {first} and {second} have no street between them", "two neighbours")
    half = _half_width(plan, first, second, shared)
    if not 2 * half <= WIDEST_CLOSED:
        raise refuse(
            f"the street between faces {first} and {second} is {2 * half:.1f} m wide",
            f"{WIDEST_CLOSED:g} m at most",
        )
    both = (plan.labels == first) | (plan.labels == second)
    number = draft.new_face([*draft.origins[first], *draft.origins[second]])
    draft.labels[both | shared] = number
    near = dilate(shared, corners=True)
    close_inner(draft.labels, near & (draft.labels == 0))
    check_streets(axes_of(plan.labels), axes_of(draft.labels))
    # the ground of the street joins the lot, as far as both lots border on it
    radius = half / plan.metres_per_pixel + 1.5
    box = scipy.ndimage.find_objects((both | shared).astype(np.int8))[0]
    distance = scipy.ndimage.distance_transform_edt
    inside = draft.labels[box] == number
    facing = inside & (distance(~shared[box]) <= radius)
    for face in (first, second):
        facing &= distance(plan.lots[box] != face) <= 2 * radius
    lot = scipy.ndimage.binary_fill_holes((draft.lots[box] & inside) | facing)
    draft.lots[box] |= lot & inside


def _half_width(plan: Plan, first: int, second: int, shared: np.ndarray) -> float:
    """Find the median distance from the ``shared`` axis to the lots of two faces, metres."""
    lots = (plan.lots == first) | (plan.lots == second)
    if not lots.any():
        return math.inf
    box = scipy.ndimage.find_objects((lots | shared).astype(np.int8))[0]
    away = scipy.ndimage.distance_transform_edt(~lots[box])[shared[box]] - 0.5
    return float(np.median(away)) * plan.metres_per_pixel


def draw_closing(plan: Plan, rng: np.random.Generator) -> dict[str, Any] | None:
    """Draw two neighbours whose street is to be closed."""
    pick = rng.random()
    pairs = plan.neighbours[~plan.open[plan.neighbours - 1].any(axis=1)]
    if not len(pairs):
        return None
    first, second = pairs[int(pick * len(pairs))].tolist()
    return {"kind": "closing", "faces": [first, second]}


def move_outline(draft: Draft, plan: Plan, change: Mapping[str, Any]) -> None:
    """Move the outline of a lot back from its streets, or forward."""
    faces = faces_of(plan, change, 1, 2)
    metres = check_size("width", "metres", change["metres"], *WIDTH_STEPS)
    face, pixel = faces[0], plan.metres_per_pixel
    reach = math.ceil(2 * WIDTH_STEPS[1] / pixel) + 2
    rows, columns = (
        slice(max(one.start - reach, 0), one.stop + reach) for one in plan.window(face)
    )
    window = rows, columns
    here = plan.labels[window] == face
    lot = plan.lots[window] == face
    if here.all() or not lot.any():
        raise refuse(f"face {face} has no street or no lot", "a lot beside a street")
    distance = scipy.ndimage.distance_transform_edt
    side, nearest = distance(here, return_indices=True)
    toward = np.ones(here.shape, bool)
    if len(faces) == 2:
        shared = _between(plan.labels, *faces)[window]
        toward = shared[tuple(nearest)]
    if metres > 0:
        moved = lot & toward & ((distance(lot) - 0.5) * pixel < metres)
        draft.lots[window][moved] = False
    else:
        moved = here & ~lot & toward & ((distance(~lot) - 0.5) * pixel < -metres)
        moved &= (side - 0.5) * pixel >= LEAST_HALF
        draft.lots[window][moved] = True
    if not moved.any() or moved.sum() * 2 > lot.sum():
        raise refuse(f"the lot of face {face} does not move by {metres:g} m", "a face with room")
    number = draft.new_face(draft.origins[face])
    draft.labels[window][here] = number


def draw_width(plan: Plan, rng: np.random.Generator) -> dict[str, Any] | None:
    """Draw a lot whose outline moves, on all sides or toward one neighbour."""
    pick, other, alone, sign, metres = rng.random(5).tolist()
    built = np.flatnonzero(~plan.open & (plan.lot_area >= LEAST_FACE)) + 1
    if not built.size:
        return None
    face = int(built[int(pick * built.size)])
    pairs = plan.neighbours[(plan.neighbours == face).any(axis=1)]
    faces = [face]
    if alone >= 0.5 and len(pairs):
        pair = pairs[int(other * len(pairs))].tolist()
        faces.append(pair[0] if pair[1] == face else pair[1])
    low, high = WIDTH_STEPS
    size = round(low + (high - low) * metres, 1)
    return {"kind": "width", "faces": faces, "metres": size if sign < 0.5 else -size}


__all__ = [
    "close_street",
    "cut_alley",
    "draw_alley",
    "draw_closing",
    "draw_width",
    "move_outline",
]
