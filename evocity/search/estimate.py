"""What a run will take of the disk and of the night: a bound before it begins, more by its first
generation."""

import math
import os
import shutil
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from evocity.errors import told_bytes
from evocity.search.generation import Generation
from evocity.search.overnight import moment_of
from evocity.search.recipe import Recipe
from evocity.search.stopping import Clock, now, size_of
from evocity.store import Thumbnails
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder


@dataclass(frozen=True)
class Estimate:
    """How much all ``births`` of a run take: ``size`` bytes of the disk, which has ``free`` ones
    left, and ``seconds`` more. ``last``: the generation by which ``stop``, in words a key of the
    recipe's ``[stop]``, ends it, with the bytes ``needed`` until then; None where nothing does."""

    births: int
    size: int
    free: int
    seconds: float
    last: int | None = None
    stop: str = ""
    needed: int | None = None

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
        return f"{text}; [stop] {self.stop} ends it by about generation {self.last}"

    @property
    def warning(self) -> str:
        """What is to be done where the disk will not hold the run; "" where it does."""
        needed = self.size if self.needed is None else self.needed
        if needed <= self.free:
            return ""
        return (
            f"the disk will not hold this run: about {told_bytes(needed)} are needed, "
            f"{told_bytes(self.free)} are free. Free some, or breed fewer generations; what is "
            "written stays readable"
        )


def bound_of(folder: str | os.PathLike, recipe: Recipe) -> str:
    """In a line, what the run in ``folder`` by a ``recipe`` takes at most, before its first
    generation."""
    births, most = at_most(Path(folder, "sources"), recipe)
    free = shutil.disk_usage(folder).free
    return (
        f"{births} births, at most {told_bytes(most)} of the disk ({told_bytes(free)} free); the "
        f"first {recipe.run.population} will tell how long it takes"
    )


def at_most(sources: Path, recipe: Recipe) -> tuple[int, int]:
    """How many births a run by a ``recipe`` has, and bytes of the disk that they take at most: the
    genomes of its ``sources``, which have a file each in that folder, are larger than theirs, and
    a thumbnail has a byte a cell."""
    sizes = [one.stat().st_size for one in sources.glob("*.genome.parquet")]
    births = recipe.run.population * (recipe.run.generations + 1)
    side = recipe.map.pixels
    made = Thumbnails.of(side, side, 1.0)
    small = 0 if made is None else math.prod(made.shape(side, side))
    return births, births * (max(sizes, default=0) + small)


def first_telling(recipe: Recipe) -> int:
    """The first generation that is as large as those to come will be: where the log leaves genomes
    out, all of generation 0 live on, and are kept."""
    return 0 if recipe.log.genomes == "all" else 1


def estimate_of(
    folder: str | os.PathLike, recipe: Recipe, generation: Generation, clock: Clock = now
) -> Estimate | None:
    """Of the run in ``folder`` by a ``recipe``, after its `first_telling` ``generation``: those to
    come will be as large; None before, and where nothing follows. ``clock`` tells the time."""
    count, planned, done = generation.births, recipe.run.generations, generation.number
    if planned <= done or done < first_telling(recipe) or not count:
        return None
    places, taken = Folder(Path(folder)), size_of(folder)
    each = sum(places.single(kind, done).stat().st_size for kind in (BIRTHS, MEMBERSHIP))
    ends = []
    if (allowed := recipe.stop.disk_bytes) is not None:
        last = done + max(0, (allowed - taken) // each)
        ends.append((last, f"disk = {told_bytes(allowed)}"))
    moment = None if recipe.stop.until is None else moment_of(recipe.stop.until, clock())
    pace = generation.seconds_left / (planned - done)
    if moment is not None and pace:
        more = math.ceil(max(0.0, (moment - clock()).total_seconds()) / pace)
        ends.append((done + more, f"until = {moment:%Y-%m-%d %H:%M}"))
    last, stop = min(ends, default=(planned, ""))
    births = count // (done + 1) * (planned + 1)
    size, free = taken + each * (planned - done), shutil.disk_usage(folder).free
    if last >= planned:
        return Estimate(births, size, free, generation.seconds_left)
    needed = taken + each * (last - done)
    return Estimate(births, size, free, generation.seconds_left, last, stop, needed)


__all__ = ["Estimate", "at_most", "bound_of", "estimate_of", "first_telling"]
