"""What is wrong with a recipe: all its faults at once, each with its key and what is allowed."""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import tomli_w
from pydantic import BaseModel, ValidationError

from evocity import fitness
from evocity.errors import RecipeError, shown, with_near_miss
from evocity.fitness import Measure
from evocity.kinds import KINDS
from evocity.search.agreement import across_sections
from evocity.search.algorithms import DEFAULT, algorithms
from evocity.search.forming import of_kind
from evocity.search.islands import (
    IslandSection,
    faults_of_islands,
    fill_islands,
    islands_in,
    keys_of_islands,
    on_island,
)
from evocity.search.searching import SearchSection, sound_keys
from evocity.search.sections import Parent
from evocity.search.values import parent_place, parent_title
from evocity.search.wanted import FitnessEntry, MeasureEntry


def fill(recipe: BaseModel, sections: Mapping[str, Any], folder: Path) -> None:
    """Make the new ``recipe`` one of these ``sections``, as `Recipe` says."""
    raw = _plain(sections, ())
    try:
        text = tomli_w.dumps(raw)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecipeError(
            f"a recipe that TOML cannot hold ({error})",
            "texts, numbers, true or false, and lists and mappings of them",
            "leave a key out where it has no value",
        ) from None
    check(recipe, tomllib.loads(text), text, folder, {}, "the recipe")


def _plain(value: Any, place: tuple[str, ...]) -> Any:
    """A ``value`` at a ``place`` of a recipe as TOML has it."""
    listed = {("parents",): "map", ("fitness",): "name"}.get(place)
    if isinstance(value, Mapping):
        told = ((str(key), one) for key, one in value.items() if one is not None)
        return {key: _plain(one, (*place, key)) for key, one in told}
    if place[-2:-1] == ("operators",) and isinstance(value, int | float):
        return {"weight": value}  # in TOML tables come last, and the order of operators counts
    if isinstance(value, Measure):
        return value.name
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        told = [_plain(one, (*place, "")) for one in value]
        return [{listed: one} if listed and isinstance(one, str) else one for one in told]
    return value


def check(
    recipe: BaseModel,
    raw: dict,
    text: str,
    folder: Path,
    overrides: Mapping[str, Any],
    name: str,
    kept: Mapping[str, str] | None = None,
    defaults: Mapping[str, Any] | None = None,
) -> None:
    """Make the new ``recipe`` what ``raw``, the content of its ``text``, says; the rest as
    `evocity.search.reading.recipe_of` has it. Raises `RecipeError`."""
    for key, value in overrides.items():
        section, entry = key.split(".")
        if isinstance(raw.setdefault(section, {}), dict):
            raw[section][entry] = value
    for key, value in (defaults or {}).items():
        if key == "islands":  # each has its own, see below
            continue
        section, _, entry = key.partition(".")
        if not entry:
            raw.setdefault(section, value)
        elif isinstance(raw.setdefault(section, {}), dict):
            raw[section].setdefault(entry, value)
    kind = _kind_of(raw)
    if kind != "fabric":
        raw.setdefault("operators", {name: dict(one) for name, one in KINDS[kind].usual.items()})
    shared, sound = fill_islands(raw, (defaults or {}).get("islands")), False
    faults: list[tuple[str, str, str]] = []
    try:
        context = {"folder": folder, "parents": _parents(raw), "kept": kept}
        type(recipe).__pydantic_validator__.validate_python(
            raw, context=context, self_instance=recipe
        )
        sound = True
    except ValidationError as error:
        told = error.errors(include_url=False)
        faults = [_with_measure(_fault(one, raw, type(recipe)), one["loc"], raw) for one in told]
    faults += shared + across_sections(raw) + _of_search(raw, type(recipe))
    faults += _of_islands(raw, type(recipe))
    if sound:
        faults += _repeated(recipe) + of_kind(recipe)
        if recipe.run.population < len(recipe.parents):
            allowed = f"{len(recipe.parents)} or more, one for each of the parents"
            faults.append(("run.population", str(recipe.run.population), allowed))
        faults += faults_of_islands(recipe)
        if not recipe.islands:
            told = len(recipe.goals), recipe.run.population, len(recipe.parents)
            faults += recipe.search.faults(*told)
        faults += _undescribed(recipe) + _of_refine(recipe) + _of_stop(recipe)
    if faults:
        allowances: dict[tuple[str, str], list[str]] = {}
        for key, found, allowed in faults:  # a key may allow this or that
            allowances.setdefault((key, found), []).append(allowed)
        listed = [
            f"{key}: {found}; allowed: {' or '.join(dict.fromkeys(allowed))}"
            for (key, found), allowed in allowances.items()
        ]
        raise RecipeError(
            f"{name} has {len(listed)} fault{'s' if len(listed) > 1 else ''}:\n  "
            + "\n  ".join(listed),
            "a recipe without faults; what is allowed stands behind each",
            "correct these keys",
        )
    recipe._text, recipe._folder, recipe._overrides = text, folder, dict(overrides)


