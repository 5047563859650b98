"""Kinds of chromosome: what the log, a worker and the loop of a search must know of a genome.

They need no more of it than its ``digest`` and ``made``. All else goes through its kind: its
columns among the births', how a run adopts it, what operators and measures it has, what map it
expresses. `fabric` is a city as an iterated function system, `shape` a few maps of the plane,
`curve` a few control points, `site` a fabric with courses that run through it. docs/kinds.md tells
of them.
"""

from collections.abc import Mapping

from evocity.kinds.fabric import Fabric
from evocity.kinds.kind import Expressed, Kind, Window
from evocity.kinds.lined import Curves, Shapes
from evocity.kinds.sited import Sites

#: The kinds of chromosome there are, by the name that a run's header tells.
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in (Fabric(), Shapes(), Curves(), Sites())}

__all__ = ["KINDS", "Curves", "Expressed", "Fabric", "Kind", "Shapes", "Sites", "Window"]
