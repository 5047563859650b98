"""The report of a run: one page that opens anywhere, without network."""

import json
import os
from base64 import b64encode
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from html import escape
from itertools import combinations
from pathlib import Path

import numpy as np

from evocity.analysis.wanted import Aim
from evocity.errors import RunError
from evocity.files import whole_file
from evocity.genome import VOID
from evocity.pages import data_uri, number
from evocity.report.facts import Facts, Shown, figures_told
from evocity.report.failing import differing_told, failures, shortened
from evocity.report.gallery import archive_gallery, city_key, gallery, parents
from evocity.report.grid import grid_picture
from evocity.report.islands import Islands
from evocity.report.pictures import common_scale, scale_colours, scene_uri
from evocity.report.plots import Axis, Dots, curve, scatter, ticks
from evocity.search.opening import open_run
from evocity.store import STATUSES

_HERE = Path(__file__).parent

#: Of later births, no more dots than this in a plot; and no more plots of pairs than this.
_MOST_DOTS, _MOST_PAIRS = 2000, 6
#: Nor more individuals in three dimensions.
_MOST_SCENES = 3

# A page that fetches nothing and runs our own script alone: even a stranger's text that slipped
# through could do neither.
_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{}'; "
    "base-uri 'none'; form-action 'none'"
)


def write_report(run_folder: str | os.PathLike, output: str | os.PathLike | None = None) -> Path:
    """Write a run's report into its folder as ``report.html``, or to ``output``; returns its path.

    The page stands alone: settings, the parents, the front, the curves, the galleries of the
    last generation and of the archive with every measure under each picture, births and
    failures, attributions. Nothing in the folder is executed. Raises `RunError` if there is no
    run, if it has no whole generation yet, or if the page cannot be written.
    """
    run = open_run(run_folder)
    page = Path(run_folder) / "report.html" if output is None else Path(output)
    text = _page(Facts(run))
    try:
        with whole_file(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunError(
            f"{page} cannot be written: {error.strerror or error}",
            "a folder this user may write to, with room left",
            "free space, or write it to another place",
        ) from error
    return page


def _page(facts: Facts) -> str:
    highest = common_scale(facts)
    attribution = _text(facts.run.header.attribution)
    sections = [
        ("Parents", parents(facts, highest)),
        ("The front", _front(facts)),
        *((_grid_title(island), _grid(facts, island)) for island in facts.grids),
        *([("Islands", _islands(facts))] if facts.run.header.islands else []),
        ("Generation by generation", _curves(facts)),
        *_scenes(facts, highest),
        (_gallery_title(facts), city_key(facts.run.header.cities) + gallery(facts, highest)),
        ("Archive", _archive(facts, highest)),
        ("Births", _births(facts)),
        ("Settings", _settings(facts)),
        ("Attribution", f"<p>{attribution or 'The source maps state none.'}</p>"),
    ]
    body = "".join(
        f"<section><h2>{_text(title)}</h2>{inside}</section>" for title, inside in sections
    )
    title, script = _text(facts.title), _asset("report.js")
    policy = _POLICY.format(b64encode(sha256(script.encode()).digest()).decode())
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title} – evocity</title><style>{_asset('report.css')}</style></head><body>"
        f"<header><h1>{title}</h1>{_summary(facts)}</header>"
        f'<div class="scale">{_scale(highest)}</div>'
        f"<main>{body}</main><script>{script}</script></body></html>\n"
    )


def _sides(facts: Facts) -> str:
    """The sides of the range blocks of the source cities' codes."""
    pavements = [source.genome.pavement for source in facts.sources]
    sides = {side for pavement in pavements for side in (pavement.finest, pavement.coarsest)}
    return " to ".join(_text(side) for side in sorted({min(sides), max(sides)})) if sides else "?"


def _text(value) -> str:
    """Whatever a stranger's run holds, as text of the page."""
    return escape(str(value))


def _asset(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _summary(facts: Facts) -> str:
    status = facts.run.status()
    header = facts.run.header
    figures = [
        ("generations", _text(status["generation"])),
        ("births", _text(status["births"])),
        ("failed", _text(status["failures"]) + _reasons(facts)),
        ("on the front", f"{len(facts.front)} of {len(facts.members)}"),
        ("hypervolume", _text(number(status["hypervolume"])) + _gain(facts)),
        ("seed", _text(header.seed)),
    ]
    figures[5:5] = [
        (_text(name), _text(shown)) for name, shown in figures_told(status["algorithm"])
    ]
    if facts.archive is not None:
        figures.insert(4, ("in the archive", f"{len(facts.archive)}"))
    if facts.broken:
        figures.insert(4, ("break a constraint", f"{len(facts.broken)} of {len(facts.members)}"))
    items = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in figures)
    why = f" (stopped: {_text(status['stopped'])})" if status["stopped"] else ""
    state = "" if status["finished"] else f"<p>The run is not finished{why}: all here is whole.</p>"
    unsteady = f"<p>{_text(told)}.</p>" if (told := differing_told(facts.run)) else ""
    cities = [name for name in header.cities if name != VOID]
    return (
        f"<p>{_text(' × '.join(cities))}, {_text(header.width)} × {_text(header.height)} px "
        f"of {header.metres_per_pixel:g} m, range blocks of {_sides(facts)} px</p>"
        f'<dl class="figures">{items}</dl>{state}{unsteady}'
    )


