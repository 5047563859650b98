"""How things look in a notebook: static HTML, escaped, without script, at most 150 kB each.

`html_of` finds what shows a thing; `maps`, `genomes`, `recipes`, `archives`, `runs`, `views` show
theirs by the templates beside them.
"""

from collections.abc import Callable
from html import escape

from evocity.analysis.individual import Individual
from evocity.analysis.keeping import Keeping
from evocity.analysis.run import Run
from evocity.analysis.view import View
from evocity.citymap import CityMap
from evocity.displays.archives import archive_html
from evocity.displays.genomes import genome_html
from evocity.displays.maps import map_html
from evocity.displays.recipes import recipe_html
from evocity.displays.runs import individual_html, keeping_html, run_html
from evocity.displays.views import view_html
from evocity.errors import EvocityError
from evocity.genome import Genome
from evocity.search import Archive, Recipe

_WAYS: dict[type, Callable] = {
    CityMap: map_html,
    Genome: genome_html,
    Recipe: recipe_html,
    Archive: archive_html,
    Run: run_html,
    Individual: individual_html,
    Keeping: keeping_html,
    View: view_html,
}


def html_of(thing: object) -> str:
    """What a notebook shows of a map, a genome, a recipe, a run, a view of it, an individual or an
    archive: HTML that fetches nothing and runs nothing.

    What cannot be shown is told by the message of its fault. Raises TypeError for anything else.
    """
    for kind in type(thing).__mro__:
        if kind in _WAYS:
            try:
                return _WAYS[kind](thing)
            except EvocityError as error:
                return f"<pre>{escape(type(thing).__name__)}\n{escape(str(error))}</pre>"
    raise TypeError(f"no display of a {type(thing).__name__}")


__all__ = ["html_of"]
