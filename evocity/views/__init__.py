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
- `limit_tables`: the reader of tables of limits
"""
