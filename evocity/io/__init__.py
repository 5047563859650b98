"""Files become maps, maps become files.

- `reading`: `read_map`, and the table of readers `READERS`
- `sources`: what a reader takes and returns
- `geojson`, `cityjson`, `osm`, `vector`, `raster`: the readers
- `heights`: the rules by which a building gets its height
- `projection`: reference systems, true metres
- `burning`, `resampling`: footprints and rasters on square pixels
- `bundled`: the districts that come with evocity
- `field`: values on a city's grid that are no heights
- `writing`: `write_map`, `write_field`, and the tables of writers
- `picture`: a map, or a field, as a picture
"""

from evocity.io.bundled import attribution_of, cities
from evocity.io.field import Field
from evocity.io.reading import READERS, plugin_warnings, read_map, suffixes
from evocity.io.sources import Footprints, Grid, Reader, Request
from evocity.io.writing import FIELD_WRITERS, WRITERS, write_field, write_map

__all__ = [
    "FIELD_WRITERS",
    "READERS",
    "WRITERS",
    "Field",
    "Footprints",
    "Grid",
    "Reader",
    "Request",
    "attribution_of",
    "cities",
    "plugin_warnings",
    "read_map",
    "suffixes",
    "write_field",
    "write_map",
]
