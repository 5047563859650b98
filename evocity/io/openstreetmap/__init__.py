"""Buildings of OpenStreetMap.

- `reader`: files of OpenStreetMap, by pyosmium
- `overpass`: OpenStreetMap as Overpass answers, and edits of JOSM
- `elements`, `areas`, `parts`: elements, their areas, and building parts that replace outlines
"""
