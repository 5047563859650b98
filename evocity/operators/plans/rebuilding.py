"""Buildings for the faces that a change of a plan makes: moved genes, and new ones where needed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.operators.plans.changes import renumbering
from evocity.operators.plans.donor import donor_of
from evocity.operators.plans.fill import SLACK
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.laying import Lot, lay_piece, lot_of
from evocity.operators.plans.plan import Plan

#: Largest loss of front of a changed face that keeps its buildings, as a share of the outline.
LOSS = 0.15

#: Finds buildings for a face of a plan, or None: a gene and the heights of the lot.
Filler = Callable[[Plan, int], tuple[FaceGene, np.ndarray] | None]


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """A changed plan with the genes of its faces.

    plan : the changed plan. genes : the gene of each face that has one. edited : numbers of faces
    whose buildings come neither from a gene nor from the plan's own map. fresh : numbers of the
    faces that the change made. heights : float32 ``(H, W)``, metres, with the buildings of fresh
    faces, and those of the map before elsewhere.
    """

    plan: Plan
    genes: dict[int, FaceGene]
    edited: frozenset[int]
    fresh: frozenset[int]
    heights: np.ndarray


def rebuild(
    old: Plan,
    new: Plan,
    heights: np.ndarray,
    genes: Mapping[int, FaceGene],
    sources: Mapping[str, CityMap],
    *,
    city: str,
    edited: frozenset[int] = frozenset(),
    beyond: Mapping[int, FaceGene] | None = None,
    fill: Filler | None = None,
) -> Rebuilt | None:
    """Lay buildings in the faces that a change made.

    A fresh face gets the buildings of the face that covers most of it, from the same places, cut
    along the new outline. Where these do not fit, ``fill`` finds others. An open face gets none.

    old, new : the plan before and after the change. heights : float32 ``(H, W)``, metres, of the
    map before. genes, edited : those of the faces of ``old``. sources : source cities by the names
    in genes. city : the city of faces without a gene. beyond : genes of fresh faces that a seam
    brings. Returns None if nothing fits a fresh face.
    """
    kept = renumbering(old, new)
    fresh = sorted(set(range(1, len(new) + 1)) - set(kept.values()))
    known = {
        kept[face]: replace(gene, face=kept[face]) for face, gene in genes.items() if face in kept
    }
    marked = frozenset(kept[face] for face in edited if face in kept)
    heights = heights.copy()
    free = np.zeros(len(new) + 1, bool)
    free[fresh] = True
    # streets beside fresh faces too
    stale = ~np.isin(old.labels, list(kept)) & (old.labels > 0)
    heights[(stale | free[new.labels]) & (new.lots == 0)] = 0
    for face in fresh:
        lot = lot_of(new, face)
        if new.open[face - 1] or not lot.mask.any():
            heights[lot.window][lot.mask] = 0
            continue
        gene = (beyond or {}).get(face)
        if gene is None and beyond is None:
            gene = moved_from(old, new, face, genes, edited, city)
        laid = None if gene is None else _lay(lot, new, gene, sources, beyond is None)
        found = None if gene is None or laid is None else (gene, laid)
        if found is None and fill is not None:
            found = fill(new, face)
        if found is None:
            return None
        known[face], heights[lot.window][lot.mask] = found
    return Rebuilt(new, known, marked, frozenset(fresh), heights)


def moved_from(
    old: Plan,
    new: Plan,
    face: int,
    genes: Mapping[int, FaceGene],
    edited: frozenset[int],
    city: str,
) -> FaceGene | None:
    """Move the gene of the face that covers most of a fresh face; None if that face is edited or
    open."""
    window = new.window(face)
    counts = np.bincount(old.labels[window][new.labels[window] == face], minlength=len(old) + 1)
    source = int(counts[1:].argmax()) + 1
    if source in edited or old.open[source - 1]:
        return None
    gene = genes.get(source) or own_gene(old, source, city)
    if gene.part:  # a half of the old lot is not a half of the new one
        return None
    return move_gene(gene, old, new, face)


def own_gene(plan: Plan, face: int, city: str) -> FaceGene:
    """Make the gene of the buildings that stand in a ``face`` in the ``city`` of the plan."""
    row, column = plan.centre[face - 1].tolist()
    return FaceGene(face, city, row, column, 0.0)


def move_gene(gene: FaceGene, old: Plan, new: Plan, face: int) -> FaceGene:
    """Move a gene of ``old`` to a ``face`` of ``new``, so that each building stays in its place."""
    pixel = new.metres_per_pixel
    down, along = (new.centre[face - 1] - old.centre[gene.face - 1]) * pixel
    rows, columns = gene.offsets(down, along)
    return replace(
        gene,
        face=face,
        row=gene.row + float(rows) / pixel,
        column=gene.column + float(columns) / pixel,
    )


def _lay(
    lot: Lot, plan: Plan, gene: FaceGene, sources: Mapping[str, CityMap], strict: bool
) -> np.ndarray | None:
    """Lay the buildings of a gene: the heights of the lot; None where they do not fit."""
    source = sources[gene.source]
    height, width = source.shape
    if not (0 <= gene.row <= height and 0 <= gene.column <= width):
        return None
    result = lay_piece(lot, gene, donor_of(source))
    if not strict:
        return result
    built = result > BUILT_ABOVE
    face = gene.face - 1
    front = float(np.mean(built[lot.strip])) if lot.strip.any() else 1.0
    fits = abs(np.mean(built) - plan.coverage[face]) <= SLACK and front >= plan.front[face] - LOSS
    return result if fits else None


__all__ = ["Filler", "Rebuilt", "move_gene", "moved_from", "own_gene", "rebuild"]
