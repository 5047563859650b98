"""Kinds of chromosome: what the log, a worker and the loop of a search must know of a genome.

They need no more of it than its ``digest`` and ``made``. All else goes through its kind: its
columns among the births', how a run adopts it, what map it expresses. `fabric` is a city as an
iterated function system.
"""

from collections.abc import Mapping

from evocity.kinds.fabric import Fabric
from evocity.kinds.kind import Expressed, Kind

#: The kinds of chromosome there are, by the name that a run's header tells.
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in (Fabric(),)}

__all__ = ["KINDS", "Expressed", "Fabric", "Kind"]
