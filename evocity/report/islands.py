"""The islands of a run, as a report tells them: how good each is, who lives where, who moved."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from evocity.report.facts import Facts, figures_told


@dataclass(frozen=True)
class Islands:
    """What the report tells of the islands of a run, by its ``facts``.

    Nothing that a stranger's run states is taken for granted: what is not told as evocity tells
    it is left out.
    """

    facts: Facts

    @property
    def names(self) -> tuple[str, ...]:
        return self.facts.run.header.islands

    @cached_property
    def _homes(self) -> dict[int, str]:
        """Where each birth was born."""
        told = self.facts.told
        return dict(zip(told.ids.tolist(), told.island.tolist(), strict=True))

    @property
    def settings(self) -> list[tuple[str, str, str, str]]:
        """Of each island its name, algorithm, operators with their weights, and goals."""
        found = []
        for name in self.names:
            noted = self.facts.told.islands_noted.get(name, {})
            search, measures = noted.get("search"), noted.get("measures")
            algorithm = search.get("algorithm") if isinstance(search, Mapping) else None
            goals = ", ".join(map(str, measures)) if isinstance(measures, list) else "all"
            found.append((name, str(algorithm or "?"), _weights(noted.get("operators")), goals))
        return found

    @property
    def figures(self) -> list[tuple[str, str, int, int, int, str]]:
        """Of each island its name, hypervolume by its own goals, how many were born there, live
        there, live there and were born elsewhere, and what its algorithm tells."""
        born = Counter(self._homes.values())
        last = self.facts.told.history[-1].get("islands", {}) if self.facts.told.history else {}
        found = []
        for name in self.names:
            told, here = last.get(name, {}), self._lived.get(name, [])
            others = sum(self._homes.get(one, name) != name for one in here)
            volume = told.get("hypervolume")
            figures = ", ".join(f"{n} {v}" for n, v in figures_told(told.get("algorithm", {})))
            found.append(
                (
                    name,
                    "–" if volume is None else f"{volume:.4g}",
                    born[name],
                    len(here),
                    others,
                    figures,
                )
            )
        return found

    @cached_property
    def _lived(self) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {}
        for row in self.facts.lived:
            found.setdefault(row["island"], []).append(row["id"])
        return found

    @property
    def homes(self) -> list[tuple[str, list[int]]]:
        """Of each island its name, and how many who live there were born on each."""
        found = []
        for name in self.names:
            born = Counter(self._homes.get(one) for one in self._lived.get(name, []))
            found.append((name, [born[other] for other in self.names]))
        return found

    @property
    def volumes(self) -> list[tuple[str, list[float | None]]]:
        """Of each island its name, and its hypervolume in each generation."""
        history = self.facts.told.history
        return [
            (name, [one.get("islands", {}).get(name, {}).get("hypervolume") for one in history])
            for name in self.names
        ]

    @cached_property
    def moves(self) -> list[tuple[str, str, int, int]]:
        """(from, to, how many were sent, how many lived there after), of all migrations."""
        latest: dict[int, list] = {}  # one that was stopped before it was written tells twice
        for event in self.facts.run.events():
            generation, told = event.get("generation"), event.get("moves")
            whole = isinstance(generation, int) and generation <= self.facts.told.last
            if event.get("event") == "migration" and whole and isinstance(told, list):
                latest[generation] = [one for one in told if isinstance(one, Mapping)]
        sent: Counter = Counter()
        stayed: Counter = Counter()
        for one in (one for told in latest.values() for one in told):
            pair = str(one.get("from")), str(one.get("to"))
            sent[pair] += _count(one.get("ids"))
            stayed[pair] += _count(one.get("stayed"))
        return [(*pair, count, stayed[pair]) for pair, count in sent.items()]


def _count(told) -> int:
    return len(told) if isinstance(told, list) else 0


def _weights(operators) -> str:
    """A mixture in words: "region_fusion 3, mutation 1"."""
    if not isinstance(operators, Mapping):
        return "?"
    told = []
    for name, entry in operators.items():
        weight = entry.get("weight", 1) if isinstance(entry, Mapping) else entry
        told.append(f"{name} {weight:g}" if isinstance(weight, int | float) else str(name))
    return ", ".join(told)


__all__ = ["Islands"]
