"""The islands of a run: how good each is, which individuals live where, which migrated."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from evocity.analysis.goals import figure_texts


@dataclass(frozen=True)
class Islands:
    """The islands of a ``run`` as its page shows them."""

    run: Any

    @property
    def names(self) -> tuple[str, ...]:
        return self.run.header.islands

    @cached_property
    def _home_of(self) -> dict[int, str]:
        births = self.run.columns
        return dict(zip(births.ids.tolist(), births.island.tolist(), strict=True))

    @property
    def settings(self) -> list[tuple[str, str, str, str]]:
        """Of each island its name, algorithm, operators with their weights, and goals."""
        rows = []
        for name in self.names:
            noted = self.run.columns.island_settings.get(name, {})
            search, measures = noted.get("search"), noted.get("measures")
            algorithm = search.get("algorithm") if isinstance(search, Mapping) else None
            goals = ", ".join(map(str, measures)) if isinstance(measures, list) else "all"
            rows.append((name, str(algorithm or "?"), _weights(noted.get("operators")), goals))
        return rows

    @property
    def figures(self) -> list[tuple[str, str, int, int, int, str]]:
        """Of each island name, hypervolume, born and living there, born elsewhere, algorithm's
        figures."""
        born, history = Counter(self._home_of.values()), self.run.columns.history
        last = history[-1].get("islands", {}) if history else {}
        rows = []
        for name in self.names:
            summary, here = last.get(name, {}), self._living.get(name, [])
            others = sum(self._home_of.get(one, name) != name for one in here)
            volume = summary.get("hypervolume")
            volume = "–" if volume is None else f"{volume:.4g}"
            figures = ", ".join(f"{n} {v}" for n, v in figure_texts(summary.get("algorithm", {})))
            rows.append((name, volume, born[name], len(here), others, figures))
        return rows

    @cached_property
    def _living(self) -> dict[str, list[int]]:
        """Island -> ids of those that live there in the last generation."""
        members = self.run.members(self.run.columns.last).select(["id", "island"]).to_pylist()
        living: dict[str, list[int]] = {}
        for row in members:
            living.setdefault(row["island"], []).append(row["id"])
        return living

    @property
    def homes(self) -> list[tuple[str, list[int]]]:
        """Of each island its name, and how many of its living were born on each island."""
        rows = []
        for name in self.names:
            born = Counter(self._home_of.get(one) for one in self._living.get(name, []))
            rows.append((name, [born[other] for other in self.names]))
        return rows

    @cached_property
    def moves(self) -> list[tuple[str, str, int, int]]:
        """(from, to, how many were sent, how many of them survived) of all migrations."""
        latest: dict[int, list] = {}  # a generation bred twice states its migration twice
        for event in self.run.events():
            generation, moves = event.get("generation"), event.get("moves")
            whole = isinstance(generation, int) and generation <= self.run.columns.last
            if event.get("event") == "migration" and whole and isinstance(moves, list):
                latest[generation] = [one for one in moves if isinstance(one, Mapping)]
        sent: Counter = Counter()
        stayed: Counter = Counter()
        for one in (one for moves in latest.values() for one in moves):
            pair = str(one.get("from")), str(one.get("to"))
            sent[pair] += _count(one.get("ids"))
            stayed[pair] += _count(one.get("stayed"))
        return [(*pair, count, stayed[pair]) for pair, count in sent.items()]


def tables_of_islands(run: Any) -> list[tuple]:
    """Return title, headings, rows and a note of the tables about islands; none for a run without
    islands."""
    islands = Islands(run)
    if not islands.names:
        return []
    figures = ("hypervolume, by its goals", "born there", "living", "of them from elsewhere")
    born = [f"born on {name}" for name in islands.names]
    homes = [(name, *counts) for name, counts in islands.homes]
    moves = ("from", "to", "sent", "survived there")
    return [
        ("islands", ("island", "algorithm", "operators", "goals"), islands.settings),
        (
            "figures of islands",
            ("island", *figures, "figures of the algorithm"),
            islands.figures,
        ),
        ("homes of the living", ("living on", *born), homes),
        ("migrations", moves, islands.moves, "" if islands.moves else "No individual migrated."),
    ]


def _count(ids) -> int:
    return len(ids) if isinstance(ids, list) else 0


def _weights(operators) -> str:
    """Describe a mixture in words: "region_fusion 3, mutation 1"."""
    if not isinstance(operators, Mapping):
        return "?"
    parts = []
    for name, entry in operators.items():
        weight = entry.get("weight", 1) if isinstance(entry, Mapping) else entry
        parts.append(f"{name} {weight:g}" if isinstance(weight, int | float) else str(name))
    return ", ".join(parts)
