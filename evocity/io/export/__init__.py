"""Exports of maps: reference systems, styles for QGIS, and formats of tables with polygons.

- `reference_systems`: the reference system of a file, and its names that all programs take as equal
- `styles`: styles of QGIS (QML) with the colours of evocity's pictures
- `geopackage`: the writer of GeoPackage, with the street graph
- `tables`: the writers of FlatGeobuf and GeoParquet
- `warp`: GeoTIFFs in another reference system
"""