def _reasons(facts: Facts) -> str:
    kinds = failures(facts.run)
    told = "; ".join(f"{kind.count} {kind.status}: {shortened(kind.error, 60)}" for kind in kinds)
    return f" <small>{_text(told)}</small>" if told else ""


def _gain(facts: Facts) -> str:
    volumes = [about.get("hypervolume") for about in facts.history]
    if len(volumes) < 2 or volumes[0] is None or volumes[-1] is None:
        return ""
    first = facts.kept[facts.births["generation"].to_numpy() == 0]
    if volumes[0] <= 0 or volumes[0] < 0.01 * volumes[-1] or 2 * first.sum() < len(first):
        # a share of next to nothing, or of a few that happened to live, tells nothing
        return f" <small>{_text(number(volumes[0]))} in the first population</small>"
    return f" <small>{volumes[-1] / volumes[0] - 1:+.0%} over the first population</small>"


def _scale(highest: float) -> str:
    stops = ", ".join(scale_colours(highest))
    marks = "".join(
        f'<span style="left:{metres / highest:.1%}">{metres:g}</span>'
        for metres in ticks(0, highest)
    )
    return (
        "<b>height above ground, m</b>"
        f'<div class="ramp" style="background:linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks">{marks}</div>'
    )


def _grid_title(island: str | None) -> str:
    return "The grid" if island is None else f"The grid of {island}"


def _grid(facts: Facts, island: str | None) -> str:
    """The picture of the grid that the run fills, or an ``island`` of it."""
    picture = grid_picture(facts, island)
    names = " × ".join(_text(name) for name in facts.grids[island].grid.descriptors)
    return (
        f'<figure class="sheet"><img src="{data_uri(picture)}" width="{picture.width}" '
        f'alt="grid over {names}: the best map of each filled cell"></figure>'
    )


def _islands(facts: Facts) -> str:
    """How good each island is, who lives where, and who moved."""
    told = Islands(facts)
    figures = (
        "island",
        "hypervolume, by its goals",
        "born there",
        "living",
        "of them from elsewhere",
    )
    plots = [curve(values, Axis(f"hypervolume of {name}")) for name, values in told.volumes]
    shown = "".join(f"<figure>{plot}</figure>" for plot in plots)
    moved = _table(("from", "to", "sent", "lived there after"), told.moves)
    return (
        _table(("island", "algorithm", "operators", "goals"), told.settings)
        + _table((*figures, "algorithm tells"), told.figures)
        + '<div class="tables">'
        + _table(
            ("living on", *(f"born on {name}" for name in told.names)),
            [(name, *counts) for name, counts in told.homes],
        )
        + (moved if told.moves else "<p>Nobody migrated.</p>")
        + "</div>"
        + (f'<div class="plots">{shown}</div>' if len(facts.history) > 1 else "")
    )


# -- the front ------------------------------------------------------------------------------


def _front(facts: Facts) -> str:
    count = len(facts.aims)
    key = (
        '<p class="key"><span><i class="dot first"></i>first population</span> '
        '<span><i class="dot later"></i>later births</span> '
        '<span><i class="dot front"></i>last front</span></p>'
    )
    if count == 1:
        plots = [_plot(facts, None, 0)]
    else:
        plots = [_plot(facts, x, y) for x, y in pairs_to_show(facts)]
    shown = f"<p>{len(plots)} of {count * (count - 1) // 2} pairs, those most in conflict.</p>"
    left_out = shown if count > 1 and len(plots) < count * (count - 1) // 2 else ""
    return f'{key}{left_out}<div class="plots">{"".join(plots)}</div>'


