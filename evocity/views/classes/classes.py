"""Classification of the objects on a map: labels, classes, counts, shares, and an image."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.views.buildings import Buildings
from evocity.views.classes.objects import features, low_objects
from evocity.views.classes.table import ClassTable, packaged


@dataclass(frozen=True, eq=False)
class Classes:
    """The objects on a map, each of one class.

    labels : int32 ``(H, W)``: 0 on open ground; 1…n on the n buildings, as in
        `CityMap.building_labels`; from n + 1 on the objects lower than buildings.
    classes : uint8 ``(m,)``, the class of each object, as its number in ``table.names``.
    area, height, roundness : float64 ``(m,)``, of each object: m², mean height in metres, 0…1
        (`evocity.views.classes.objects.features`).
    buildings : n, the number of buildings, which come first.
    table : the classes, with their colours.

    Arrays are read-only.
    """

    labels: np.ndarray
    classes: np.ndarray
    area: np.ndarray
    height: np.ndarray
    roundness: np.ndarray
    buildings: int
    table: ClassTable

    def __len__(self) -> int:
        """Count the objects."""
        return self.classes.size

    @property
    def names(self) -> tuple[str, ...]:
        """The classes, in the order of the table."""
        return self.table.names

    @property
    def of_buildings(self) -> np.ndarray:
        """Uint8 ``(n,)``: the class of each building, in the order of `CityMap.buildings`."""
        return self.classes[: self.buildings]

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of objects of each class, by its name."""
        return self._by_name(np.bincount(self.classes, minlength=len(self.names)))

    @cached_property
    def areas(self) -> dict[str, float]:
        """Area that each class covers, by its name, m²."""
        return self._by_name(np.bincount(self.classes, self.area, minlength=len(self.names)))

    def _by_name(self, values: np.ndarray) -> dict:
        return dict(zip(self.names, values.tolist(), strict=True))

    @property
    def shares(self) -> dict[str, float]:
        """Share of each class in the ground that objects cover, by its name; together 1, or 0
        without objects."""
        whole = sum(self.areas.values())
        return {name: min(area / whole, 1.0) if whole else 0.0 for name, area in self.areas.items()}

    @cached_property
    def image(self) -> np.ndarray:
        """Uint8 ``(H, W)``: 0 on open ground, k + 1 on objects of class k."""
        image = np.concatenate([[0], self.classes + np.uint8(1)]).astype(np.uint8)[self.labels]
        image.setflags(write=False)
        return image


def classified(
    heights: np.ndarray,
    buildings: Buildings,
    metres_per_pixel: float,
    table: ClassTable | None = None,
    site: np.ndarray | None = None,
) -> Classes:
    """Classify each building and each lower object.

    Parameters
    ----------
    heights : float32 ``(H, W)``, metres.
    buildings : those of the map (`CityMap.buildings`); the function finds the lower objects.
    metres_per_pixel : side of a pixel, metres.
    table : the classes; None for those of this package.
    site : bool ``(H, W)``: the map's own pixels, None for all.

    About .5 ms at 256² without low objects, 3 ms with many.

    Source: the seven classes and their two features, surface and height, then "some quick shape
    analysis", Marsault 2005 (001 §3.1, fig. 10), which gives no limits. The limits are ours.
    """
    table = packaged() if table is None else table
    labels, values = buildings.labels, features(buildings)
    low = low_objects(heights, labels > 0, metres_per_pixel, site)
    if low is not None:
        labels = np.where(low.labels > 0, low.labels + np.int32(len(buildings)), labels)
        values = np.concatenate([values, features(low)], axis=1)
    columns = {
        "labels": labels,
        "classes": table.classified(values),
        "area": values[0].copy(),
        "height": values[1].copy(),
        "roundness": values[2].copy(),
    }
    for array in columns.values():
        array.setflags(write=False)
    return Classes(**columns, buildings=len(buildings), table=table)
