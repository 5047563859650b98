"""A plan in the making: faces that change, and the arrays of the plan that they become."""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.errors import MapError, spell
from evocity.operators.plans.laying import LEAST_PIECE, LEAST_SHARE
from evocity.operators.plans.plan import (
    OPEN_BELOW,
    Plan,
    around_of,
    centres_of,
    neighbours_of,
    rank_faces,
)
from evocity.views.connected_components import dilate, pieces
from evocity.views.limit_tables import read_only

#: Least area of a face that a change makes, m².
LEAST_FACE = 300.0


@dataclass(eq=False)
class Draft:
    """Faces of a plan while a change is made. Numbers of faces need not be 1…n.

    labels : int32 ``(H, W)``, the face of each pixel; 0 on axes. lots : bool ``(H, W)``, pixels of
        lots. heights : float32 ``(H, W)``, metres.
    origins : the faces from which each face comes, pairs of a plan and a number.
    changed : numbers of the faces with other masks than before.
    """

    labels: np.ndarray
    lots: np.ndarray
    heights: np.ndarray
    origins: dict[int, list[tuple[Plan, int]]]
    changed: set[int]

    @classmethod
    def of(cls, plan: Plan) -> "Draft":
        """Start with the faces of a ``plan``."""
        origins = {face: [(plan, face)] for face in range(1, len(plan) + 1)}
        return cls(plan.labels.copy(), plan.lots > 0, plan.heights, origins, set())

    def new_face(self, origins: Iterable[tuple[Plan, int]]) -> int:
        """Return the number of a new face that comes from the faces ``origins``."""
        number = max(self.origins) + 1
        self.origins[number] = list(dict.fromkeys(origins))
        self.changed.add(number)
        return number

    def finish(self, plan: Plan, change: Mapping[str, Any]) -> Plan:
        """Make the plan: the faces of ``plan`` after a ``change``."""
        self.lots &= self.labels > 0
        numbers = np.unique(self.labels)
        numbers = numbers[numbers > 0]
        dense = np.zeros(int(numbers.max(initial=0)) + 1, np.int32)
        dense[numbers] = np.arange(1, numbers.size + 1)
        labels = dense[self.labels]
        lots = np.where(self.lots, labels, 0).astype(np.int32)
        rank = rank_faces(labels, lots, numbers.size)
        labels, lots = rank[labels], rank[lots]
        order = numbers[np.argsort(rank[1:])]
        arrays = self._arrays(labels, lots, order, plan.metres_per_pixel)
        changed = np.isin(labels, np.flatnonzero(np.isin(order, list(self.changed))) + 1)
        # axes beside changed faces belong to them here
        near = changed | (dilate(changed, corners=True) & (labels == 0))
        pixel = plan.metres_per_pixel
        buildings = CityMap(self.heights, pixel).building_labels
        heights = clip_buildings(self.heights, buildings, lots > 0, near, pixel)
        arrays = {"labels": labels, "lots": lots, "heights": heights, **arrays}
        fields: dict[str, Any] = {
            name: read_only(np.ascontiguousarray(array)) for name, array in arrays.items()
        }
        return dataclasses.replace(plan, changes=(*plan.changes, dict(change)), **fields)

    def _arrays(self, labels, lots, order: np.ndarray, pixel: float) -> dict[str, np.ndarray]:
        count = order.size
        area = np.bincount(labels.ravel(), minlength=count + 1)[1:] * pixel**2
        lot_area = np.bincount(lots.ravel(), minlength=count + 1)[1:] * pixel**2
        values = {name: np.zeros(count) for name in ("coverage", "front", "angle", "order")}
        vacant = np.zeros(count, bool)
        for k, number in enumerate(order.tolist()):
            known = self.origins[number]
            whole, face = known[0]
            if len(known) == 1:
                for name, array in values.items():
                    array[k] = getattr(whole, name)[face - 1]
                vacant[k] = whole.open[face - 1]
            else:
                for name, value in _mean(known).items():
                    values[name][k] = value
            if number in self.changed:
                if not lot_area[k]:
                    values["coverage"][k] = values["front"][k] = 0
                vacant[k] = values["coverage"][k] * lot_area[k] < OPEN_BELOW * area[k]
        windows = [
            (rows.start, columns.start, rows.stop, columns.stop)
            for rows, columns in scipy.ndimage.find_objects(labels)
        ]
        frame = np.concatenate([labels[[0, -1]].ravel(), labels[:, [0, -1]].ravel()])
        return {
            **values,
            "windows": np.array(windows, np.int32).reshape(-1, 4),
            "area": area,
            "lot_area": lot_area,
            "centre": centres_of(labels, lots, count),
            "open": vacant,
            "at_frame": np.isin(np.arange(1, count + 1), frame),
            "neighbours": neighbours_of(labels),
        }


