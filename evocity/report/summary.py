"""What stands at the head of the report: which cities, how far the run is, its figures."""

from collections.abc import Iterator
from dataclasses import dataclass

from evocity.genome import VOID
from evocity.pages import number
from evocity.report.facts import Facts, figures_told
from evocity.report.failing import differing_told, failures, shortened


@dataclass(frozen=True)
class Figure:
    """``label`` and value of a figure, a ``note`` fainter beside it; ``word``: what of it is
    explained, see `evocity.report.words`."""

    label: str
    value: object
    note: str = ""
    word: str = ""


@dataclass(frozen=True)
class Summary:
    """Values for the head of the page."""

    facts: Facts

    @property
    def cities(self) -> str:
        return " × ".join(name for name in self.facts.run.header.cities if name != VOID)

    @property
    def sides(self) -> str:
        """The sides of the range blocks of the sources' codes, px; "" where there are none."""
        fabric = self.facts.run.header.chromosome.fabric
        pavements = [one.pavement for s in self.facts.sources if (one := fabric(s.genome))]
        if not pavements:
            return ""
        sides = {side for pavement in pavements for side in (pavement.finest, pavement.coarsest)}
        return " to ".join(str(side) for side in sorted({min(sides), max(sides)})) or "?"

    @property
    def state(self) -> list[str]:
        """Sentences of what is unusual: the run is not finished, births differ when replayed."""
        status, told = self.facts.run.status(), []
        if not status["finished"]:
            why = f" (stopped: {status['stopped']})" if status["stopped"] else ""
            told.append(f"The run is not finished{why}: all here is whole.")
        unsteady = differing_told(self.facts.run)
        return [*told, f"{unsteady}."] if unsteady else told

    @property
    def figures(self) -> Iterator[Figure]:
        facts = self.facts
        status, many = facts.run.status(), len(facts.members)
        yield Figure("generations", status["generation"], word="generation")
        yield Figure("births", status["births"], word="birth")
        yield Figure("failed", status["failures"], reasons(facts))
        yield Figure("on the front", f"{len(facts.front)} of {many}", word="front")
        if facts.broken:
            broken = f"{len(facts.broken)} of {many}"
            yield Figure("break a constraint", broken, word="constraint")
        if facts.archive is not None:
            yield Figure("in the archive", len(facts.archive), word="archive")
        volume = number(status["hypervolume"])
        yield Figure("hypervolume", volume, gain(facts), "hypervolume")
        for name, shown in figures_told(status["algorithm"]):
            yield Figure(name, shown, word=name)
        yield Figure("seed", facts.run.header.seed, word="seed")


def reasons(facts: Facts) -> str:
    """Why births failed, in words."""
    kinds = failures(facts.run)
    return "; ".join(f"{kind.count} {kind.status}: {shortened(kind.error, 60)}" for kind in kinds)


def gain(facts: Facts) -> str:
    """How far the hypervolume is above that of the first population."""
    volumes = [about.get("hypervolume") for about in facts.told.history]
    if len(volumes) < 2 or volumes[0] is None or volumes[-1] is None:
        return ""
    first = facts.told.feasible[facts.told.generation == 0]
    if volumes[0] <= 0 or volumes[0] < 0.01 * volumes[-1] or 2 * first.sum() < len(first):
        # a share of next to nothing, or of a few that happened to live, tells nothing
        return f"{number(volumes[0])} in the first population"
    return f"{volumes[-1] / volumes[0] - 1:+.0%} over the first population"


__all__ = ["Figure", "Summary", "gain", "reasons"]
