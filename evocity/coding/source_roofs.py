"""Roofs that the source of a map gives, as the table that genomes keep."""

import numpy as np

from evocity.citymap import CityMap
from evocity.genome import RIDGE, ROOF_SHAPES, RoofTable
from evocity.views.ridges import heights_are_ridges


def roofs_of_map(city: CityMap) -> RoofTable | None:
    """Make the table of the roofs of a ``city`` that its source gives: the shapes of
    `CityMap.roof_shapes`, and whether heights measure to ridges. None if they measure to eaves and
    the source gives no shape. Each building has the shape with the largest area. Ground has the
    code of the building before it in the row, so that runs are long."""
    ridge = RIDGE if heights_are_ridges(city.height_rules, city.attribution) else 0
    given = city.roof_shapes
    if given is None or not len(given):
        return RoofTable.of_raster(np.full(city.shape, ridge, np.uint8))
    labels = city.building_labels
    (left, top), pixel = city.north_west, city.metres_per_pixel
    row = np.floor((top - given[:, 1]) / pixel)
    column = np.floor((given[:, 0] - left) / pixel)
    known = (row >= 0) & (row < city.shape[0]) & (column >= 0) & (column < city.shape[1])
    known &= (given[:, 2] >= 0) & (given[:, 2] < ROOF_SHAPES)
    areas = np.zeros((int(labels.max(initial=0)) + 1, ROOF_SHAPES))
    own = labels[row[known].astype(int), column[known].astype(int)]
    np.add.at(areas, (own, given[known, 2].astype(int)), given[known, 3])
    shapes = np.where(areas.any(axis=1), areas.argmax(axis=1) + 1, 0)
    flat = labels.ravel()
    built = np.flatnonzero(flat)
    if not built.size:
        return RoofTable.of_raster(np.full(city.shape, ridge, np.uint8))
    before = np.maximum.accumulate(np.where(flat > 0, np.arange(flat.size), built[0]))
    codes = (shapes + ridge).astype(np.uint8)[flat[before]]
    return RoofTable.of_raster(codes.reshape(city.shape))