def _scenes(facts: Facts, highest: float) -> list[tuple[str, str]]:
    """The section of the best by each measure in three dimensions, none if nobody lives."""
    found = facts.best(_MOST_SCENES)
    if not found:
        return []
    figures = []
    for one in found:
        name = f"individual {one.birth.id}"
        told = f"{_values(facts.sought, one)}{_bounded(facts, one)}"
        figures.append(
            f'<figure class="scene"><img src="{scene_uri(one.city, highest)}" '
            f'alt="{name} in three dimensions, seen towards the north-north-east">'
            f"<figcaption><b>{name}</b>: {_text(told)}</figcaption></figure>"
        )
    note = (
        "<p>The best of the last generation by each goal. <code>evocity scene RUN --id N -o "
        "FILE.glb</code> writes one for Blender or a browser, <code>-o FILE.city.json</code> for a "
        "GIS.</p>"
    )
    return [("In three dimensions", f'{note}<div class="scenes">{"".join(figures)}</div>')]


def _values(aims: Sequence[Aim], one: Shown) -> str:
    told = (f"{aim.name} {number(one.birth.values.get(aim.name), aim.unit)}" for aim in aims)
    return ", ".join(told)


def _bounded(facts: Facts, one: Shown) -> str:
    """The constraints beside the goals in a caption: what the individual has, and the bounds."""
    constraints = [aim for aim in facts.aims if aim not in facts.sought]
    told = "; ".join(f"{_values([aim], one)} ({aim.bounds})" for aim in constraints)
    verb = "breaks a constraint" if one.birth.id in facts.broken else "constraints"
    return f". {verb.capitalize()}: {told}" if told else ""


def pairs_to_show(facts: Facts) -> list[tuple[int, int]]:
    """Pairs of measures (indices): all of up to four; of more, those most in conflict.

    Conflict of two measures is the negative correlation of their losses over the last
    generation, or over all births where that one is too small.
    """
    every = list(combinations(range(len(facts.aims)), 2))
    if len(every) <= _MOST_PAIRS:
        return every
    where = np.isin(facts.births["id"].to_numpy(), [row["id"] for row in facts.members]) & facts.ok
    if where.sum() < 3:
        where = facts.ok
    losses = np.array(
        [[aim.loss(v) for v in facts.values[where, i]] for i, aim in enumerate(facts.aims)]
    )
    losses /= np.maximum(np.abs(losses).max(axis=1, keepdims=True), 1e-300)  # no sum overflows
    centred = losses - losses.mean(axis=1, keepdims=True)
    length = np.maximum(np.sqrt((centred**2).sum(axis=1)), 1e-300)
    correlation = (centred / length[:, None]) @ (centred / length[:, None]).T
    return sorted(sorted(every, key=lambda pair: correlation[pair])[:_MOST_PAIRS])


