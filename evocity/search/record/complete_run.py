"""Runs whose omitted genomes can be read: they are bred again.

Nothing of a run is executed: evocity's own operators breed, and those of installed packages.
"""

import json
from collections.abc import Sequence

from evocity import store
from evocity.condensation import Condensation
from evocity.genome import Genome
from evocity.store import Birth, Header, generator_at


def rebreed(
    birth: Birth, parents: Sequence[Genome], header: Header, condensation: Condensation | None
) -> Genome:
    """Breed a ``birth`` whose genome the log omits, from its ``parents``; its ``made`` is as in the
    log. Raises whatever its operator does."""
    from evocity import operators  # most runs are read without

    operator = operators.make(birth.operator, **json.loads(birth.reconstruction.settings))
    child = header.chromosome.breed(operator, parents, generator_at(birth.reconstruction.generator))
    return header.chromosome.adopt(child, header, condensation, birth.made)


class CompleteRun(store.RunLog):
    """A run folder, read only, as `evocity.store.RunLog`. A genome that its log omits (``[log]
    genomes`` of its recipe) is bred again when it is read, and compared with its hash."""

    _rebreed = staticmethod(rebreed)
