"""Views of a map besides heights: arrays in, arrays out; `CityMap` caches each for its map.

- `buildings`: the segmentation of built ground into buildings, their table and outlines
- `ground`: open space, distance to the nearest wall, streets and their widths
- `streets`: the street graph of open ground, places, quarters
- `walls`: straight walls of buildings, as polygons
- `surfaces`: buildings and the ground between them, as one coverage of polygons
- `classes`: classes of objects by area, height and shape
- `orientation`: directions of walls, pixel by pixel
- `ridges`: what heights measure to, the eaves or the ridges
- `connected_components`: the connected pieces of a mask
- `local_density`: GSI and FSI around each place of a map
- `wanted_density`: the densities that a plan wants around places
- `map_arrays`: the checks of a map's arrays
- `limit_tables`: the reader of tables of limits
"""
