"""Styles of QGIS (QML) with the colours of evocity's pictures: for layers of a GeoPackage, in its
table ``layer_styles``, and for GeoTIFFs, in a file beside them."""

import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from evocity.citymap import BUILT_ABOVE
from evocity.pictures.colours import GROUND, field_colours, ramp

#: A style belongs to evocity if it has this comment; others are never overwritten.
MARK = "<!-- evocity -->"

_HEAD = "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n" + MARK + "\n"
# Ranges of heights and of street widths in a legend.
_RANGES = 10
_WIDTHS = (0.0, 4.0, 8.0, 12.0, 20.0, 30.0)
# Colours in sRGB and widths of lines in metres, from narrow streets to wide ones.
_STREETS = ((222, 226, 232), (200, 207, 217), (176, 186, 200), (150, 163, 181), (122, 138, 160))
_LINES = (1.5, 2.0, 2.5, 3.0, 4.0)
_INK, _HIGHEST = "90,84,80,255", 100_000.0

_TABLE = """CREATE TABLE layer_styles (
id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT,
styleSLD TEXT, useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')))"""
_CONTENTS = """INSERT INTO gpkg_contents (table_name, data_type, identifier, description, srs_id)
VALUES ('layer_styles', 'attributes', 'layer_styles', 'styles for QGIS', 0)"""
_STYLE = """INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name,
f_geometry_column, styleName, styleQML, styleSLD, useAsDefault, description, owner)
VALUES ('', '', ?, 'geom', ?, ?, '', ?, ?, '')"""

Colour = tuple[int, int, int]
#: A style: the layer, the style's name, its QML, and whether it is the layer's default.
Style = tuple[str, str, str, bool]


def add_styles(path: Path, styles: Sequence[Style], crs: str | None = None) -> None:
    """Write ``styles`` into a GeoPackage, and the WKT ``crs`` of its systems without a code. Raises
    OSError if SQLite cannot write."""
    try:
        with closing(sqlite3.connect(path)) as file, file:
            # the whole file reaches the disk afterwards, see `evocity.files.whole_file`
            file.execute("PRAGMA synchronous = OFF")
            file.execute("PRAGMA journal_mode = OFF")
            file.execute(_TABLE)
            file.execute(_CONTENTS)
            for layer, name, qml, is_default in styles:
                description = f"{name}, in the colours of evocity's pictures"
                file.execute(_STYLE, (layer, name, qml, is_default, description))
            if crs is not None:
                file.execute(
                    "UPDATE gpkg_spatial_ref_sys SET definition_12_063 = ? WHERE srs_id >= 100000",
                    (crs,),
                )
    except sqlite3.Error as error:
        raise OSError(str(error)) from error


def write_style(path: Path, qml: str) -> None:
    """Write a style beside the raster ``path``, unless a style of another origin is there."""
    beside = path.with_suffix(".qml")
    if beside.exists() and MARK.encode() not in beside.read_bytes()[:300]:
        return
    beside.write_text(qml, encoding="utf-8", newline="\n")


def height_style(highest: float) -> str:
    """Make the style of buildings: colours by the column ``height``, graduated up to ``highest``
    metres, as `evocity.pictures.colours.ramp`."""
    edges = np.linspace(0, highest, _RANGES + 1)
    middles = (edges[:-1] + edges[1:]) / 2
    colours = _rows(ramp(np.maximum(middles, BUILT_ABOVE)[None], highest))
    names = [f"{a:g}–{b:g} m" for a, b in pairwise(edges.tolist())]
    names[-1] = f"over {edges[-2]:g} m"
    return _graduated("height", [*edges[:-1], _HIGHEST], names, [_fill(c) for c in colours])


def class_style(colours: Mapping[str, Colour], column: str = "class") -> str:
    """Make the style of areas with the ``colours`` of classes, by a ``column``."""
    rows = "".join(
        f'<category value={quoteattr(name)} label={quoteattr(name)} symbol="{k}" render="true"/>'
        for k, name in enumerate(colours)
    )
    symbols = _symbols([_fill(colour) for colour in colours.values()])
    return _vector(
        f'<renderer-v2 type="categorizedSymbol" attr="{column}" symbollevels="0" '
        f'enableorderby="0"><categories>{rows}</categories>{symbols}</renderer-v2>'
    )


def street_style() -> str:
    """Make the style of streets: thin lines, graduated by ``width``. Surfaces of streets are in the
    layer of the ground; lines as wide as a square would cover buildings."""
    names = [f"{a:g}–{b:g} m" for a, b in pairwise(_WIDTHS)]
    names[-1] = f"over {_WIDTHS[-2]:g} m"
    edges = [*_WIDTHS[:-1], _HIGHEST]
    return _graduated("width", edges, names, list(map(_line, _STREETS, _LINES)))