def _mean(known: list[tuple[Plan, int]]) -> dict[str, float]:
    """Average the numbers of faces by the areas of their lots, and frames by their walls too."""
    lots = np.array([plan.lot_area[face - 1] for plan, face in known])
    share = lots / lots.sum() if lots.sum() else np.full(lots.size, 1 / lots.size)
    columns = {
        name: np.array([getattr(plan, name)[face - 1] for plan, face in known])
        for name in ("coverage", "front", "angle", "order")
    }
    walls = np.sum(share * columns["order"] * np.exp(4j * columns["angle"]))
    return {
        "coverage": float(np.sum(share * columns["coverage"])),
        "front": float(np.sum(share * columns["front"])),
        "angle": float(np.mod(np.angle(walls) / 4, np.pi / 2)),
        "order": float(np.abs(walls)),
    }


def axes_of(labels: np.ndarray) -> np.ndarray:
    """Mark the axes between the faces of ``labels``, bool ``(H, W)``; ground beyond a site is not
    an axis."""
    vacant = labels == 0
    around = around_of(labels, vacant)
    between = np.zeros(labels.shape, bool)
    between[vacant] = around.max(axis=0) > _least(around)
    # wide crossings, and bends of one pixel
    return between | (vacant & dilate(between, corners=True))


def _least(around: np.ndarray) -> np.ndarray:
    return np.where(around > 0, around, np.iinfo(np.int32).max).min(axis=0)


def close_inner(labels: np.ndarray, where: np.ndarray) -> None:
    """Give axes that have the same face on all sides to this face, among the pixels ``where``.

    Repeats until nothing changes, so that no axis ends within a face.
    """
    while (vacant := where & (labels == 0)).any():
        around = around_of(labels, vacant)
        most = around.max(axis=0)
        inner = (most > 0) & (_least(around) == most)
        if not inner.any():
            return
        labels[vacant] = np.where(inner, most, 0)


def check_streets(before: np.ndarray, after: np.ndarray, extra: int = 0) -> None:
    """Raise `MapError` if axes of ``after`` are in more parts than those of ``before``, bool
    ``(H, W)``, and ``extra``."""
    was, now = (pieces(axes, corners=True)[1] for axes in (before, after))
    if now > was + extra:
        raise MapError(
            f"the change divides the streets into {now} unconnected parts",
            f"at most {was + extra} unconnected parts, as many as before the change",
            "remove the change from the list of changes",
        )


def clip_buildings(
    heights: np.ndarray,
    buildings: np.ndarray,
    lots: np.ndarray,
    where: np.ndarray,
    metres_per_pixel: float,
) -> np.ndarray:
    """Clip buildings at the outline of ``lots``, bool ``(H, W)``, in the pixels ``where``.

    heights : float32 ``(H, W)``, metres. buildings : int32 ``(H, W)``, the building of each pixel.
    A cut building stands if half of it remains; of its parts, those of 60 m² and more stand.
    Returns float32 ``(H, W)``, the same array if no building is cut.
    """
    gone = where & ~lots & (buildings > 0)
    if not gone.any():
        return heights
    count = int(buildings.max())
    cut = np.unique(buildings[gone])
    whole = np.bincount(buildings.ravel(), minlength=count + 1)
    rest = np.bincount(buildings[~gone], minlength=count + 1)
    dropped = np.zeros(count + 1, bool)
    dropped[cut] = rest[cut] < LEAST_SHARE * whole[cut]
    heights = np.where(gone | dropped[buildings], 0, heights).astype(np.float32)
    touched = np.zeros(count + 1, bool)
    touched[cut] = True
    windows = scipy.ndimage.find_objects(np.where(touched[buildings], buildings, 0))
    for number in cut[~dropped[cut]].tolist():
        window = windows[number - 1]
        here = (buildings[window] == number) & ~gone[window]
        parts, _ = pieces(here)
        small = np.bincount(parts.ravel()) < LEAST_PIECE / metres_per_pixel**2
        heights[window][here & small[parts]] = 0
    return heights


def faces_of(plan: Plan, change: Mapping[str, Any], least: int, most: int) -> list[int]:
    """Check the numbers of faces of a change."""
    faces = change.get("faces", [change["face"]] if "face" in change else None)
    for face in faces or ():
        if isinstance(face, bool) or not isinstance(face, int) or not 1 <= face <= len(plan):
            raise MapError(
                f"the {change['kind']} names face {spell(face)}",
                f"a face of the plan, 1…{len(plan)}",
                "use the plan for which the change was made",
            )
    if faces is None or not least <= len(set(faces)) == len(faces) <= most:
        raise MapError(
            f"the {change['kind']} names the faces {spell(faces)}",
            f"{least}…{most} different faces",
            "correct the change",
        )
    return list(faces)


def check_size(kind: str, name: str, value: float, low: float, high: float) -> float:
    """Check the absolute ``value`` of a size, metres."""
    if not low <= abs(value) <= high:
        raise MapError(
            f"the {kind} has {name} = {spell(value)}", f"{low:g}…{high:g} m", "correct the change"
        )
    return float(value)


def refuse(reason: str, expected: str) -> MapError:
    """Make the error for a change that the plan does not allow."""
    return MapError(reason, expected, "leave this change out")


__all__ = [
    "LEAST_FACE",
    "Draft",
    "axes_of",
    "check_size",
    "check_streets",
    "clip_buildings",
    "close_inner",
    "faces_of",
    "refuse",
]
