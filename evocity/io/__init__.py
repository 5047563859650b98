"""Files become maps, maps become files.

- `reading`: `read_map`, and the table of readers `READERS`
- `sources`: what a reader takes and returns
- `geojson`, `cityjson`, `osm`, `vector`, `raster`: the readers
- `heights`: the rules by which a building gets its height
- `projection`: reference systems, true metres
- `burning`, `resampling`: footprints and rasters on square pixels
- `condensing`: what of a map decoding shall keep, by masks and footprints
- `bundled`: the districts that come with evocity
- `patterns`, `substitution`: towns drawn by a rule; `houses`: what they share
- `field`: values on a city's grid that are no heights
- `writing`: `write_map`, `write_field`, `write_shares`, `write_windows`, and the tables of writers
- `polygons`: the writers of footprints, GeoPackage and GeoJSON
- `picture`: a map, a field, or shares, as a picture
"""

from evocity.io.bundled import attribution_of, cities
from evocity.io.condensing import read_condensation
from evocity.io.field import Field, Shares
from evocity.io.patterns import (
    PATTERNS,
    chessboard_town,
    concentric_town,
    radial_town,
    substitution_town,
)
from evocity.io.reading import READERS, plugin_warnings, read_map, readers, suffixes
from evocity.io.sources import Footprints, Grid, Reader, Request
from evocity.io.writing import (
    FIELD_WRITERS,
    SHARES_WRITERS,
    WINDOW_WRITERS,
    WRITERS,
    write_field,
    write_map,
    write_shares,
    write_windows,
)

__all__ = [
    "FIELD_WRITERS",
    "PATTERNS",
    "READERS",
    "SHARES_WRITERS",
    "WINDOW_WRITERS",
    "WRITERS",
    "Field",
    "Footprints",
    "Grid",
    "Reader",
    "Request",
    "Shares",
    "attribution_of",
    "chessboard_town",
    "cities",
    "concentric_town",
    "plugin_warnings",
    "radial_town",
    "read_condensation",
    "read_map",
    "readers",
    "substitution_town",
    "suffixes",
    "write_field",
    "write_map",
    "write_shares",
    "write_windows",
]
