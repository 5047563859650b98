"""Two runs compared: their recipes, hypervolumes and archives."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.goals import overrides_of, recipe_of
from evocity.lazy_imports import frame_of, library
from evocity.selection.fronts import Hypervolume, not_dominated, volume_is_quick

if TYPE_CHECKING:
    import pandas as pd

# Generations whose hypervolume is computed, at most.
_MOST_GENERATIONS = 100
# Keys, and letters of a value, in a sentence.
_MOST_KEYS = 6
_LONGEST = 40


@dataclass(frozen=True)
class Side:
    """One of two runs: its ``name``, its births, and the ids of its archive."""

    name: str
    births: Births
    archive: np.ndarray


class Comparison:
    """Two runs compared; ``str()`` describes it in sentences. ``goals`` are those of both, with
    equal targets, weights and sources of measures; ``namesakes`` have other sources."""

    def __init__(self, first: Side, second: Side):
        self.first, self.second = first, second
        terms, other_terms = (_terms(side.births) for side in (first, second))
        both = [name for name in terms if terms[name] == other_terms.get(name)]
        names = {name: {term[0] for term in terms[name]} for name in both}
        sources, other_sources = (_sources(side.births) for side in (first, second))
        differ = {name for name, source in sources.items() if source != other_sources.get(name)}
        self.goals = tuple(name for name in both if not names[name] & differ)
        self.namesakes = tuple(name for name in both if names[name] & differ)

    @property
    def _sides(self) -> tuple[Side, Side]:
        return self.first, self.second

    @cached_property
    def differing(self) -> dict[str, tuple[str, str]]:
        """Key of the recipes -> the texts of both, where they differ."""
        first, second = (dict(_flat(_recipe(side.births))) for side in self._sides)
        keys = dict.fromkeys([*first, *second])
        pairs = {key: (first.get(key, ""), second.get(key, "")) for key in keys}
        return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}

    @property
    def recipes(self) -> "pd.DataFrame":
        """A row per key in which the recipes differ, index ``key``, with the texts of both."""
        names = [side.name for side in self._sides]
        return frame_of(list(self.differing.values()), list(self.differing), "key", names)

    def _losses(self, side: Side, rows: np.ndarray) -> np.ndarray:
        """By the common goals, of the births in ``rows``."""
        columns = [side.births.goals.index(name) for name in self.goals]
        return side.births.losses[rows][:, columns]

    @cached_property
    def _unit(self) -> Hypervolume | None:
        """Volume in units of the ranges of both first generations; None without a measured
        birth."""
        first = np.vstack([
            self._losses(side, np.flatnonzero(side.births.ok & (side.births.generation == 0)))
            for side in self._sides
        ])  # fmt: skip
        return Hypervolume(first) if len(first) else None

    def _volume(self, losses: np.ndarray) -> float:
        """The hypervolume of ``losses``; NaN without a unit, and where it would take minutes."""
        if self._unit is None or not volume_is_quick(*losses.shape):
            return math.nan
        return self._unit(losses) if len(losses) else 0.0

    @property
    def hypervolume(self) -> "pd.DataFrame":
        """A row per generation, of some of many, index ``generation``: the hypervolume of the
        living that keep the constraints, of each run, by the common goals and in units of the
        ranges of both first generations. NaN where no birth of these was measured, or it would take
        minutes."""
        pandas = library("pandas", "a comparison of hypervolumes")
        columns = {
            side.name: pandas.Series(self._volumes(side), dtype=float) for side in self._sides
        }
        table = pandas.DataFrame(columns).sort_index()
        table.index.name = "generation"
        return table

    def _volumes(self, side: Side) -> dict[int, float]:
        if not self.goals:
            return {}
        count = min(_MOST_GENERATIONS, side.births.last + 1)
        born, rows = side.births.lives
        volumes = {}
        for number in np.unique(np.linspace(0, side.births.last, count).round().astype(int)):
            living = rows[born == number]
            losses = self._losses(side, living[side.births.feasible[living]])
            volumes[int(number)] = self._volume(losses)
        return volumes

    @cached_property
    def _rows(self) -> list[dict[str, float]]:
        fronts = [self._losses(side, side.births.rows(side.archive)) for side in self._sides]
        together = not_dominated(np.vstack(fronts)) if self.goals else np.zeros(0, bool)
        rows = []
        for number, (side, front) in enumerate(zip(self._sides, fronts, strict=True)):
            row: dict[str, float] = {"births": len(side.births), "archive": len(side.archive)}
            if self.goals:
                own = together[len(fronts[0]) :] if number else together[: len(fronts[0])]
                row["joint"] = int(own.sum())
                row["dominated"] = int(_dominated(front, fronts[1 - number]).sum())
                row["hypervolume"] = self._volume(front)
            rows.append(row)
        return rows

    @property
    def fronts(self) -> "pd.DataFrame":
        """A row per run: its births and the size of its archive. By the common goals: ``joint``,
        how many of them are in the archive of both together, of equal ones the first run's;
        ``dominated``, how many an individual of the other archive dominates; and their
        ``hypervolume``."""
        return frame_of(self._rows, [side.name for side in self._sides], "run")

    def __str__(self) -> str:
        one, other = self._sides
        first, second = self._rows
        lines = [
            f"{side.name} has {row['births']} births, {row['archive']} of them in its archive."
            for side, row in zip(self._sides, self._rows, strict=True)
        ]
        if not self.goals:
            lines.append("They have no goal in common, so neither run is better.")
        else:
            lines += [
                f"By the common goals, {', '.join(self.goals)}: the archive of {other.name} "
                f"dominates {first['dominated']} of {one.name}; that of {one.name} dominates "
                f"{second['dominated']} of {other.name}."
            ]
            if not math.isnan(first["hypervolume"] + second["hypervolume"]):
                lines.append(
                    "The hypervolumes of the archives, in the same unit, are "
                    f"{one.name} {first['hypervolume']:.4g}, "
                    f"{other.name} {second['hypervolume']:.4g}."
                )
        if self.namesakes:
            names = ", ".join(self.namesakes)
            lines.append(f"These goals have one name and different sources: {names}.")
        keys = [
            f"{key} {_short(a) or 'unset'} / {_short(b) or 'unset'}"
            for key, (a, b) in self.differing.items()
        ]
        more = f"; and {len(keys) - _MOST_KEYS} more" if len(keys) > _MOST_KEYS else ""
        listed = "; ".join(keys[:_MOST_KEYS]) + more
        lines.append(f"Their recipes differ: {listed}." if keys else "Their recipes are the same.")
        return "\n".join(lines)


def compare(run: Any, other: Any) -> Comparison:
    """Compare two open runs, named by their folders, by their paths if these are the same."""
    names = [run.name, other.name]
    if names[0] == names[1]:
        names = [str(run.path), str(other.path)]
    if names[0] == names[1]:
        names[1] += " (2)"
    sides = zip(names, (run, other), strict=True)
    return Comparison(*(Side(name, one.columns, one.archive.ids) for name, one in sides))


def _terms(births: Births) -> dict[str, list[tuple]]:
    """Goal -> its measures, each with goal, target and weight."""
    terms: dict[str, list[tuple]] = {}
    for one in births.weighted_aims.wanted:
        if one.objective is not None:
            name, wanted = one.measure.name, one.objective
            goal = "target" if wanted.target is not None else wanted.goal
            terms.setdefault(one.total or name, []).append((name, goal, wanted.target, one.weight))
    return terms


def _sources(births: Births) -> dict[str, tuple]:
    """Measure -> hash of its file, its reference cities, its part of the map."""
    maps = _hashes(births, "maps") | _hashes(births, "references")
    masks = _hashes(births, "within")
    sources = {}
    for one in births.run.provenance["fitness"]:  # it names each, see `aims_of_run`
        place = PurePosixPath(str(one.get("file")))
        ours = "kept" not in one and place.parts[-3:-1] == ("evocity", "fitness")
        cities = one.get("reference")
        if isinstance(cities, Mapping):  # names and hashes of files
            cities = [maps.get(name) or hashed or name for name, hashed in cities.items()]
        elif cities is not None:  # the parents
            cities = list(_hashes(births, "maps").values())
        part = str(one.get("within"))
        source = None if ours else one.get("hash")
        sources[one["name"]] = source, cities, masks.get(part, part)
    return sources


def _hashes(births: Births, key: str) -> dict[str, object]:
    """Name -> hash of the entries of provenance under a ``key``."""
    listed = births.run.provenance.get(key)
    tables = [one for one in listed if isinstance(one, Mapping)] if isinstance(listed, list) else []
    return {str(one.get("name")): one.get("hash") for one in tables}


def _dominated(front: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which of a ``front`` (n, goals) one of the ``others`` dominates, bool."""
    dominated = np.zeros(len(front), bool)
    for one in others:
        dominated |= (one <= front).all(axis=1) & (one < front).any(axis=1)
    return dominated


def _recipe(births: Births) -> dict:
    recipe = recipe_of(births.run)
    for key, value in overrides_of(births.run).items():
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
