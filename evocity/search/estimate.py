"""What a run will take of the disk and of the night, told by its first generation."""

import os
import shutil
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from evocity.search.generation import Generation
from evocity.search.recipe import Recipe
from evocity.search.stopping import size_of
from evocity.search.worker import told_bytes
from evocity.store.layout import BIRTHS, MEMBERSHIP


@dataclass(frozen=True)
class Estimate:
    """How much all ``births`` of a run take: ``size`` bytes of the disk, which has ``free`` ones
    left, and ``seconds`` more. ``allowed``: bytes that its recipe allows, with the ``last``
    generation within them, None where there is room for all."""

    births: int
    size: int
    free: int
    seconds: float
    allowed: int | None = None
    last: int | None = None

    @property
    def words(self) -> str:
        """In a line."""
        each = told_bytes(round(self.size / self.births))
        left = timedelta(seconds=round(self.seconds))
        text = (
            f"about {self.births} births of {each}: {told_bytes(self.size)} of the disk "
            f"({told_bytes(self.free)} free) and {left} more"
        )
        if self.last is None:
            return text
        return f"{text}; [stop] disk = {told_bytes(self.allowed)} ends it by generation {self.last}"

    @property
    def warning(self) -> str:
        """What is to be done where the disk will not hold the run; "" where it does."""
        needed = self.size if self.allowed is None else min(self.size, self.allowed)
        if needed <= self.free:
            return ""
        return (
            f"the disk will not hold this run: about {told_bytes(needed)} are needed, "
            f"{told_bytes(self.free)} are free. Free some, or breed fewer generations; what is "
            "written stays readable"
        )


def estimate_of(
    folder: str | os.PathLike, recipe: Recipe, generation: Generation
) -> Estimate | None:
    """Of the run in ``folder`` by a ``recipe``, after its first ``generation``: bytes a birth as
    they were written, times all births; None where nothing follows."""
    count, planned = generation.births, recipe.run.generations
    if planned <= generation.number or not count:
        return None
    written = sum(size_of(Path(folder) / kind) for kind in (BIRTHS, MEMBERSHIP))
    each = written / (generation.number + 1)  # a generation
    fixed = size_of(folder) - written
    size = round(fixed + each * (planned + 1))
    allowed, last = recipe.stop.disk_bytes, None
    if allowed is not None and allowed < size:
        last = max(generation.number, int((allowed - fixed) / each) - 1)
    births = count // (generation.number + 1) * (planned + 1)
    free = shutil.disk_usage(folder).free
    return Estimate(births, size, free, generation.seconds_left, allowed, last)


__all__ = ["Estimate", "estimate_of"]
