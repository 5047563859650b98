"""Runs opened so that the genomes their logs leave out can be had: they are bred again.

Nothing of a run is executed: evocity's own operators breed, and those of installed packages.
"""

import json
import os
from collections.abc import Sequence

from evocity import store
from evocity.condensation import Condensation
from evocity.genome import Genome
from evocity.store import Birth, Header, generator_at


def bred_again(
    birth: Birth, parents: Sequence[Genome], header: Header, condensation: Condensation | None
) -> Genome:
    """The child that a ``birth``, whose genome the log leaves out, was, from its ``parents``; its
    ``made`` as the log tells it. Raises whatever its operator does."""
    from evocity import operators  # most runs are read without

    operator = operators.make(birth.operator, **json.loads(birth.again.settings))
    child = header.chromosome.bred(operator, parents, generator_at(birth.again.generator))
    return header.chromosome.adopt(child, header, condensation, birth.made)


class Run(store.Run):
    """A run folder, read only, as `evocity.store.Run`. A genome that its log leaves out (``[log]
    genomes`` of its recipe) is bred again when it is asked for, and compared with its hash."""

    _rebreed = staticmethod(bred_again)


def open_run(path: str | os.PathLike) -> Run:
    """Open a run folder for reading; nothing in it is executed, nothing changed.

    Works while the run goes on: only whole generations are seen. Raises `RunError` if there
    is no run at ``path``, if it is damaged, or if another release wrote another schema.
    """
    return Run(path)


__all__ = ["Run", "bred_again", "open_run"]
