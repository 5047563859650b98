"""Shapes of few numbers: iterated function systems of the plane and of space, without any city.

- `shape`: `Shape`, maps with a primitive, a language and colours, and its pieces
- `checks`: what a shape may be made of
- `languages`: which words of maps act: automata, counts, union, concatenation, complement
- `contraction`: whether maps contract, proved or refuted
- `primitives`: what is drawn at each place
- `dimension`: exact dimensions, and by counting boxes
- `drawing`: masks, pictures, SVG
- `colouring`: palettes carried to other forms, colours stolen from a picture
- `solids`: shapes of space in GLB
- `classics`: shapes that everybody knows
- `curve`: curves of few control points, Bézier curves and splines among them
- `detail`: a line as a curve with what it lacks, level by level: `Detailed`
- `filters`: a polygon and its details taken apart and put together
- `fitting`: maps fitted to a line
- `lines`: polylines: what may be one, where one crosses itself
- `wires`: a segment replaced by a line again and again; metamorphosis
- `files`: shapes and curves in files; `documents`: JSON and Parquet
- `linear`: small matrices

Source: Tosan, Excoffier, Rondet-Mignotte 2005, and Hnaidi, Guérin, Akkouche for curves.
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
