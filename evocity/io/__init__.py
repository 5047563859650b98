"""Files become maps, maps become files.

- `reading`: `read_map`, and the table of readers `READERS`
- `sources`: what a reader takes and returns
- `geojson`, `cityjson`, `osm`, `vector`, `raster`: the readers
- `computed`: what a GeoPackage computes, under a bound; `mending`: outlines that cross themselves
- `heights`: the rules by which a building gets its height
- `projection`: reference systems, true metres
- `burning`, `resampling`: footprints and rasters on square pixels
- `condensing`: what of a map decoding shall keep, by masks and footprints
- `lines`: lines in GeoJSON, and what lies along one as a condensation
- `bundled`: the districts that come with evocity
- `writing`: `write_map`, `write_field`, `write_shares`, `write_leaves`, `write_windows`, and the
  tables of writers; `windows`: what is written a band at a time
- `tiff`, `polygons`: the writers of GeoTIFF, and of footprints, GeoPackage and GeoJSON
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
