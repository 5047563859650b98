"""Islands in a recipe: populations with their own operators, goals or algorithms.

`evocity.search.breeding.archipelago` breeds them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from evocity.errors import add_near_miss, is_number, is_whole, spell
from evocity.fitness import Aims, Measure
from evocity.recipe.mixture import OperatorEntry, entry_table
from evocity.recipe.search_section import AlgorithmName, SearchSection
from evocity.recipe.sections import RunSection
from evocity.recipe.values import Title
from evocity.section import Fault, Section
from evocity.selection.algorithms import algorithms

#: The most islands of one search.
MOST_ISLANDS = 256
# The smallest population of an island.
_FEWEST = RunSection.model_fields["population"].metadata[0].ge


class IslandSection(BaseModel):
    """``[[islands]]``: a population of its own.

    ``population``: births of each generation, and the most that live. ``operators``: the mixture;
    an entry takes missing keys from ``[operators]``. ``measures``: the goals of the recipe that
    this island pursues, by default all. ``weights``: of measures in a sum. ``algorithm`` and its
    keys: by default those of ``[search]``.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    name: Title | None = None
    population: int | None = Field(None, ge=_FEWEST, le=1_000_000)
    operators: dict[str, Annotated[OperatorEntry, BeforeValidator(entry_table)]] | None = Field(
        None, min_length=1
    )
    measures: list[str] | None = Field(None, min_length=1)
    weights: dict[str, Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]] | None = None
    algorithm: AlgorithmName | None = None

    def search_of(self, search: SearchSection) -> SearchSection:
        """Make the search section of this island, in a recipe with this ``search``."""
        own = dict(self.model_extra or {})
        if self.algorithm in (None, search.algorithm):
            own = (search.model_extra or {}) | own
        keys = ("picks", "adapt", "credit", "mates", "redraws", "steer")
        shared = {key: getattr(search, key) for key in keys}
        return SearchSection(**own | shared | {"algorithm": self.algorithm or search.algorithm})

    def operators_of(self, operators: Mapping[str, OperatorEntry]) -> dict[str, OperatorEntry]:
        """Make the mixture of this island, in a recipe with these ``operators``."""
        if self.operators is None:
            return dict(operators)
        return {
            name: OperatorEntry(
                **(operators[name].model_dump(exclude_unset=True) if name in operators else {})
                | entry.model_dump(exclude_unset=True)
            )
            for name, entry in self.operators.items()
        }

    def aims_of(self, aims: Aims) -> Aims:
        """Narrow the ``aims`` of the run to this island: its goals, with its weights, and all
        constraints."""
        if self.measures is not None:
            narrowed = (
                one
                if one.objective is None or self.pursues(one.measure, one.total)
                else replace(one, objective=None, total=None)
                for one in aims.wanted
            )
            aims = Aims(tuple(one for one in narrowed if one.objective or one.constraint))
        return aims.reweighted(self.weights or {})

    def pursues(self, measure: Measure, total: str | None) -> bool:
        """Whether a ``measure``, or the sum ``total`` that it counts in, is a goal here."""
        return self.measures is None or bool({measure.name, total} & set(self.measures))


class MigrationSection(Section):
    """``[migration]``: every so many generations the ``migrants`` best of each island also enter
    its neighbours: the next island (``ring``), or all others (``complete``)."""

    along: Literal["ring", "complete", "none"] = "ring"
    every: int = Field(10, ge=1, le=99_999_999)
    migrants: int = Field(2, ge=1, le=1_000_000)

    def neighbours(self, count: int) -> list[tuple[int, int]]:
        """List the pairs (giver, taker) among ``count`` islands, by their numbers."""
        pairs = [(one, (one + turn) % count) for one in range(count) for turn in range(1, count)]
        kept = {"ring": pairs[:: max(1, count - 1)], "complete": pairs, "none": []}
        return kept[self.along]


# -- tables of TOML, before they are validated ---------------------------------------------------


def island_tables(raw: Mapping) -> list[dict]:
    """Return the tables of ``[[islands]]``; none if they are malformed."""
    islands = raw.get("islands")
    valid = isinstance(islands, list) and all(isinstance(table, dict) for table in islands)
    return islands if valid else []


