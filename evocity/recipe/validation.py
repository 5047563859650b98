"""Validation of a recipe: all its faults at once, each with its key, what arrived and what is
allowed."""

import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import tomli_w
from pydantic import BaseModel, ValidationError

from evocity.errors import RecipeError, add_near_miss, spell
from evocity.fitness import Measure
from evocity.kinds import KINDS
from evocity.recipe.consistency import cross_faults, raw_faults
from evocity.recipe.islands import (
    IslandSection,
    algorithm_keys,
    fill_islands,
    island_tables,
    on_island,
)
from evocity.recipe.measures import FitnessEntry, MeasureEntry
from evocity.recipe.search_section import SearchSection, read_algorithm_keys
from evocity.recipe.sections import Parent
from evocity.recipe.values import parent_place, parent_title
from evocity.section import Fault
from evocity.selection.algorithms import DEFAULT, algorithms


def fill_from_sections(recipe: BaseModel, sections: Mapping[str, Any], folder: Path) -> None:
    """Fill the new ``recipe`` with these ``sections``, as `Recipe` takes them."""
    raw = _plain(sections, ())
    try:
        text = tomli_w.dumps(raw)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecipeError(
            f"the recipe cannot be written as TOML ({error})",
            "values that are texts, numbers or booleans, or lists or mappings of such values",
            "remove values of other types, such as a None in a list",
        ) from None
    fill_from_toml(recipe, tomllib.loads(text), text, folder, {}, "the recipe")


def _plain(value: Any, place: tuple[str, ...]) -> Any:
    """Write a ``value`` at a ``place`` of a recipe as TOML has it."""
    if isinstance(value, Mapping):
        items = {str(key): item for key, item in value.items() if item is not None}
        return {key: _plain(item, (*place, key)) for key, item in items.items()}
    if place[-2:-1] == ("operators",) and isinstance(value, int | float):
        return {"weight": value}  # in TOML tables come last, and the order of operators counts
    if isinstance(value, Measure):
        return value.name
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        items = [_plain(item, (*place, "")) for item in value]
        key = {("parents",): "map", ("fitness",): "name"}.get(place)
        return [{key: item} if key and isinstance(item, str) else item for item in items]
    return value


def fill_from_toml(
    recipe: BaseModel,
    raw: dict,
    text: str,
    folder: Path,
    overrides: Mapping[str, Any],
    name: str,
    kept: Mapping[str, str] | None = None,
    defaults: Mapping[str, Any] | None = None,
) -> None:
    """Fill the new ``recipe`` with ``raw``, the content of its ``text``; the other parameters are
    those of `evocity.recipe.reader.recipe_of`. Raises `RecipeError`."""
    for key, value in overrides.items():
        section, entry = key.split(".")
        if isinstance(raw.setdefault(section, {}), dict):
            raw[section][entry] = value
    for key, value in (defaults or {}).items():
        if key == "islands":  # `fill_islands` takes them
            continue
        section, _, entry = key.partition(".")
        if not entry:
            raw.setdefault(section, value)
        elif isinstance(raw.setdefault(section, {}), dict):
            raw[section].setdefault(entry, value)
    kind = _read_kind(raw)
    if kind != "fabric":
        raw.setdefault(
            "operators", {name: dict(one) for name, one in KINDS[kind].default_operators.items()}
        )
    island_faults = fill_islands(raw, (defaults or {}).get("islands"))
    faults: list[Fault] = []
    cross: list[Fault] = []
    try:
        context = {"folder": folder, "parents": _read_parents(raw), "kept": kept}
        type(recipe).__pydantic_validator__.validate_python(
            raw, context=context, self_instance=recipe
        )
    except ValidationError as error:
        for details in error.errors(include_url=False):
            fault = _translate(details, type(recipe))
            faults.append(_name_measure(fault, details["loc"], raw))
    else:
        cross = cross_faults(recipe)
    faults += island_faults + raw_faults(raw) + list(_algorithm_faults(raw, type(recipe))) + cross
    if faults:
        lines = _write_faults(faults)
        raise RecipeError(
            f"{name} has {len(lines)} fault{'s' if len(lines) > 1 else ''}:\n  "
            + "\n  ".join(lines),
            "a recipe without faults; each line ends with what is allowed",
            "correct these keys",
        )
    recipe._text, recipe._folder, recipe._overrides = text, folder, dict(overrides)


def _write_faults(faults: Iterable[Fault]) -> list[str]:
    """Write a line for each key and value at fault; alternatives are joined with "or"."""
    alternatives: dict[tuple[str, str], dict[str, None]] = {}
    for key, found, allowed in faults:
        alternatives.setdefault((key, found), {})[allowed] = None
    return [
        f"{key}: {found}; allowed: {' or '.join(allowed)}"
        for (key, found), allowed in alternatives.items()
    ]