def _kind_of(raw: Mapping) -> str:
    """What is bred, by ``raw``; "fabric" where it does not tell."""
    section = raw.get("run", {})
    kind = section.get("kind") if isinstance(section, dict) else None
    return kind if isinstance(kind, str) and kind in KINDS else "fabric"


def _of_search(raw: Mapping, recipe: type[BaseModel]) -> list[tuple[str, str, str]]:
    """Faults of the keys of the algorithm that ``[search]`` names, if it is known."""
    section = raw.get("search", {})
    name = section.get("algorithm", DEFAULT) if isinstance(section, dict) else None
    kind = algorithms().get(name) if isinstance(name, str) else None
    if kind is None:
        return []
    own = {k: v for k, v in section.items() if k not in SearchSection.model_fields}
    keys, errors = sound_keys(kind, own)
    faults = [_fault({**one, "loc": ("search", *one["loc"])}, raw, recipe) for one in errors]
    if keys is None or any(one["loc"][:1] == ("descriptors",) for one in errors):
        return faults  # what the others have to agree with is not known
    return faults + keys.disagreements()


def _of_islands(raw: Mapping, recipe: type[BaseModel]) -> list[tuple[str, str, str]]:
    """Faults of the keys of the islands' algorithms, as far as these are known."""
    faults = []
    for number, algorithm, given in keys_of_islands(raw, DEFAULT):
        own, kind = islands_in(raw)[number], algorithms()[algorithm]
        keys, errors = sound_keys(kind, given)
        for one in errors:
            if one["loc"][:1] and one["loc"][0] not in own:
                continue  # it is told of [search]
            location = ("islands", number, *one["loc"])
            key, found, allowed = _fault({**one, "loc": location}, raw, recipe)
            if one["type"] == "extra_forbidden":
                known = [*IslandSection.model_fields, *kind.Keys.model_fields]
                found = with_near_miss("unknown key", one["loc"][-1], known)
                if others := _algorithms_with(one["loc"][-1]):
                    found = f"a key of {' and '.join(others)}, not of {algorithm}"
                allowed = ", ".join(known)
            faults.append((key, found, allowed))
        if keys is None or any(one["loc"][:1] == ("descriptors",) for one in errors):
            continue
        if set(own) & set(kind.Keys.model_fields):
            faults += [(on_island(key, number), *rest) for key, *rest in keys.disagreements()]
    return faults


def _parents(raw: Mapping) -> list[tuple[str | None, str]]:
    """(name or None, map) of each parent, as far as ``raw`` is well-formed."""
    parents = raw.get("parents")
    tables = [one for one in parents if isinstance(one, dict)] if isinstance(parents, list) else []
    found = []
    for one in tables:
        texts = [one.get(key) for key in ("name", "map", "genome", "run")]
        name, place, genome, run = (text if isinstance(text, str) else None for text in texts)
        if place or genome or run:
            bred = genome, run, one.get("id")
            found.append((parent_title(name, *bred), parent_place(place, *bred)))
    return found


def _repeated(recipe: BaseModel) -> list[tuple[str, str, str]]:
    names = [measure.name for measure in recipe.measures]
    places: dict[str, list[int]] = {}  # of what is recorded
    for number, entry in enumerate(recipe.run.record):
        for measure in entry.measures:
            places.setdefault(measure.name, []).append(number)
    faults = [("fitness", f"{name} twice", _once(name)) for name in _twice(names)]
    faults += [
        (f"run.record[{at[1]}]", f"{name} twice", _once(name))
        for name, at in places.items()
        if len(at) > 1
    ]
    faults += [
        (
            f"run.record[{at[0]}]",
            f"{name}, which is in [[fitness]] too",
            "it is logged there, leave it out",
        )
        for name, at in places.items()
        if name in names
    ]
    if not any(entry.is_objective for entry in recipe.fitness):
        faults.append(("fitness", "constraints alone", "a measure to search by as well"))
    sums = {entry.total for entry in recipe.fitness} - {None}
    return faults + [
        ("fitness", f"objective = {name!r}, which is a measure", "a name that no measure has")
        for name in sorted(sums.intersection([*names, *places]))
    ]


def _undescribed(recipe: BaseModel) -> list[tuple[str, str, str]]:
    """Faults of what the algorithm needs of every birth, and nothing measures."""
    own = [measure.name for measure in [*recipe.measures, *recipe.recorded]]
    known = sorted({*own, *(measure.name for measure in fitness.measures())})
    keys = [f"islands[{number}]" for number in range(len(recipe.islands))] or ["search"]
    return [
        (
            f"{key}.descriptors",
            with_near_miss(f"no measure {shown(name)} that is one number", name, known),
            f"a measure of evocity, or one in [[fitness]] or run.record: {', '.join(own)}",
        )
        for key, local in zip(keys, recipe.local, strict=True)
        for name in local.search.described
        if name not in own
    ]


