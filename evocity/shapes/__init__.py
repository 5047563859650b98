"""Shapes and curves of few numbers: iterated function systems of the plane and of space.

- `shape`: `Shape`, maps with a primitive, a language and colours, and its pieces
- `checks`: checks of arrays, numbers, maps and colours, and their errors
- `languages`: regular languages of words of maps: automata, counts, union, concatenation,
  complement
- `contraction`: proofs and refutations that maps contract
- `primitives`: points, lines and faces at each place
- `dimension`: exact dimensions, and by counting boxes
- `rendering`: masks, pictures, SVG, solids in GLB
- `motifs`: pictures with a primitive for each map
- `colours`: palettes for other forms, colours stolen from a picture
- `joint_colours`: maps that mix places and colours
- `deformation`: polynomial deformation of shapes
- `classics`: well-known shapes
- `curve`: curves of few control points, such as Bézier curves and splines
- `detail`: a line as a curve with details, level by level: `Detailed`
- `filters`: analysis of a polygon into parts and details, and synthesis
- `curve_fit`: maps fitted to a line
- `lines`: checks, resampling and crossings of polylines
- `surface`: surfaces of few control points; `surface_detail`, `surface_fit`, `surface_files`:
  height maps of ground as surfaces with details, their fit and their files
- `surface_forms`: vaults, domes and other forms of roofs
- `wires`: a segment replaced by a line, iterated; metamorphosis
- `files`: shapes and curves in files, JSON and Parquet
- `linear`: small matrices

Source: Tosan, Excoffier, Rondet-Mignotte 2005, and Hnaidi, Guérin, Akkouche for curves.
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
