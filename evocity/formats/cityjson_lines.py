"""CityJSONSeq 2.0: a CityJSON document in lines, one for each object."""

import json
from collections.abc import Sequence

from evocity.formats.cityjson import cityjson
from evocity.formats.solids import About, Group

_text = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode


def cityjson_lines(groups: Sequence[Group], about: About) -> str:
    """Write a CityJSON text sequence (cityjson.org/cityjsonseq): first the document without
    objects, then each object as a CityJSONFeature with its own vertices."""
    document = json.loads(cityjson(groups, about))
    objects, vertices = document.pop("CityObjects"), document.pop("vertices")
    lines = [_text(document | {"CityObjects": {}, "vertices": []})]
    for name, described in objects.items():
        used: dict[int, int] = {}
        for geometry in described["geometry"]:
            geometry["boundaries"] = _renumbered(geometry["boundaries"], used)
        feature = {"type": "CityJSONFeature", "id": name, "CityObjects": {name: described}}
        lines.append(_text(feature | {"vertices": [vertices[number] for number in used]}))
    return "\n".join(lines) + "\n"


def _renumbered(boundaries: list | int, used: dict[int, int]) -> list | int:
    """Number the vertices of nested ``boundaries`` in the order of their first use."""
    if isinstance(boundaries, int):
        return used.setdefault(boundaries, len(used))
    return [_renumbered(part, used) for part in boundaries]