def _of_refine(recipe: BaseModel) -> list[tuple[str, str, str]]:
    """Faults of refinement with so many births a generation, and with the algorithm."""
    refine, population = recipe.refine, min(map(len, recipe.slots))
    faults = []
    if refine.births > population:
        on = " on the smallest island" if recipe.islands else ""
        found = f"{refine.births} of {population} births a generation{on}"
        faults.append(("refine.births", found, f"{population} or fewer"))
    if refine.births and not recipe.islands and recipe.search.breeds_by is not None:
        found = f"{refine.births}, with the algorithm {recipe.search.algorithm!r}"
        faults.append(("refine.births", found, "0, as it breeds by itself"))
    return faults


def _of_stop(recipe: BaseModel) -> list[tuple[str, str, str]]:
    """Faults of the ``target`` at which the search stops: what none can reach."""
    entries = {
        one.name: entry for entry in recipe.fitness if entry.is_objective for one in entry.measures
    }
    goals = {one.name: one.goal for one in recipe.measures}
    faults = []
    for name, value in recipe.stop.target.items():
        key = f"stop.target.{name}"
        if name not in entries:
            found = with_near_miss(f"no measure {shown(name)} that is searched by", name, entries)
            faults.append((key, found, ", ".join(entries)))
            continue
        entry, (low, high) = entries[name], recipe.limits[name]
        if entry.target is not None or entry.like is not None:
            if value < 0:
                faults.append((key, f"{value:g}", "how near to the wanted number, 0 or more"))
        elif not (value <= high if (entry.goal or goals[name]) == "max" else value >= low):
            faults.append((key, f"{value:g}", f"within its range, {low:g}…{high:g}"))
    return faults


def _once(name: str) -> str:
    return "each measure once" + (" a part; a label tells parts apart" if "@" in name else "")


def _twice(names: list[str]) -> list[str]:
    return sorted({name for name in names if names.count(name) > 1})


_TYPES = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "float_type": "a number",
    "string_type": "text in quotes",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a finite number",
    "missing": "it is required",
}

_PHRASES = {
    "greater_than": "above {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "below {lt}",
    "less_than_equal": "{le} or less",
    "literal_error": "{expected}",
    "too_short": "{min_length} or more of them",
    "too_long": "{max_length} or fewer of them",
}


def _fault(error: Mapping, raw: Mapping, model: type[BaseModel]) -> tuple[str, str, str]:
    """(key, found, allowed) of one of pydantic's errors."""
    kind, details = error["type"], error.get("ctx", {})
    location = [part for part in error["loc"] if kind == "extra_forbidden" or _in_raw(part)]
    key = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in location).lstrip(".")
    if kind == "evocity":
        return key, details["found"], details["allowed"]
    if kind == "missing":
        return key, "missing", "it is required"
    if kind == "extra_forbidden":
        allowed = _keys_at(location[:-1], raw, model)
        found = with_near_miss("unknown key", location[-1], allowed)
        others = _algorithms_with(location[-1]) if location[:-1] == ["search"] else []
        if others:
            found = f"a key of {' and '.join(others)}, not of {_algorithm(raw)}"
        return key, found, ", ".join(allowed)
    if kind in _PHRASES:
        return key, shown(error["input"]), _PHRASES[kind].format(**details)
    return key, shown(error["input"]), _TYPES.get(kind, error["msg"])


def _with_measure(
    fault: tuple[str, str, str], location: tuple, raw: Mapping
) -> tuple[str, str, str]:
    """A ``fault``; the key of one in an entry of [[fitness]] with the measure or the file that it
    names, unless that was found."""
    key, found, allowed = fault
    if location[:1] != ("fitness",) or len(location) < 2:
        return fault
    entry = raw["fitness"][location[1]]
    named = (entry.get("name") or entry.get("file")) if isinstance(entry, dict) else None
    if isinstance(named, str) and named not in found:
        key = f"{key} ({named})"
    return key, found, allowed


def _in_raw(part) -> bool:
    # pydantic adds the branch of a union ("int", "literal['all']") to the place of the fault
    return isinstance(part, int) or not (part in ("int", "constrained-int") or "[" in part)


def _algorithm(raw: Mapping) -> str:
    return raw.get("search", {}).get("algorithm", DEFAULT)


def _algorithms_with(key: Any) -> list[str]:
    """The algorithms that have a ``key`` of their own in ``[search]``."""
    return sorted(name for name, kind in algorithms().items() if key in kind.Keys.model_fields)


def _keys_at(location: list, raw: Mapping, recipe: type[BaseModel]) -> list[str]:
    if not location:
        return list(recipe.model_fields)
    if location == ["search"]:
        return [*SearchSection.model_fields, *algorithms()[_algorithm(raw)].Keys.model_fields]
    models = {"parents": Parent, "fitness": FitnessEntry, "islands": IslandSection}
    if location[:2] == ["run", "record"]:
        return list(MeasureEntry.model_fields)
    model = models.get(location[0]) or recipe.model_fields[location[0]].annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        model = next(m for m in get_args(model) if isinstance(m, type))
    return [one.alias or key for key, one in model.model_fields.items()]
