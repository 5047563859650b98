"""The contact sheet of a run: its parents, and the best individuals of its last generation."""

from PIL import Image

from evocity.analysis import Individual, Run
from evocity.analysis.export import caption, cross_note
from evocity.analysis.page.shortlist import best_of_last
from evocity.analysis.thumbnails import cities_of, highest_of
from evocity.pictures.sheet import sheet_of


def contact_sheet(run: Run, *, best: int = 8, columns: int = 4) -> Image.Image:
    """Draw the maps of a run on one sheet: first the parents, then the best individuals of the last
    generation. Each measure in turn adds its next best individual to the sheet. If several
    individuals look almost the same, the sheet shows only one of these individuals.

    All maps on the sheet have one scale of heights. A cross marks an individual that breaks bounds,
    and the measures of these bounds. The sheet has a legend of the scale and the attributions of
    the source cities. Raises `RunError` if the run has no complete generation yet, or is damaged.
    """
    births = run.columns
    cells: list = [(source.city, [source.city.name, "parent"]) for source in births.sources]
    cells += [None] * (-len(cells) % columns)  # the bred begin a row of their own
    bred = {Individual(births, n): c for n, c in cities_of(births, best_of_last(run, best)).items()}
    cells += [(city, caption(one)) for one, city in bred.items()]
    title = f"{run.name}, generation {births.last}"
    credit, note = run.header.attribution, cross_note(bred)
    return sheet_of(cells, title, highest_of(births), credit, columns, note)
