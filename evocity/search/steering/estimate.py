"""Estimates of a run's disk and hours, before it begins and after its first generation."""

import math
import os
import shutil
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from evocity.errors import format_bytes
from evocity.recipe.recipe import Recipe
from evocity.recipe.stop_and_notify import moment_of
from evocity.search.steering.generation import Generation
from evocity.search.steering.stop_rules import Clock, current_time, size_of
from evocity.store import Thumbnails
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder

#: Factors of the least and the largest bytes and seconds that a run takes, of those that its first
#: generation would take each time. Nine of ten runs of `benchmarks/estimates.py` lie within.
SIZES, TIMES = (0.7, 2.5), (0.5, 3.0)


@dataclass(frozen=True)
class Estimate:
    """The cost of all ``births`` of a run, if all generations are as the first: ``size`` bytes, of
    ``free`` ones on the disk, and ``seconds`` more. ``last``: the generation by which ``stop``, a
    key of the recipe's ``[stop]`` in words, ends the run, with the bytes ``needed`` until then;
    None if nothing does."""

    births: int
    size: int
    free: int
    seconds: float
    last: int | None = None
    stop: str = ""
    needed: int | None = None

    @property
    def sizes(self) -> tuple[int, int]:
        """The least and the largest bytes that the run takes."""
        return round(SIZES[0] * self.size), round(SIZES[1] * self.size)

    @property
    def times(self) -> tuple[float, float]:
        """The least and the most seconds that the run still takes."""
        return TIMES[0] * self.seconds, TIMES[1] * self.seconds

    @property
    def words(self) -> str:
        """The estimate in one line."""
        least, most = self.sizes
        each = " to ".join(format_bytes(round(size / self.births)) for size in (least, most))
        left = " to ".join(str(timedelta(seconds=round(time))) for time in self.times)
        text = (
            f"{self.births} births of {each}: {format_bytes(least)} to {format_bytes(most)} of the "
            f"disk ({format_bytes(self.free)} free) and {left} more"
        )
        if self.last is None:
            return text
        return f"{text}; [stop] {self.stop} ends it by about generation {self.last}"

    @property
    def warning(self) -> str:
        """The advice if the disk may not hold the run; "" if it will."""
        needed = self.size if self.needed is None else self.needed
        most = needed if self.needed is not None else self.sizes[1]
        if most <= self.free:
            return ""
        may = "will" if needed > self.free else "may"
        return (
            f"the disk {may} not hold this run: about {format_bytes(needed)} are needed, at most "
            f"{format_bytes(most)}; {format_bytes(self.free)} are free. Free some space, or breed "
            "fewer generations; what is written stays readable"
        )


def describe_bound(folder: str | os.PathLike, recipe: Recipe) -> str:
    """Describe in one line what the run in ``folder`` takes at most, before its first
    generation."""
    births, most = largest_run(Path(folder, "sources"), recipe)
    free = shutil.disk_usage(folder).free
    return (
        f"{births} births, at most {format_bytes(most)} of the disk ({format_bytes(free)} free); "
        f"the first {recipe.generation_size} will tell how long it takes"
    )


def largest_run(sources: Path, recipe: Recipe) -> tuple[int, int]:
    """Return how many births a run has, and the bytes that they take at most: no genome is larger
    than those of its ``sources``, a file each in that folder; a thumbnail has a byte a cell."""
    sizes = [path.stat().st_size for path in sources.glob("*.genome.parquet")]
    births = recipe.generation_size * (recipe.run.generations + 1)
    side = recipe.map.pixels
    thumbnails = Thumbnails.of(side, side, 1.0)
    thumbnail = 0 if thumbnails is None else math.prod(thumbnails.shape(side, side))
    return births, births * (max(sizes, default=0) + thumbnail)


def first_representative(recipe: Recipe) -> int:
    """Return the first generation as large as the later ones: a log that omits genomes keeps all of
    generation 0, which all live on."""
    return 0 if recipe.log.genomes == "all" else 1


def estimate_of(
    folder: str | os.PathLike, recipe: Recipe, generation: Generation, clock: Clock = current_time
) -> Estimate | None:
    """Estimate the run in ``folder`` after its `first_representative` ``generation``, as if all
    later ones were as large. None before it, and after the last. ``clock`` returns the time."""
    count, planned, done = generation.births, recipe.run.generations, generation.number
    if planned <= done or done < first_representative(recipe) or not count:
        return None
    places, taken = Folder(Path(folder)), size_of(folder)
    each = sum(places.single(kind, done).stat().st_size for kind in (BIRTHS, MEMBERSHIP))
    ends = []
    if (allowed := recipe.stop.disk_bytes) is not None:
        last = done + max(0, (allowed - taken) // each)
        ends.append((last, f"disk = {format_bytes(allowed)}"))
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
