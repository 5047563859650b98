"""Operators of breeding: fusions, crossovers, mutations, rearrangements, changes of heights.

- `plan_fusion`, `quarter_fusion`, `region_fusion`, `pavement_fusion`, `content_fusion`: fusions
- `lambda_crossover`, `lambda_field`: crossovers, interpolation; fields of numbers over a map
- `mutation`, `rearrangements`, `height_operators`: operators of one parent
- `form_operators`: operators of shapes and curves
- `registry`: all operators by name, and how to make one
- `crossover`, `repair`, `parameters`: drafts of children, collage repair, checks of parameters
- `plans`, `street_blocks`, `pairing`, `groups`, `grid`, `building_heights`: shared parts
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
