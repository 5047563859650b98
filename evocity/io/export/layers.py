"""Layers of polygons, lines and points in files that GDAL writes."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely


def write_layer(
    path: Path,
    shapes: np.ndarray,
    fields: Mapping[str, np.ndarray],
    tags: Mapping[str, str],
    **how: Any,
) -> None:
    """Write one layer: ``shapes`` with the columns ``fields``, and the ``tags`` that have a text.
    ``how``: options of `pyogrio.raw.write`. Raises `OSError` if GDAL cannot write."""
    import pyogrio  # which loads pandas, if it is there
    from pyogrio.errors import DataLayerError, DataSourceError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL warns of an empty layer, and of no place on Earth
        try:
            pyogrio.raw.write(
                path,
                geometry=shapely.to_wkb(shapes),
                field_data=list(fields.values()),
                fields=list(fields),
                layer_metadata={key: text for key, text in tags.items() if text},
                **how,
            )
        except (DataSourceError, DataLayerError) as error:
            raise OSError(str(error)) from error
