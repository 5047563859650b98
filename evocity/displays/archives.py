"""An archive in a notebook: how many, how good together, and the best by each measure."""

from evocity.displays.maps import TEMPLATES
from evocity.pages import number, templates_of
from evocity.search import Archive

#: Rows that are shown: those furthest from the others, or of a grid the first cells.
_MOST = 20


def archive_html(archive: Archive) -> str:
    """An `Archive` as HTML."""
    table = archive.births
    if "crowding" in table.column_names:
        table = table.sort_by([("crowding", "descending"), ("id", "ascending")])
    names = [name for name in table.column_names if name not in ("crowding", "cell")]
    rows = [[_shown(row[name]) for name in names] for row in table.slice(0, _MOST).to_pylist()]
    alive = sum(archive.births["alive"].to_pylist())
    told = [("births", f"{len(archive)}, {alive} of them alive")]
    if archive.grid is not None:
        told.append(("filled", f"{len(archive) / len(archive.grid):.1%} of the grid"))
    told.append(("hypervolume", number(archive.hypervolume)))
    heads = [name.removeprefix("fitness.") for name in names]
    return (
        templates_of(TEMPLATES)
        .get_template("archive.html")
        .render(
            told=told,
            heads=heads,
            rows=rows,
            left=max(0, len(archive) - _MOST),
        )
    )


def _shown(value: object) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    return number(value) if isinstance(value, float) else str(value)


__all__ = ["archive_html"]
