"""A recipe in a notebook: what it breeds of, by which operators, what it rewards."""

from dataclasses import replace

from evocity.analysis.wanted import Aim
from evocity.displays.maps import TEMPLATES
from evocity.fitness import Measure
from evocity.pages import templates_of
from evocity.search import Recipe
from evocity.search.wanted import FitnessEntry


def recipe_html(recipe: Recipe) -> str:
    """A `Recipe` as HTML."""
    run, window, parents = recipe.run, recipe.map, recipe.parents
    told = [
        ("cities", " × ".join(one.title or one.place for one in parents)),
        ("map", f"{window.pixels} × {window.pixels} px of {window.metres_per_pixel:g} m"),
        ("births", f"{run.population} in each of {run.generations + 1} generations"),
        ("search", recipe.search.algorithm + (", islands" if recipe.islands else "")),
        ("seed", str(run.seed)),
    ]
    wanted = [(one.name, _wanted(entry, one)) for entry in recipe.fitness for one in entry.measures]
    wanted += [(one.name, "recorded") for one in recipe.recorded]
    weights = [(n.replace("_", " "), f"{w:g}") for one in recipe.mixtures for n, w in one.items()]
    return (
        templates_of(TEMPLATES)
        .get_template("recipe.html")
        .render(
            title=run.name,
            told=told,
            wanted=wanted,
            weights=list(dict.fromkeys(weights)),
            text=recipe.text[:_LONGEST],
            cut=len(recipe.text) > _LONGEST,
        )
    )


# Characters of a recipe's text that a display holds.
_LONGEST = 20_000


def _wanted(entry: FitnessEntry, measure: Measure) -> str:
    goal = "bounds"
    if entry.is_objective:
        goal = "like" if entry.like is not None else entry.goal or measure.goal or goal
    aim = Aim(measure.name, measure.unit, goal, entry.target, entry.min, entry.max, entry.total)
    return replace(aim, like=entry.like or aim.like).wanted


__all__ = ["recipe_html"]
