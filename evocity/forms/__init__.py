"""Chromosomes that are no fabric: shapes, curves, and sites, which are a fabric and its courses.

- `form`: what they have in common: `Form`
- `shape`: a few maps, laid in the window
- `curve`: a few control points, laid as a strip
- `site`: a fabric, and courses that run through it
- `lines`: lines in files and in windows: strips, crossings, fits
- `courses`: the courses that a recipe lays through its cities
- `files`: forms read from Parquet
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
