"""Displays in a notebook: static HTML, escaped, without script, at most 150 kB each.

`html_of` finds the display of an object; `maps`, `runs` and `views` fill the templates.
"""

from collections.abc import Callable
from html import escape

from evocity.analysis.individual import Individual
from evocity.analysis.run import Run
from evocity.analysis.shortlist import Shortlist
from evocity.analysis.view import View
from evocity.citymap import CityMap
from evocity.errors import EvocityError
from evocity.genome import Genome
from evocity.notebook.maps import genome_html, map_html
from evocity.notebook.runs import (
    archive_html,
    individual_html,
    recipe_html,
    run_html,
    shortlist_html,
)
from evocity.notebook.views import view_html
from evocity.search import Archive, Recipe

_WAYS: dict[type, Callable] = {
    CityMap: map_html,
    Genome: genome_html,
    Recipe: recipe_html,
    Archive: archive_html,
    Run: run_html,
    Individual: individual_html,
    Shortlist: shortlist_html,
    View: view_html,
}


def html_of(thing: object) -> str:
    """Return the display of a map, a genome, a recipe, a run, a view, an individual, a shortlist or
    an archive: HTML that fetches nothing and runs nothing.

    If the display fails, it shows the message of the error. Raises TypeError for other objects.
    """
    for kind in type(thing).__mro__:
        if kind in _WAYS:
            try:
                return _WAYS[kind](thing)
            except EvocityError as error:
                return f"<pre>{escape(type(thing).__name__)}\n{escape(str(error))}</pre>"
    raise TypeError(f"no display of a {type(thing).__name__}")


__all__ = ["html_of"]
