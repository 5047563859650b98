"""Buildings in XML: GML, CityGML and KML.

- `gml`, `kml`: the readers
- `citygml`: the buildings of CityGML; `gml_geometry`: the geometries of GML
- `stream`: the elements of an XML file, read one after the other within bounds
"""
