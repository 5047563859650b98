"""Two runs beside each other: what they were told, and who found what the other did not."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.extras import library
from evocity.analysis.wanted import overrides_of, recipe_of
from evocity.search.fronts import Hypervolume, not_dominated, volume_is_quick

if TYPE_CHECKING:
    import pandas as pd

# Generations whose hypervolume is reckoned, at most.
_MOST_GENERATIONS = 100
# Keys in words.
_MOST_KEYS = 6
_LONGEST = 40


@dataclass(frozen=True)
class Side:
    """One of two runs: its ``name``, its births, and the ids of its archive."""

    name: str
    told: Told
    archive: np.ndarray


class Comparison:
    """Two runs beside each other; ``run.compare(other)`` makes it. ``str()`` tells it in sentences;
    ``goals`` names those that both have, alike to the target, the weights and the source of each
    measure; ``namesakes`` those that are alike but for that: a file of another content, other
    cities to compare with, another part of the map."""

    def __init__(self, one: Side, other: Side):
        self.one, self.other = one, other
        terms, other_terms = (_terms(side.told) for side in (one, other))
        both = [name for name in terms if terms[name] == other_terms.get(name)]
        names = {name: {term[0] for term in terms[name]} for name in both}
        sources, other_sources = (_sources(side.told) for side in (one, other))
        differ = {name for name, told in sources.items() if told != other_sources.get(name)}
        self.goals = tuple(name for name in both if not names[name] & differ)
        self.namesakes = tuple(name for name in both if names[name] & differ)

    @property
    def _sides(self) -> tuple[Side, Side]:
        return self.one, self.other

    @cached_property
    def differing(self) -> dict[str, tuple[str, str]]:
        """Key of the recipes -> what each has under it, as text, where these differ."""
        first, second = (dict(_flat(_asked(side.told))) for side in self._sides)
        keys = dict.fromkeys([*first, *second])
        pairs = {key: (first.get(key, ""), second.get(key, "")) for key in keys}
        return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}

    @property
    def recipes(self) -> "pd.DataFrame":
        """A row a key in which the recipes differ, index ``key``: what each has there."""
        pandas = library("pandas", "a comparison of recipes")
        index = pandas.Index(list(self.differing), name="key")
        columns = [side.name for side in self._sides]
        return pandas.DataFrame(list(self.differing.values()), index, columns)

    def _losses(self, side: Side, rows: np.ndarray) -> np.ndarray:
        """By the goals of both, of the births in ``rows``."""
        columns = [side.told.goals.index(name) for name in self.goals]
        return side.told.losses[rows][:, columns]

    @cached_property
    def _unit(self) -> Hypervolume | None:
        """In units of the ranges of both first generations together; None if nobody in them was
        measured."""
        first = np.vstack([
            self._losses(side, np.flatnonzero(side.told.ok & (side.told.generation == 0)))
            for side in self._sides
        ])  # fmt: skip
        return Hypervolume(first) if len(first) else None

    def _volume(self, losses: np.ndarray) -> float:
        """What ``losses`` dominate together; NaN where there is no unit, and of so many that it
        would take minutes."""
        if self._unit is None or not volume_is_quick(*losses.shape):
            return math.nan
        return self._unit(losses) if len(losses) else 0.0

    @property
    def hypervolume(self) -> "pd.DataFrame":
        """A row a generation, of some of many, index ``generation``: hypervolume of the living that
        keep the constraints, of each run, by the goals of both and in units of the ranges of both
        first generations; NaN where nobody in these was measured, or it would take minutes."""
        pandas = library("pandas", "a comparison of hypervolumes")
        found = {side.name: pandas.Series(self._volumes(side), dtype=float) for side in self._sides}
        table = pandas.DataFrame(found).sort_index()
        table.index.name = "generation"
        return table

    def _volumes(self, side: Side) -> dict[int, float]:
        if not self.goals:
            return {}
        count = min(_MOST_GENERATIONS, side.told.last + 1)
        born, rows = side.told.lives
        found = {}
        for number in np.unique(np.linspace(0, side.told.last, count).round().astype(int)):
            living = rows[born == number]
            losses = self._losses(side, living[side.told.feasible[living]])
            found[int(number)] = self._volume(losses)
        return found

    @cached_property
    def _found(self) -> list[dict[str, float]]:
        fronts = [self._losses(side, side.told.rows(side.archive)) for side in self._sides]
        together = not_dominated(np.vstack(fronts)) if self.goals else np.zeros(0, bool)
        found = []
        for number, (side, front) in enumerate(zip(self._sides, fronts, strict=True)):
            row: dict[str, float] = {"births": len(side.told), "archive": len(side.archive)}
            if self.goals:
                own = together[len(fronts[0]) :] if number else together[: len(fronts[0])]
                row["joint"] = int(own.sum())
                row["dominated"] = int(_dominated(front, fronts[1 - number]).sum())
                row["hypervolume"] = self._volume(front)
            found.append(row)
        return found

    @property
    def fronts(self) -> "pd.DataFrame":
        """A row a run: its births; how many are in its archive; by the goals of both how many of
        these are in the archive of both together (``joint``; of equal ones the first run's alone),
        how many are ``dominated`` by one of the other's, and their ``hypervolume``."""
        pandas = library("pandas", "a comparison of archives")
        names = [side.name for side in self._sides]
        return pandas.DataFrame(self._found, pandas.Index(names, name="run"))

    def __str__(self) -> str:
        one, other = self._sides
        first, second = self._found
        lines = [
            f"{one.name}: {first['births']} births, {first['archive']} in its archive. "
            f"{other.name}: {second['births']} births, {second['archive']} in its archive."
        ]
        if not self.goals:
            lines.append("They have no goal in common, so neither is better than the other.")
        else:
            lines += [
                f"By what both want, {', '.join(self.goals)}: of the archive of {one.name} "
                f"{first['dominated']} are dominated by one of {other.name}, of that of "
                f"{other.name} {second['dominated']} by one of {one.name}.",
            ]
            if not math.isnan(first["hypervolume"] + second["hypervolume"]):
                lines.append(
                    "Hypervolume of the archives in one unit: "
                    f"{one.name} {first['hypervolume']:.4g}, "
                    f"{other.name} {second['hypervolume']:.4g}."
                )
        if self.namesakes:
            lines.append(
                f"Of one name, and measured otherwise in each: {', '.join(self.namesakes)}."
            )
        keys = [
            f"{key} {_short(a) or 'unset'} / {_short(b) or 'unset'}"
            for key, (a, b) in self.differing.items()
        ]
        more = f"; and {len(keys) - _MOST_KEYS} more" if len(keys) > _MOST_KEYS else ""
        told = "; ".join(keys[:_MOST_KEYS]) + more
        lines.append(f"Their recipes differ: {told}." if keys else "Their recipes are the same.")
        return "\n".join(lines)


def _terms(told: Told) -> dict[str, list[tuple]]:
    """Goal -> the measures it is made of, each with its goal, target and weight."""
    found: dict[str, list[tuple]] = {}
    for one in told.wanted.wanted:
        if one.objective is not None:
            name, wanted = one.measure.name, one.objective
            goal = "target" if wanted.target is not None else wanted.goal
            found.setdefault(one.total or name, []).append((name, goal, wanted.target, one.weight))
    return found


def _sources(told: Told) -> dict[str, tuple]:
    """Measure -> what it is besides its name: the hash of its source, unless it is evocity's own,
    which mean the same in all releases; the cities it compares with; the part of the map."""
    maps = _hashes(told, "maps") | _hashes(told, "references")
    masks = _hashes(told, "within")
    found = {}
    for one in told.run.provenance["fitness"]:  # which names each, see `aims_of_run`
        place = PurePosixPath(str(one.get("file")))
        ours = "kept" not in one and place.parts[-3:-1] == ("evocity", "fitness")
        cities = one.get("reference")
        if isinstance(cities, Mapping):  # names and hashes of files
            cities = [maps.get(name) or hashed or name for name, hashed in cities.items()]
        elif cities is not None:  # the parents
            cities = list(_hashes(told, "maps").values())
        part = str(one.get("within"))
        source = None if ours else one.get("hash")
        found[one["name"]] = source, cities, masks.get(part, part)
    return found


def _hashes(told: Told, key: str) -> dict[str, object]:
    """Name -> hash of what provenance lists under a ``key``."""
    listed = told.run.provenance.get(key)
    tables = [one for one in listed if isinstance(one, Mapping)] if isinstance(listed, list) else []
    return {str(one.get("name")): one.get("hash") for one in tables}


def _dominated(front: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Bool: which of a ``front`` (n, goals) one of the ``others`` dominates."""
    found = np.zeros(len(front), bool)
    for one in others:
        found |= (one <= front).all(axis=1) & (one < front).any(axis=1)
    return found


def _asked(told: Told) -> dict:
    """What the run's recipe says, with what replaced its values."""
    recipe = recipe_of(told.run)
    for key, value in overrides_of(told.run).items():
        section, _, name = str(key).partition(".")
        table = recipe.setdefault(section, {})
        if isinstance(table, dict):
            table[name] = value
    return recipe


def _flat(value: object, key: str = "") -> Iterator[tuple[str, str]]:
    """Keys of nested tables and lists, "parents.0.map", and their values as text."""
    if isinstance(value, Mapping):
        pairs = [(f"{key}.{name}" if key else str(name), one) for name, one in value.items()]
    elif isinstance(value, Sequence) and value and all(isinstance(one, Mapping) for one in value):
        pairs = [(f"{key}.{one.get('name', number)}", one) for number, one in enumerate(value)]
    else:
        yield key, str(value)
        return
    for name, one in pairs:
        yield from _flat(one, name)


def _short(text: str) -> str:
    plain = "".join(one if one.isprintable() else "\ufffd" for one in text)
    return plain if len(plain) <= _LONGEST else plain[: _LONGEST - 1] + "…"


__all__ = ["Comparison", "Side"]