def fill_islands(raw: dict, noted: list[Mapping] | None = None) -> list[Fault]:
    """Write missing names and populations into the islands of ``raw``, and return faults of the
    populations. ``noted``: the islands of the run, if it is resumed."""
    islands = island_tables(raw)
    for number, table in enumerate(islands):
        for key, value in (noted[number] if noted and number < len(noted) else {}).items():
            table.setdefault(key, value)
        table.setdefault("name", f"island-{number + 1}")
    run = raw.setdefault("run", {}) if islands else None
    given = [table["population"] for table in islands if "population" in table]
    if not isinstance(run, dict) or not all(map(is_whole, given)):
        return []
    missing = [table for table in islands if "population" not in table]
    if not missing:
        whole = run.setdefault("population", sum(given))
        if not is_whole(whole) or whole == sum(given):
            return []
        allowed = f"{sum(given)}, the sum of the islands' populations; or leave it out"
        return [("run.population", spell(whole), allowed)]
    whole = run.get("population", RunSection.model_fields["population"].default)
    if not is_whole(whole):
        return []
    rest = whole - sum(given)
    for number, table in enumerate(missing):
        table["population"] = max(_FEWEST, rest // len(missing) + (number < rest % len(missing)))
    if rest >= _FEWEST * len(missing):
        return []
    least, found = sum(given) + _FEWEST * len(missing), f"{whole} on {len(islands)} islands"
    allowed = f"{least} or more, {_FEWEST} on each island that has no population of its own"
    return [("run.population", found, allowed)]


def merged_operators(raw: Mapping, usual: Mapping[str, Any]) -> list[tuple[str, dict]]:
    """Merge the islands' own mixtures with ``[operators]``, or with the ``usual`` one; returns
    (key, entries) of each."""
    base = raw.get("operators", usual)
    base = base if isinstance(base, dict) else {}

    def table(value: Any) -> Any:
        return {"weight": value} if is_number(value) else value

    merged = []
    for number, island in enumerate(island_tables(raw)):
        entries = island.get("operators")
        if not isinstance(entries, dict):
            continue
        whole = {}
        for name, value in entries.items():
            below, above = table(base.get(name, {})), table(value)
            both = isinstance(below, dict) and isinstance(above, dict)
            whole[name] = below | above if both else value
        merged.append((f"islands[{number}].", whole))
    return merged


def algorithm_keys(raw: Mapping, default: str) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """Yield, for each island with a known algorithm, its number, the algorithm and the given keys
    of this algorithm; ``default``: the algorithm of a recipe that names none."""
    search = raw.get("search", {})
    search = search if isinstance(search, dict) else {}
    usual = search.get("algorithm", default)
    for number, island in enumerate(island_tables(raw)):
        name = island.get("algorithm", usual)
        if not isinstance(name, str) or name not in algorithms():
            continue
        own = {key: value for key, value in island.items() if key not in IslandSection.model_fields}
        if name == usual:
            own = {k: v for k, v in search.items() if k not in SearchSection.model_fields} | own
        yield number, name, own


def on_island(key: str, number: int) -> str:
    """Return the ``key`` of a fault of ``[search]`` as the key of an island."""
    return key.replace("search.", f"islands[{number}].", 1) if key.startswith("search.") else key


# -- faults of a validated recipe ----------------------------------------------------------------


def island_faults(recipe: Any) -> Iterator[Fault]:
    """Yield the faults of islands and migration, of a `Recipe` whose keys are valid each by
    itself."""
    islands, migration = recipe.islands, recipe.migration
    if not islands:
        if migration.model_fields_set:
            yield "migration", "without islands", "[[islands]], two or more"
        return
    names, sizes = [one.name for one in islands], [one.population for one in islands]
    for number, name in enumerate(names):
        if name in names[:number]:
            yield f"islands[{number}].name", f"{spell(name)} twice", "another name"
    if migration.along != "none" and migration.migrants > min(sizes):
        smallest = spell(names[sizes.index(min(sizes))])
        allowed = f"{min(sizes)} or fewer, the population of {smallest}, the smallest island"
        yield "migration.migrants", str(migration.migrants), allowed
    if recipe.search.window is not None:
        found = f"{recipe.search.window}, with {len(islands)} islands"
        yield "search.window", found, "no window: islands breed whole generations"
    yield from _closed_faults("search.algorithm", recipe.search.algorithm)
    goals = [
        (measure, entry.total)
        for entry in recipe.fitness
        if entry.is_objective
        for measure in entry.measures
    ]
    for number, (island, own) in enumerate(zip(islands, recipe.local, strict=True)):
        key = f"islands[{number}]"
        yield from _goal_faults(island, key, goals)
        if island.algorithm is not None:
            yield from _closed_faults(f"{key}.algorithm", island.algorithm)
        pursued = {total or one.name for one, total in goals if island.pursues(one, total)}
        faults = own.search.faults(len(pursued), island.population, len(recipe.parents))
        yield from ((on_island(place, number), *rest) for place, *rest in faults)


def _goal_faults(
    island: IslandSection, key: str, goals: list[tuple[Measure, str | None]]
) -> Iterator[Fault]:
    known = list(dict.fromkeys([*(m.name for m, _ in goals), *(t for _, t in goals if t)]))
    listed = island.measures or []
    for name in dict.fromkeys(listed):
        if name not in known:
            found = add_near_miss(f"{spell(name)}, which is not a goal of the recipe", name, known)
            yield f"{key}.measures", found, f"some of its goals: {', '.join(known)}"
    for name in dict.fromkeys(listed):
        if listed.count(name) > 1:
            yield f"{key}.measures", f"{spell(name)} twice", "each goal once"
    summed = [m.name for m, total in goals if total is not None and island.pursues(m, total)]
    for name in island.weights or {}:
        if name not in summed:
            found = add_near_miss(f"{spell(name)}, which is in no sum here", name, summed)
            allowed = ", ".join(summed) or "no weights: no goal of this island is a sum"
            yield f"{key}.weights", found, allowed


def _closed_faults(key: str, algorithm: str) -> Iterator[Fault]:
    """Yield the fault of an algorithm that takes no migrants."""
    closed = [name for name, kind in algorithms().items() if kind.breeds_by or kind.replays]
    if algorithm in closed:
        found = f"{spell(algorithm)}, which breeds by itself: it takes no migrants from an island"
        others = [spell(name) for name in algorithms() if name not in closed]
        yield key, found, f"with islands {' or '.join(others)}"
