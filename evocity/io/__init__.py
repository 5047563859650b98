"""Files become maps, maps become files.

- `reading`: `read_map`, and the table of readers `READERS`
- `sources`: what a reader takes and returns
- `geojson`, `cityjson`, `osm`, `vector`, `raster`: the readers
- `heights`: the rules by which a building gets its height
- `projection`: reference systems, true metres
- `burning`, `resampling`: footprints and rasters on square pixels
- `bundled`: the districts that come with evocity
- `writing`: `write_map`, and the table of writers `WRITERS`
- `picture`: a map as a picture
"""

from evocity.io.bundled import attribution_of, cities
from evocity.io.reading import READERS, read_map, suffixes
from evocity.io.sources import Footprints, Grid, Reader, Request
from evocity.io.writing import WRITERS, write_map

__all__ = [
    "READERS",
    "WRITERS",
    "Footprints",
    "Grid",
    "Reader",
    "Request",
    "attribution_of",
    "cities",
    "read_map",
    "suffixes",
    "write_map",
]
