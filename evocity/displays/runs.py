"""A run and its individuals in a notebook."""

from collections.abc import Iterable, Mapping

from evocity.analysis.individual import Individual
from evocity.analysis.keeping import Keeping
from evocity.analysis.run import Run
from evocity.analysis.thumbnails import highest_of
from evocity.analysis.wanted import Aim
from evocity.citymap import CityMap
from evocity.displays.genomes import stone_of
from evocity.displays.maps import TEMPLATES, alt_of
from evocity.displays.pictures import LARGEST, fitted
from evocity.errors import RunError
from evocity.genome import VOID
from evocity.pages import number, templates_of
from evocity.pictures import render
from evocity.pictures.colours import scale_end

#: Maps beside each other: at most so many, so wide, px, and so many characters each.
_MOST, _WIDE, _SMALL = 8, 150, 13_000
#: Those worth keeping that are told, at most.
_MOST_TOLD = 40


def run_html(run: Run) -> str:
    """A `Run` as HTML: where it is, what was wanted, its parents and the best by each goal."""
    header = run.header
    cities = [name for name in header.cities if name != VOID]
    told = [
        ("cities", " × ".join(cities)),
        ("map", f"{header.height} × {header.width} px of {header.metres_per_pixel:g} m"),
    ]
    aims, maps, highest = [], [], 0.0
    if run.generations:
        told += _state(run)
        best = {aim.name: _best(run, aim) for aim in run.aims if aim.sought}
        aims = [_aim(aim, best.get(aim.name)) for aim in run.aims]
        highest = highest_of(run.told)
        maps = _row(run, {name: one for name, one in best.items() if one}, highest)
    else:
        told.append(("generations", "none is whole yet"))
    return (
        templates_of(TEMPLATES)
        .get_template("run.html")
        .render(
            title=run.path.resolve().name,
            told=told,
            aims=aims,
            maps=maps,
            highest=highest,
            credit=header.attribution,
        )
    )


def individual_html(one: Individual) -> str:
    """An `Individual` as HTML: its map, its scores with what was wanted, where it is from."""
    run, uri, width, alt, shares = one.run, "", 0, "", []
    if one.status == "ok":
        city = one.city
        uri, width = fitted(render(city, zoom=max(1, LARGEST // 2 // max(city.shape))))
        alt = alt_of(city)
        fabric = run.header.chromosome.fabric(one.genome)
        shares = [] if fabric is None else stone_of(fabric)
    parents = ", ".join(str(each) for each in one.birth.parents)
    told = [
        ("born", f"generation {one.generation}, by {one.operator.replace('_', ' ')}"),
        ("parents", parents or "none"),
        ("lives", "yes" if one.alive else f"no; it did in {counted(one.lived, 'generation')}"),
    ]
    if one.status != "ok":
        told.append(("status", f"{one.status}: {(one.error or '')[:_LONGEST]}"))
    scores = one.scores
    rows = [
        (aim.name, number(scores.get(aim.name), aim.unit), aim.wanted) for aim in run.told.logged
    ]
    return (
        templates_of(TEMPLATES)
        .get_template("individual.html")
        .render(
            title=f"individual {one.id} of {run.path.resolve().name}",
            uri=uri,
            width=width,
            alt=alt,
            told=told,
            scores=rows,
            shares=shares,
            credit=run.header.attribution,
            breaks=one.status == "ok" and not one.feasible,
        )
    )


def keeping_html(keeping: Keeping) -> str:
    """A `Keeping` as HTML: each with its map, its role, why it is kept, what it gave up."""
    cities = [one.individual.city for one in keeping[:_MOST]]
    highest = scale_end(*cities)
    shown = []
    for place, one in enumerate(keeping[:_MOST_TOLD]):
        note = {"title": f"{one.individual.id}: {one.role}", "reasons": one.reasons}
        picture = {"uri": "", "alt": ""}
        if place < _MOST:
            picture = _small(cities[place], "", "", highest)
        shown.append(picture | note)
    credit = keeping[0].individual.run.header.attribution if keeping else ""
    return (
        templates_of(TEMPLATES)
        .get_template("keeping.html")
        .render(
            kept=shown,
            left=len(keeping) - len(shown),
            lacking=keeping.lacking,
            highest=highest,
            top=max((float(city.heights.max()) for city in cities), default=0.0),
            credit=credit,
        )
    )


def counted(count: int, noun: str) -> str:
    return f"{count} {noun}" + ("" if count == 1 else "s")


# Characters of a fault that a display tells.
_LONGEST = 300


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
    """The best of all births by a goal; None where the run wanted nothing that can be told, and
    where no birth qualifies."""
    try:
        return run.best(aim.name)
    except RunError:
        return None


def _aim(aim: Aim, best: Individual | None) -> tuple[str, str, str, str]:
    value = number(best.scores.get(aim.name), aim.unit) if best else ""
    return aim.name, aim.wanted, value, f"{best.id}" if best else ""


def _row(run: Run, best: Mapping[str, Individual], highest: float) -> list[dict]:
    """Parents, then the best by each goal, on a scale that ends at ``highest`` metres."""
    sources = [source.city for source in run.told.sources]
    shown = [_small(city, city.name, "parent", highest) for city in sources[: _MOST // 2]]
    for one in list(dict.fromkeys(best.values()))[: _MOST - len(shown)]:
        praise = ", ".join(name for name, other in best.items() if other == one)
        shown.append(_small(one.city, f"{one.id}", f"best {praise}", highest))
    return shown


def _small(city: CityMap, title: str, note: str, highest: float) -> dict:
    uri, width = fitted(render(city, highest=highest, legend=False), _WIDE, _SMALL)
    return {"uri": uri, "width": width, "alt": alt_of(city), "title": title, "note": note}


__all__ = ["individual_html", "keeping_html", "run_html"]
