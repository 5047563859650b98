"""Operators of breeding: fusions, crossovers, mutations, rearrangements, changes of heights.

- `plan_change`, `plan_seam`: other streets
- `plan_fusion`, `plan_crossing`, `plan_spread`, `plan_return`, `plan_storeys`: operators of plans
- `quarter_fusion`, `region_fusion`, `pavement_fusion`, `content_fusion`: fusions
- `lambda_crossover`, `lambda_field`: crossovers, interpolation; fields of numbers over a map
- `mutation`, `rearrangements`, `height_operators`: operators of one parent
- `form_operators`: operators of shapes and curves
- `registry`: all operators by name, and how to make one
- `face_filling`: base of operators of plans
- `crossover`, `repair`, `parameters`: drafts of children, collage repair, checks of parameters
- `plans`, `street_blocks`, `pairing`, `groups`, `grid`, `building_heights`: shared parts
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
