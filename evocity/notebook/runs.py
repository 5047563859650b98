"""A recipe, a run, its individuals, its shortlist and its archive in a notebook."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from evocity.analysis.goals import Aim
from evocity.analysis.individual import Individual
from evocity.analysis.run import Run
from evocity.analysis.shortlist import Shortlist
from evocity.analysis.thumbnails import highest_of
from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.fitness import Measure
from evocity.genome import VOID
from evocity.notebook.maps import alt_of, fit_picture, map_picture, page, stone_of
from evocity.pictures import render
from evocity.pictures.colours import scale_end
from evocity.recipe.measures import FitnessEntry
from evocity.search import Archive, Recipe
from evocity.templates import number

# Maps in a row, their width, px, and characters of each.
_MOST, _WIDE, _SMALL = 8, 150, 13_000
# Entries of a shortlist, rows of an archive, characters of a recipe and of an error, at most.
_MOST_ENTRIES, _MOST_ROWS, _MOST_TEXT, _MOST_ERROR = 40, 20, 20_000, 300


# -- recipes --------------------------------------------------------------------------------------


def recipe_html(recipe: Recipe) -> str:
    run, window, parents = recipe.run, recipe.map, recipe.parents
    facts = [
        ("cities", " × ".join(one.title or one.place for one in parents)),
        ("map", f"{window.pixels} × {window.pixels} px of {window.metres_per_pixel:g} m"),
        ("births", f"{recipe.generation_size} in each of {run.generations + 1} generations"),
        ("search", recipe.search.algorithm + (", islands" if recipe.islands else "")),
        ("seed", str(run.seed)),
    ]
    goals = [(one.name, _goal(entry, one)) for entry in recipe.fitness for one in entry.measures]
    goals += [(one.name, "recorded") for one in recipe.recorded]
    weights = [(n.replace("_", " "), f"{w:g}") for one in recipe.mixtures for n, w in one.items()]
    return page(
        "recipe.html",
        title=run.name,
        facts=facts,
        goals=goals,
        weights=list(dict.fromkeys(weights)),
        text=recipe.text[:_MOST_TEXT],
        cut=len(recipe.text) > _MOST_TEXT,
    )


def _goal(entry: FitnessEntry, measure: Measure) -> str:
    goal = "bounds"
    if entry.is_objective:
        goal = "like" if entry.like is not None else entry.goal or measure.goal or goal
    aim = Aim(measure.name, measure.unit, goal, entry.target, entry.min, entry.max, entry.total)
    return replace(aim, like=entry.like or aim.like).wanted


# -- runs -----------------------------------------------------------------------------------------


def run_html(run: Run) -> str:
    """Return a `Run` as HTML: its state, its goals, its parents and the best by each goal."""
    header = run.header
    cities = [name for name in header.cities if name != VOID]
    facts = [
        ("cities", " × ".join(cities)),
        ("map", f"{header.height} × {header.width} px of {header.metres_per_pixel:g} m"),
    ]
    aims, maps, highest = [], [], 0.0
    if run.generations:
        facts += _state(run)
        best = {aim.name: _best(run, aim) for aim in run.columns.sought}
        aims = [_aim(aim, best.get(aim.name)) for aim in run.aims]
        highest = highest_of(run.columns)
        maps = _row(run, {name: one for name, one in best.items() if one}, highest)
    else:
        facts.append(("generations", "none is whole yet"))
    return page(
        "run.html",
        title=run.name,
        facts=facts,
        aims=aims,
        maps=maps,
        highest=highest,
        credit=header.attribution,
    )


def individual_html(one: Individual) -> str:
    """Return an `Individual` as HTML: its map, its scores and goals, its cities and parents."""
    run, uri, width, alt, shares = one.run, "", 0, "", []
    if one.status == "ok":
        uri, width = map_picture(one.city)
        alt = alt_of(one.city)
        fabric = run.header.chromosome.fabric(one.genome)
        shares = [] if fabric is None else stone_of(fabric)
    parents = ", ".join(str(each) for each in one.birth.parents)
    lived = f"{one.lived} generation" + ("" if one.lived == 1 else "s")
    facts = [
        ("born", f"generation {one.generation}, by {one.operator.replace('_', ' ')}"),
        ("parents", parents or "none"),
        ("alive", "yes" if one.alive else f"no; it lived in {lived}"),
    ]
    if one.status != "ok":
        facts.append(("status", f"{one.status}: {(one.error or '')[:_MOST_ERROR]}"))
    scores, logged = one.scores, run.columns.logged
    return page(
        "individual.html",
        title=f"individual {one.id} of {run.name}",
        uri=uri,
        width=width,
        alt=alt,
        facts=facts,
        scores=[(a.name, number(scores.get(a.name), a.unit), a.wanted) for a in logged],
        shares=shares,
        credit=run.header.attribution,
        breaks=one.status == "ok" and not one.feasible,
    )


def shortlist_html(shortlist: Shortlist) -> str:
    cities = [one.individual.city for one in shortlist[:_MOST]]
    highest = scale_end(*cities)
    entries = []
    for place, one in enumerate(shortlist[:_MOST_ENTRIES]):
        note = {"title": f"{one.individual.id}: {one.role}", "reasons": one.reasons}
        picture = {"uri": "", "alt": ""}
        if place < _MOST:
            picture = _small(cities[place], "", "", highest)
        entries.append(picture | note)
    return page(
        "shortlist.html",
        entries=entries,
        left=len(shortlist) - len(entries),
        lacking=shortlist.lacking,
        highest=highest,
        top=max((float(city.heights.max()) for city in cities), default=0.0),
        credit=shortlist[0].individual.run.header.attribution if shortlist else "",
    )


def archive_html(archive: Archive) -> str:
    """Return an `Archive` as HTML: its size and hypervolume, and its first births."""
    table = archive.births
    if "crowding" in table.column_names:
        table = table.sort_by([("crowding", "descending"), ("id", "ascending")])
    names = [name for name in table.column_names if name not in ("crowding", "cell")]
    rows = [[_cell(row[name]) for name in names] for row in table.slice(0, _MOST_ROWS).to_pylist()]
    alive = sum(archive.births["alive"].to_pylist())
    facts = [("births", f"{len(archive)}, {alive} of them alive")]
    if archive.grid is not None:
        facts.append(("filled", f"{100 * len(archive) / len(archive.grid):.1f} % of the grid"))
    facts.append(("hypervolume", number(archive.hypervolume)))
    heads = [name.removeprefix("fitness.") for name in names]
    left = max(0, len(archive) - _MOST_ROWS)
    return page("archive.html", facts=facts, heads=heads, rows=rows, left=left)


def _cell(value: object) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    return number(value) if isinstance(value, float) else str(value)


def _state(run: Run) -> Iterable[tuple[str, str]]:
    status = run.status()
    state = "finished" if status["finished"] else "not finished"
    if status["stopped"]:
        state = f"stopped: {status['stopped']}"
    failed = f", {status['failures']} of them failed" if status["failures"] else ""
    return [
        ("generations", f"{len(run.generations)}, {state}"),
        ("births", f"{status['births']}{failed}"),
        ("hypervolume", number(status["hypervolume"])),
    ]


def _best(run: Run, aim: Aim) -> Individual | None:
    """The best of all births by a goal; None for an unknown goal, and where no birth qualifies."""
    try:
        return run.best(aim.name)
    except RunError:
        return None


def _aim(aim: Aim, best: Individual | None) -> tuple[str, str, str, str]:
    value = number(best.scores.get(aim.name), aim.unit) if best else ""
    return aim.name, aim.wanted, value, f"{best.id}" if best else ""


def _row(run: Run, best: Mapping[str, Individual], highest: float) -> list[dict]:
    """Parents, then the best by each goal, on a scale that ends at ``highest`` metres."""
    sources = [source.city for source in run.columns.sources]
    maps = [_small(city, city.name, "parent", highest) for city in sources[: _MOST // 2]]
    for one in list(dict.fromkeys(best.values()))[: _MOST - len(maps)]:
        goals = ", ".join(name for name, other in best.items() if other == one)
        maps.append(_small(one.city, f"{one.id}", f"best {goals}", highest))
    return maps


def _small(city: CityMap, title: str, note: str, highest: float) -> dict:
    uri, width = fit_picture(render(city, highest=highest, legend=False), _WIDE, _SMALL)
    return {"uri": uri, "width": width, "alt": alt_of(city), "title": title, "note": note}
