"""Readers and writers of map files.

- `map_reader`: `read_map`, and the table of readers `READERS`
- `map_paths`: files, folders that are maps, and addresses
- `reader_types`: what a reader takes and returns
- `geojson`, `cityjson`, `vector`, `geoparquet`, `dxf`: the readers of footprints
- `openstreetmap`, `xml`, `rasters`: rooms of readers; `xml` reads GML, CityGML and KML
- `archives`: maps in zip files; `json_sequence`: a JSON document on each line
- `surfaces`: shadows of surfaces in space
- `layer_choice`: the layer of buildings; `window_box`: bounds of the window for large files
- `account`: the count of a file's features, and why features are left out
- `building_choice`, `underground`: the buildings among polygons, by their tags
- `building_feet`, `building_rest`: feet of stacked parts, the rest of an outline outside its parts
- `cityjson_objects`: the objects of CityJSON and their parts
- `wkb_areas`: the areas of any geometry as they look from above
- `map_options`: checks of the options for reading maps
- `geopackage_sql`: bounds for what a GeoPackage computes; `polygon_repair`: outlines that cross
  themselves
- `heights`: the rules by which a building gets its height
- `roof_shapes`: the shapes of roofs that a source gives
- `projection`: reference systems, true metres
- `rasterization`, `resampling`: footprints and rasters on square pixels
- `condensation_masks`: pixels that decoding keeps, from masks and footprints
- `density_files`: wanted densities, from rasters and points
- `lines`: lines in GeoJSON, and condensations along them
- `bundled_cities`: the districts that come with evocity
- `writers`: `write_map`, `write_field`, `write_shares`, `write_leaves`, `write_faces`,
  `write_windows`, and the tables of writers
- `ground_rasters`: elevations of the ground, read and written
- `tiff`: the writer of GeoTIFF; `footprint_files`: footprints for files, and the writer of GeoJSON
- `export`: the room of GeoPackage, FlatGeobuf, GeoParquet, reference systems and styles
- `geotiff_seal`: the digest of a GeoTIFF, which shows changed bytes
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
