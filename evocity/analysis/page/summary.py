"""The head of a page: the cities, the state of the run, its figures."""

from typing import Any

from evocity.analysis.births import Births
from evocity.analysis.failed_births import differing_told, failures, shortened
from evocity.analysis.goals import figure_texts
from evocity.analysis.page.shortlist import plain
from evocity.analysis.slope import more_births
from evocity.genome import VOID
from evocity.store import RunLog


def summary_of(run: Any) -> dict:
    """Return the cities, the map, sentences on the state, and figures with ``label``, ``value``,
    ``note``, and ``word`` of the glossary."""
    header, births, status = run.header, run.columns, run.status()
    listed = [
        ("generations", status["generation"], "", "generation"),
        ("births", status["births"], "", "birth"),
        ("failed", status["failures"], reasons(run), ""),
        ("on the front", f"{len(births.front)} of {int(births.alive.sum())}", "", "front"),
    ]
    broken = int((births.alive & ~births.feasible).sum())
    if broken:
        listed.append(
            ("break a constraint", f"{broken} of {int(births.alive.sum())}", "", "constraint")
        )
    if births.has_known_goals:
        listed.append(("in the archive", len(run.archive), "", "archive"))
    listed.append(("hypervolume", plain(status["hypervolume"]), gain(births), "hypervolume"))
    listed += [(name, text, "", name) for name, text in figure_texts(status["algorithm"])]
    listed.append(("seed", header.seed, "", "seed"))
    keys = ("label", "value", "note", "word")
    return {
        "cities": " × ".join(name for name in header.cities if name != VOID),
        "map": f"{header.width} × {header.height} pixels, {header.metres_per_pixel:g} m per pixel",
        "blocks": _sides(run),
        "sentences": _state(run, status),
        "figures": [dict(zip(keys, figure, strict=True)) for figure in listed],
    }


def _sides(run: Any) -> str:
    """Return the sides of the range blocks of the sources' codes, px; "" where there are none."""
    fabric = run.header.chromosome.fabric
    pavements = [one.pavement for s in run.columns.sources if (one := fabric(s.genome))]
    sides = {side for pavement in pavements for side in (pavement.finest, pavement.coarsest)}
    return " to ".join(str(side) for side in sorted({min(sides), max(sides)})) if sides else ""


def _state(run: Any, status: dict) -> list[str]:
    """Describe in sentences: the run is not finished, births differ when replayed, what more births
    would bring."""
    sentences = []
    if not status["finished"]:
        why = f" (stopped: {status['stopped']})" if status["stopped"] else ""
        sentences.append(f"The run is not finished{why}. This page shows whole generations.")
    if unsteady := differing_told(run):
        sentences.append(f"{unsteady}.")
    slope = more_births(run)
    return [*sentences, slope] if slope else sentences


def reasons(run: RunLog) -> str:
    """Return in words why births failed."""
    kinds = failures(run)
    return "; ".join(f"{kind.count} {kind.status}: {shortened(kind.error, 60)}" for kind in kinds)


def gain(births: Births) -> str:
    """Return in words how far the hypervolume is above the first population's."""
    volumes = [about.get("hypervolume") for about in births.history]
    if len(volumes) < 2 or volumes[0] is None or volumes[-1] is None:
        return ""
    first = births.feasible[births.generation == 0]
    if volumes[0] <= 0 or volumes[0] < 0.01 * volumes[-1] or 2 * first.sum() < len(first):
        # a share of next to nothing, or of a few that happened to survive, means nothing
        return f"{volumes[0]:.4g} in the first population"
    return f"{100 * (volumes[-1] / volumes[0] - 1):+.0f} % over the first population"
