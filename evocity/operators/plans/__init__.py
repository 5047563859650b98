"""Plans of cities: the faces of a map's street graph, and buildings of other cities laid in them.

- `plan`: the plan of a map, face by face: `Plan`, `plan_of`
- `gene`: the gene of a face, which names the city and the place of its buildings: `FaceGene`
- `donor`: straight walls of a source city at half a metre, and the directions of its walls
- `laying`: buildings of a source city in a face, the same from the same gene: `lay`
- `changes`: changes of a plan as data: `apply_changes`, `draw_change`, `renumbering`
- `street_changes`: new alleys, closed streets, wider and narrower streets
- `seams`: two plans that meet along a street from frame to frame
- `changed`: a plan while it changes, and its new arrays
- `rebuilding`: buildings for the faces that a change makes
- `inheritance`: the plan that a genome inherits: `InheritedPlan`, `find_plan`, `plan_key`
- `planned_child`, `changed_child`: a child while its faces or its plan change
- `fill`: a search for buildings that fit a face or its halves: `fill_face`, `fill_halves`
- `storeys`: the range of heights in a face and around it: `storey_range`
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
