"""Plans of cities: the faces of a map's street graph, and buildings of other cities laid in them.

- `plan`: the plan of a map, face by face: `Plan`, `plan_of`
- `gene`: the gene of a face, which names the city and the place of its buildings: `FaceGene`
- `donor`: straight walls of a source city at half a metre, and the directions of its walls
- `laying`: buildings of a source city in a face, the same from the same gene: `lay`
- `fill`: a search for buildings that fit a face: `fill_face`
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
