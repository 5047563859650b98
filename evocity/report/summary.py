"""The head of the report: the cities, the state of the run, its figures."""

from collections.abc import Iterator
from dataclasses import dataclass

from evocity.analysis.births import Births
from evocity.genome import VOID
from evocity.report.failed_births import differing_told, failures, shortened
from evocity.report.shown_births import ShownBirths, figure_texts
from evocity.store import RunLog
from evocity.templates import number


@dataclass(frozen=True)
class Figure:
    """A figure: ``label``, value, fainter ``note``, and the ``word`` of the glossary for it."""

    label: str
    value: object
    note: str = ""
    word: str = ""


@dataclass(frozen=True)
class Summary:
    shown: ShownBirths

    @property
    def cities(self) -> str:
        return " × ".join(name for name in self.shown.run.header.cities if name != VOID)

    @property
    def sides(self) -> str:
        """Sides of the range blocks of the sources' codes, px; "" where there are none."""
        fabric = self.shown.run.header.chromosome.fabric
        pavements = [one.pavement for s in self.shown.sources if (one := fabric(s.genome))]
        if not pavements:
            return ""
        sides = {side for pavement in pavements for side in (pavement.finest, pavement.coarsest)}
        return " to ".join(str(side) for side in sorted({min(sides), max(sides)})) or "?"

    @property
    def state(self) -> list[str]:
        """Sentences on what is unusual: the run is not finished, births differ when replayed."""
        status, sentences = self.shown.run.status(), []
        if not status["finished"]:
            why = f" (stopped: {status['stopped']})" if status["stopped"] else ""
            sentences.append(f"The run is not finished{why}. This page shows whole generations.")
        unsteady = differing_told(self.shown.run)
        return [*sentences, f"{unsteady}."] if unsteady else sentences

    @property
    def figures(self) -> Iterator[Figure]:
        shown, run = self.shown, self.shown.run
        status, many = run.status(), len(shown.living)
        yield Figure("generations", status["generation"], word="generation")
        yield Figure("births", status["births"], word="birth")
        yield Figure("failed", status["failures"], reasons(run))
        yield Figure("on the front", f"{len(shown.births.front)} of {many}", word="front")
        if shown.broken:
            broken = f"{len(shown.broken)} of {many}"
            yield Figure("break a constraint", broken, word="constraint")
        if shown.archive is not None:
            yield Figure("in the archive", len(shown.archive), word="archive")
        volume = number(status["hypervolume"])
        yield Figure("hypervolume", volume, gain(shown.births), "hypervolume")
        for name, text in figure_texts(status["algorithm"]):
            yield Figure(name, text, word=name)
        yield Figure("seed", run.header.seed, word="seed")


def reasons(run: RunLog) -> str:
    """Return in words why births failed."""
    kinds = failures(run)
    return "; ".join(f"{kind.count} {kind.status}: {shortened(kind.error, 60)}" for kind in kinds)


def gain(births: Births) -> str:
    """Return in words how far the hypervolume is above the first population's."""
    volumes = [about.get("hypervolume") for about in births.history]
    if len(volumes) < 2 or volumes[0] is None or volumes[-1] is None:
        return ""
    first = births.feasible[births.generation == 0]
    if volumes[0] <= 0 or volumes[0] < 0.01 * volumes[-1] or 2 * first.sum() < len(first):
        # a share of next to nothing, or of a few that happened to survive, means nothing
        return f"{number(volumes[0])} in the first population"
    return f"{volumes[-1] / volumes[0] - 1:+.0%} over the first population"
