"""The galleries: a card for each individual, with picture, every measure and lineage."""

import json
import math
from collections.abc import Sequence
from html import escape

from evocity.genome import VOID
from evocity.pages import number
from evocity.pictures import city_colours
from evocity.report.facts import Facts, Shown
from evocity.report.pictures import map_uri

#: What the void among the cities is.
_VOID = "bare ground, laid where buildings were left out"


def gallery(facts: Facts, highest: float) -> str:
    """Controls and cards. Without scripts the cards stand in order: the front first."""
    if not facts.shown:
        return "<p>No individual is alive in the last generation.</p>"
    orders = ["front, then spread", *(aim.name for aim in facts.aims), "youngest first"]
    options = "".join(
        f'<option value="{index}">{escape(order)}</option>' for index, order in enumerate(orders)
    )
    cards = "".join(
        _card(facts, one, place, highest, _place_of(facts, one))
        for place, one in enumerate(facts.shown)
    )
    return (
        f'<p class="controls"><label>Order <select id="order">{options}</select></label> '
        '<label><input type="checkbox" id="front-only"> the front only</label> '
        '<label><input type="checkbox" id="different-only"> only those that look different'
        "</label></p>"
        f'<div class="gallery" id="gallery">{cards}</div>'
    )


def archive_gallery(facts: Facts, highest: float) -> str:
    """Cards of those of the archive that no longer live, the wide apart first."""
    badge = '<span class="badge">archive</span>'
    cards = "".join(
        _card(facts, one, place, highest, badge) for place, one in enumerate(facts.shown_gone)
    )
    return f'<div class="gallery">{cards}</div>'


def parents(facts: Facts, highest: float) -> str:
    """The source cities, with the run's measures where the first population measured them."""
    first = {birth.id: birth for birth in facts.source_births}
    cards = []
    colours = city_colours([source.name for source in facts.sources])
    for index, (source, colour) in enumerate(zip(facts.sources, colours, strict=True)):
        birth = first.get(index)
        rows = _rows(facts, birth.values) if birth else ""
        cards.append(
            f'<figure class="card"><img src="{map_uri(source.city, highest)}" '
            f'alt="map of {escape(source.name)}" width="{source.city.shape[1]}">'
            f"<figcaption><h3>{_chip(colour)}{escape(source.name)}</h3>"
            f'<p class="credit">{escape(source.city.attribution)}</p>'
            f"<table>{rows}</table></figcaption></figure>"
        )
    note = "Maps as read; the measures are those of their decoded genomes."
    if any(birth.status != "ok" for birth in first.values()):
        note += (
            " A dash is a measure that has no value there: such a city does not live itself, but"
            " its children do."
        )
    return f'<p>{note}</p><div class="gallery">{"".join(cards)}</div>'


def city_key(cities: Sequence[str]) -> str:
    """Which colour of the lineage bars is which city."""
    told = (f"{city}: {_VOID}" if city == VOID else city for city in cities)
    pairs = zip(told, city_colours(cities), strict=True)
    items = (f"<span>{_chip(colour)}{escape(city)}</span>" for city, colour in pairs)
    return f'<p class="key">Lineage: {" ".join(items)}</p>'


def _place_of(facts: Facts, one: Shown) -> str:
    front = '<span class="badge">front</span>' if one.rank == 0 else f"rank {escape(str(one.rank))}"
    return front + (", breaks a constraint" if one.birth.id in facts.broken else "")


def _card(facts: Facts, one: Shown, place: int, highest: float, badge: str) -> str:
    birth = one.birth
    losses = [aim.loss(birth.values.get(aim.name, math.nan)) for aim in facts.aims]
    keys = json.dumps([place, *losses, -birth.id])
    name, rank = escape(str(birth.id)), escape(str(one.rank))
    more = one.others[len(facts.recorded) :]  # those recorded stand beside the goals
    others = "".join(
        f"<tr><th>{escape(measure)}</th><td>{escape(number(value, unit))}</td></tr>"
        for measure, value, unit in more
    )
    return (
        f'<figure class="card" id="i{name}" data-rank="{rank}" data-keys="{escape(keys)}"'
        f"{' data-alike' if birth.id in facts.look_alikes else ''}>"
        f'<img src="{map_uri(one.city, highest)}" alt="decoded map of individual {name}" '
        f'width="{one.city.shape[1]}"><figcaption><h3>{name} <small>{badge}</small></h3>'
        f"<table>{_rows(facts, birth.values)}</table>"
        f"<details><summary>{len(more)} more measures</summary>"
        f'<table class="others">{others}</table></details>'
        f"{_lineage(facts, one)}</figcaption></figure>"
    )


def _rows(facts: Facts, values) -> str:
    return "".join(
        f'<tr title="{escape(aim.wanted)}"><th>{escape(aim.name)}</th>'
        f"<td>{escape(number(values.get(aim.name), aim.unit))}</td></tr>"
        for aim in [*facts.aims, *facts.recorded]
    )


def _lineage(facts: Facts, one: Shown) -> str:
    birth = one.birth
    here = {shown.birth.id for shown in [*facts.shown, *facts.shown_gone]}
    links = ", ".join(
        f'<a href="#i{escape(str(parent))}">{escape(str(parent))}</a>'
        if parent in here
        else escape(str(parent))
        for parent in birth.parents
    )
    made = json.dumps(dict(birth.made), ensure_ascii=False, default=str)
    came = escape(birth.operator.replace("_", " ")) + (f" of {links}" if links else "")
    cities = facts.run.header.cities
    colours = city_colours(cities)
    parts = [
        f'<i style="width:{share:.1%};background:{colours[index]}" '
        f'title="{escape(cities[index])} {share:.0%}"></i>'
        for index, share in enumerate(one.shares)
        if share > 0
    ]
    shares = " · ".join(
        f"{escape(cities[index])} {share:.0%}"
        for index, share in enumerate(one.shares)
        if share > 0
    )
    return (
        f'<div class="bar">{"".join(parts)}</div><p class="lineage">{shares}</p>'
        f'<p class="lineage" title="{escape(made)}">born in generation '
        f"{escape(str(birth.generation))}, {came}</p>"
    )


def _chip(colour: str) -> str:
    return f'<i class="chip" style="background:{colour}"></i>'
