"""Rasters of heights.

- `reader`: GeoTIFF, PNG and NPY; `ascii_grid`: grids in text
- `values`, `sidecars`: metres and missing pixels; the files beside a raster
- `terrain`, `crowns`: elevations less the ground; rasters of trees
"""
