"""A recipe in a notebook: what it breeds of, by which operators, what it rewards."""

from evocity.displays.maps import TEMPLATES
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
    wanted = [(one.name, _wanted(entry)) for entry in recipe.fitness for one in entry.measures]
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


def _wanted(entry: FitnessEntry) -> str:
    words = {"max": "more is better", "min": "less is better", None: ""}
    told = []
    if entry.target is not None:
        told.append(f"{entry.target:g} is wanted")
    elif entry.like is not None:
        told.append(f"as in {entry.like}")
    elif entry.is_objective:
        own = entry.goal or (entry.measures[0].goal if entry.measures else None)
        told.append(words.get(own, ""))
    told += [f"at least {entry.min:g}"] if entry.min is not None else []
    told += [f"at most {entry.max:g}"] if entry.max is not None else []
    return ", ".join(filter(None, told)) + (f"; part of {entry.total}" if entry.total else "")


__all__ = ["recipe_html"]