def _read_kind(raw: Mapping) -> str:
    section = raw.get("run", {})
    kind = section.get("kind") if isinstance(section, dict) else None
    return kind if isinstance(kind, str) and kind in KINDS else "fabric"


def _read_parents(raw: Mapping) -> list[tuple[str | None, str]]:
    """Read (name or None, map) of each parent that is well-formed."""
    parents = raw.get("parents")
    tables = [one for one in parents if isinstance(one, dict)] if isinstance(parents, list) else []
    pairs = []
    for table in tables:
        texts = [table.get(key) for key in ("name", "map", "genome", "run")]
        name, place, genome, run = (text if isinstance(text, str) else None for text in texts)
        if place or genome or run:
            bred = genome, run, table.get("id")
            pairs.append((parent_title(name, *bred), parent_place(place, *bred)))
    return pairs


def _algorithm_faults(raw: Mapping, model: type[BaseModel]) -> Iterator[Fault]:
    """Yield the faults of known algorithms' own keys, in ``[search]`` and on islands."""
    cases: list[tuple[tuple, str, Mapping, Mapping]] = []  # location, algorithm, given, own keys
    section = raw.get("search", {})
    name = section.get("algorithm", DEFAULT) if isinstance(section, dict) else None
    if isinstance(name, str) and name in algorithms():
        own = {k: v for k, v in section.items() if k not in SearchSection.model_fields}
        cases.append((("search",), name, own, own))
    for number, name, given in algorithm_keys(raw, DEFAULT):
        cases.append((("islands", number), name, given, island_tables(raw)[number]))
    for location, name, given, own in cases:
        kind, section = algorithms()[name], IslandSection if location[1:] else SearchSection
        keys, errors = read_algorithm_keys(kind, given)
        for error in errors:
            key, place = error["loc"][:1], (*location, *error["loc"])
            if key and key[0] not in own:
                continue  # a fault of [search]
            if error["type"] == "extra_forbidden":
                known = [*section.model_fields, *kind.Keys.model_fields]
                found, allowed = _unknown_key(key[0], known)
                if others := [n for n, a in algorithms().items() if key[0] in a.Keys.model_fields]:
                    found = f"a key of {' and '.join(sorted(others))}, not of {name}"
                yield _write_key(place), found, allowed
            else:
                yield _translate({**error, "loc": place}, model)
        if keys is None or any(error["loc"][:1] == ("descriptors",) for error in errors):
            continue  # the other keys must agree with these
        if set(own) & set(kind.Keys.model_fields):
            for key, *rest in keys.disagreements():
                yield (on_island(key, location[1]) if location[1:] else key), *rest


# -- pydantic's errors ---------------------------------------------------------------------------

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


def _translate(error: Mapping, model: type[BaseModel]) -> Fault:
    kind, details, location = error["type"], error.get("ctx", {}), error["loc"]
    if kind == "extra_forbidden":
        return _write_key(location), *_unknown_key(location[-1], _known_keys(location, model))
    key = _write_key(part for part in location if _is_in_recipe(part))
    if kind == "evocity":
        return key, details["found"], details["allowed"]
    if kind == "missing":
        return key, "missing", "it is required"
    if kind in _PHRASES:
        return key, spell(error["input"]), _PHRASES[kind].format(**details)
    return key, spell(error["input"]), _TYPES.get(kind, error["msg"])


def _write_key(location: Iterable[str | int]) -> str:
    return "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in location).lstrip(".")


def _is_in_recipe(part: str | int) -> bool:
    """Whether a ``part`` of a location stands in the recipe: pydantic adds the branch of a union
    ("int", "literal['all']")."""
    return isinstance(part, int) or not (part in ("int", "constrained-int") or "[" in part)


def _unknown_key(key: Any, known: list[str]) -> tuple[str, str]:
    return add_near_miss("unknown key", key, known), ", ".join(known)


def _known_keys(location: tuple, recipe: type[BaseModel]) -> list[str]:
    """List the keys that are allowed beside the last one of a ``location``."""
    if len(location) == 1:
        return list(recipe.model_fields)
    models = {"parents": Parent, "fitness": FitnessEntry}
    if location[:2] == ("run", "record") and len(location) > 2:
        return list(MeasureEntry.model_fields)
    model = models.get(location[0]) or recipe.model_fields[location[0]].annotation
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        model = next(one for one in get_args(model) if isinstance(one, type))
    return [field.alias or key for key, field in model.model_fields.items()]


def _name_measure(fault: Fault, location: tuple, raw: Mapping) -> Fault:
    """Add the measure or the file of an entry of [[fitness]] to the key of its ``fault``."""
    key, found, allowed = fault
    if location[:1] != ("fitness",) or len(location) < 2:
        return fault
    entry = raw["fitness"][location[1]]
    named = (entry.get("name") or entry.get("file")) if isinstance(entry, dict) else None
    if isinstance(named, str) and named not in found:
        key = f"{key} ({named})"
    return key, found, allowed