def _plot(facts: Facts, x: int | None, y: int) -> str:
    """Measure ``y`` over measure ``x``; over the generation of birth where ``x`` is None."""
    ids, born = facts.births["id"].to_numpy(), facts.births["generation"].to_numpy()
    across = born if x is None else facts.values[:, x]
    first, front = facts.ok & (born == 0), np.isin(ids, facts.front)
    later = np.flatnonzero(facts.ok & (born > 0) & ~front)
    later = later[:: max(1, -(-len(later) // _MOST_DOTS))]
    shown = {one.birth.id for one in facts.shown}

    def dots(where, kind, radius, titles=False):
        where = np.flatnonzero(where) if where.dtype == bool else where
        told = [_title(facts, ids[i], facts.values[i]) for i in where] if titles else ()
        links = [f"#i{ids[i]}" for i in where] if titles and shown.issuperset(ids[where]) else ()
        points = across[where].astype(float), facts.values[where, y]
        return Dots(*points, kind, radius, told, links)

    layers = [
        dots(later, "later", 1.8),
        dots(first, "first", 3, True),
        dots(front, "front", 4, True),
    ]
    layers[1] = Dots(**{**vars(layers[1]), "links": ()})
    horizontal = Axis("generation") if x is None else _axis(facts.aims[x])
    return f"<figure>{scatter(layers, horizontal, _axis(facts.aims[y]))}</figure>"


def _title(facts: Facts, identifier: int, values: np.ndarray) -> str:
    told = (f"{a.name} {number(v, a.unit)}" for a, v in zip(facts.aims, values, strict=True))
    return f"{identifier}: {', '.join(told)}"


def _axis(aim: Aim) -> Axis:
    return Axis(aim.name + (f", {aim.unit}" if aim.unit else ""), aim.wanted, aim.target)


def _curves(facts: Facts) -> str:
    history = facts.history
    if len(history) < 2:
        return "<p>There is the first population alone, and so no curve.</p>"
    plots = [curve([about.get("hypervolume") for about in history], Axis("hypervolume"))]
    for name in facts.run.header.figures:
        values = [about.get("algorithm", {}).get(name) for about in history]
        plots.append(curve(values, Axis(name.replace("_", " "))))
    for aim in facts.sought:
        best = [about.get("best", {}).get(aim.name) for about in history]
        axis = Axis(f"best {aim.name}" + (f", {aim.unit}" if aim.unit else ""), "", aim.target)
        plots.append(curve(best, axis))
    figures = "".join(f"<figure>{plot}</figure>" for plot in plots)
    return f'<div class="plots">{figures}</div>'


# -- tables ---------------------------------------------------------------------------------


def _gallery_title(facts: Facts) -> str:
    count = len(facts.members)
    shown = len(facts.shown)
    part = f"all {count}" if shown == count else f"the first {shown} of {count} by rank"
    return f"Generation {facts.last}: {part} individuals"


def _archive(facts: Facts, highest: float) -> str:
    archive = facts.archive
    if archive is None:
        return "<p>The run does not record what it wanted of its measures: none can be told.</p>"
    count, gone, shown = len(archive), len(facts.gone), len(facts.shown_gone)
    born = f"{count} birth{'' if count == 1 else 's'} that no other ever dominated"
    if not gone:
        return f"<p>{born}, all of them in the last generation.</p>" if count else f"<p>{born}.</p>"
    volume = "hypervolume "
    if archive.hypervolume is not None:
        volume += f"of the archive {number(archive.hypervolume)}, "
    part = "" if shown == gone else f" Of those {gone} the {shown} widest apart are shown."
    return (
        f"<p>{born}, {count - gone} of them alive at the end; {volume}of the last generation "
        f"{number(archive.hypervolume_alive)}. Those that no longer live are in the log all the "
        f"same, for <code>evocity show</code>, <code>score</code> and <code>decode</code> with "
        f"<code>--id</code>.{part}</p>{archive_gallery(facts, highest)}"
    )


def _births(facts: Facts) -> str:
    births = facts.births
    status, operator = births["status"].to_pylist(), births["operator"].to_pylist()
    alive = {row["id"] for row in facts.members}
    born = Counter(operator)
    failed = Counter(o for o, s in zip(operator, status, strict=True) if s != "ok")
    living = Counter(
        o for o, one in zip(operator, births["id"].to_pylist(), strict=True) if one in alive
    )
    by_operator = [(name, count, failed[name], living[name]) for name, count in born.most_common()]
    counted = Counter(status)
    errors = Counter(shortened(text) for text in births["error"].to_pylist() if text)
    return (
        '<div class="tables">'
        + _table(("status", "births"), [(s, counted[s]) for s in STATUSES])
        + _table(("operator", "births", "failed", "alive now"), by_operator)
        + "</div>"
        + (_table(("error", "births"), errors.most_common(12)) if errors else "")
        + f"<details><summary>Every generation</summary>{_generations(facts)}</details>"
    )


def _generations(facts: Facts) -> str:
    history = facts.history
    stride = max(1, -(-len(history) // 400))
    chosen = [*history[:-1:stride], history[-1]]
    headings = ("generation", "births", "failures", "hypervolume", "evaluations/s")
    rows = [
        (
            about["generation"],
            about.get("births", "–"),
            about.get("failures", "–"),
            number(about.get("hypervolume")),
            number(about.get("evaluations_per_second")),
            *(number(about.get("best", {}).get(aim.name), aim.unit) for aim in facts.sought),
        )
        for about in chosen
    ]
    return _table((*headings, *(f"best {aim.name}" for aim in facts.sought)), rows)


def _settings(facts: Facts) -> str:
    every = [*facts.aims, *facts.recorded]
    measures = [(aim.name, aim.unit, aim.wanted, aim.meaning) for aim in every]
    kept = {k: v for k, v in facts.run.provenance.items() if k != "header"}
    rows = [(name, _plainly(value)) for name, value in kept.items()]
    return (
        '<div class="tables">'
        + _table(("measure", "unit", "what is wanted", "what it tells"), measures)
        + (_table(("event", "when, UTC"), facts.times[-12:]) if facts.times else "")
        + "</div>"
        + f"<h3>Recipe, as given</h3>{_replaced(facts)}"
        + f'<pre class="recipe">{_text(facts.run.recipe_text)}</pre>'
        + f"<details><summary>Provenance</summary>{_table(('', ''), rows)}</details>"
    )


def _replaced(facts: Facts) -> str:
    """What the command line put in place of the recipe's values."""
    rows = [(key, _plainly(value)) for key, value in facts.overrides.items()]
    return _table(("replaced on the command line", "by"), rows) if rows else ""


def _plainly(value) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_plainly(item)}" for key, item in value.items())
    if isinstance(value, list):
        return " ".join(map(_plainly, value))
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _table(headings: Sequence[str], rows: Sequence[Sequence]) -> str:
    head = "".join(f"<th>{_text(heading)}</th>" for heading in headings)
    body = "".join(
        "<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