def place_style(colour: Colour) -> str:
    """Make the style of places: one fill of a ``colour``."""
    return _single(_fill(colour))


def node_style() -> str:
    """Make the style of street nodes: small circles."""
    marker = {"name": "circle", "color": _INK, "outline_style": "no", "size": "1.2"}
    return _single(_symbol("marker", "SimpleMarker", marker))


def raster_style(highest: float, *, field: bool = False) -> str:
    """Make the style of a raster of heights up to ``highest`` metres, or of a ``field``."""
    if field:
        values = np.linspace(0, highest, _RANGES + 1)
        colours = _rows(field_colours(values[None].astype(np.float32), highest))
    else:
        steps = np.linspace(BUILT_ABOVE, max(highest, 2 * BUILT_ABOVE), _RANGES + 1)
        values = np.r_[0, BUILT_ABOVE - 1e-3, steps]
        colours = _rows(ramp(values[None], highest))
        colours[0] = GROUND
    unit = "" if field else " m"
    items = "".join(
        f'<item value="{value:.9g}" label="{value:.3g}{unit}" color="#{bytes(colour).hex()}" '
        'alpha="255"/>'
        for value, colour in zip(values, colours, strict=True)
    )
    low, high = float(values[0]), float(values[-1])
    limits = f'classificationMin="{low:g}" classificationMax="{high:g}"'
    return (
        f'{_HEAD}<qgis version="3.22" styleCategories="AllStyleCategories"><pipe>'
        f'<rasterrenderer type="singlebandpseudocolor" band="1" opacity="1" alphaBand="-1" '
        f'{limits}><rastershader><colorrampshader colorRampType="INTERPOLATED" '
        f'classificationMode="1" clip="0" minimumValue="{low:g}" maximumValue="{high:g}">{items}'
        "</colorrampshader></rastershader></rasterrenderer></pipe></qgis>\n"
    )


def _rows(colours: np.ndarray) -> list[Colour]:
    return [tuple(row) for row in colours.reshape(-1, 3).tolist()]


def _graduated(
    column: str, edges: Sequence[float], names: Sequence[str], symbols: Sequence[str]
) -> str:
    rows = "".join(
        f'<range lower="{edges[k]:.9g}" upper="{edges[k + 1]:.9g}" label={quoteattr(name)} '
        f'symbol="{k}" render="true"/>'
        for k, name in enumerate(names)
    )
    return _vector(
        f'<renderer-v2 type="graduatedSymbol" attr={quoteattr(column)} symbollevels="0" '
        f'graduatedMethod="GraduatedColor" enableorderby="0"><ranges>{rows}</ranges>'
        f"{_symbols(symbols)}</renderer-v2>"
    )


def _single(symbol: str) -> str:
    return _vector(
        f'<renderer-v2 type="singleSymbol" symbollevels="0" enableorderby="0">'
        f"{_symbols([symbol])}</renderer-v2>"
    )


def _vector(renderer: str) -> str:
    return (
        f'{_HEAD}<qgis version="3.22" styleCategories="Symbology">{renderer}'
        "<blendMode>0</blendMode><featureBlendMode>0</featureBlendMode></qgis>\n"
    )


def _symbols(symbols: Sequence[str]) -> str:
    numbered = (symbol.replace("<symbol ", f'<symbol name="{k}" ', 1) for k, symbol in
                enumerate(symbols))  # fmt: skip
    return f"<symbols>{''.join(numbered)}</symbols>"


def _fill(colour: Colour) -> str:
    look = {"color": _text(colour), "style": "solid", "outline_color": _INK}
    look |= {"outline_style": "solid", "outline_width": "0.1", "outline_width_unit": "MM"}
    return _symbol("fill", "SimpleFill", look)


def _line(colour: Colour, width: float) -> str:
    unit = "RenderMetersInMapUnits"
    look = {"line_color": _text(colour), "line_width": f"{width:g}", "line_width_unit": unit}
    look |= {"capstyle": "round", "joinstyle": "round"}
    return _symbol("line", "SimpleLine", look)


def _symbol(kind: str, layer: str, look: Mapping[str, str]) -> str:
    options = "".join(f'<prop k="{key}" v="{value}"/>' for key, value in look.items())
    return (
        f'<symbol type="{kind}" alpha="1" clip_to_extent="1" force_rhr="0">'
        f'<layer class="{layer}" enabled="1" locked="0" pass="0">{options}</layer></symbol>'
    )


def _text(colour: Colour) -> str:
    return ",".join(map(str, (*colour, 255)))
