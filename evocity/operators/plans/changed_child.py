"""A child whose plan changes: its faces, genes and lifs after a change or a seam."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from evocity.operators.plans.changes import renumbering
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.inheritance import InheritedPlan
from evocity.operators.plans.plan import Plan, plan_of
from evocity.operators.plans.planned_child import PlannedChild
from evocity.operators.plans.rebuilding import Filler, moved_from, own_gene, rebuild

#: Most changes of a plan that a child inherits, those of joined plans included.
MOST_CHANGES = 40

#: A second plan with the state of the parent that has it.
Second = tuple[Plan, InheritedPlan]


def base_plans(child: PlannedChild) -> dict[str, Plan]:
    """Return the plans of the founders among the parents, by the names of their cities."""
    return {name: plan_of(child.city(number)) for name, number in child.founders.items()}


def second_plan(child: PlannedChild, rng: np.random.Generator) -> Second | None:
    """Return the plan of the second parent, or draw that of another source city if the second
    parent has the first parent's plan or none that is inherited. None without another plan."""
    pick = rng.random()
    own = child.state
    if own is not None and child.second is not None:
        plan, state = child.second
        if state is not None and state.key != own.key:
            return plan, state
    plans = base_plans(child)
    others = sorted(name for name in plans if own is None or name != own.city)
    if not others:
        return None
    name = others[int(pick * len(others))]
    return plans[name], InheritedPlan(name, len(plans[name]))


def change_plan(
    child: PlannedChild,
    new: Plan,
    change: dict[str, Any],
    fill: Filler,
    second: Second | None = None,
) -> int:
    """Give a child the plan ``new``, which ``change`` makes of its plan, and lay buildings in the
    fresh faces.

    second : the second plan of a seam, with its state. Returns the number of fresh faces; 0 if
    the plan has too many changes, if locked buildings stand in the way or if nothing fits a face.
    The child then stays as it is.
    """
    old = child.plan
    before = () if child.state is None else child.state.changes
    if count_changes((*before, change)) > MOST_CHANGES:
        return 0
    kept = renumbering(old, new)
    if child.locked is not None:
        lost = ~np.isin(old.labels, list(kept)) & (old.labels > 0)
        if (lost & child.locked).any():
            return 0
    city = child.names[0] if child.state is None else child.state.city
    donors = {**child.founders}
    donors.setdefault(city, 0)
    sources = {name: child.city(number) for name, number in donors.items()}
    genes = {
        face: gene for face, gene in child.genes.items() if gene.source in sources and not gene.part
    }
    edited = frozenset(child.edited | (set(child.genes) - set(genes)))
    beyond = None if second is None else _genes_beyond(new, kept, second, sources)
    rebuilt = rebuild(
        old, new, child.intended, genes, sources, city=city, edited=edited, beyond=beyond, fill=fill
    )
    if rebuilt is None:
        return 0
    known = {
        kept[face]: replace(gene, face=kept[face])
        for face, gene in child.genes.items()
        if face in kept
    }
    state = child.state
    if state is not None:
        state = replace(state, faces=len(new), changes=(*state.changes, change))
    halves = {
        kept[face]: replace(gene, face=kept[face])
        for face, gene in child.halves.items()
        if face in kept
    }
    child.replan(new, state, known, {kept[face] for face in child.edited if face in kept})
    child.halves = halves
    child.clear((rebuilt.heights == 0) & (child.intended > 0))
    pairs = {} if second is None else _halves_beyond(new, second, sources)
    for face in sorted(rebuilt.fresh):
        if face in pairs:
            child.lay_halves([donors[gene.source] for gene in pairs[face]], pairs[face])
            continue
        gene = rebuilt.genes.get(face)
        if gene is not None:
            window = new.window(face)
            heights = rebuilt.heights[window][new.lots[window] == face]
            child.lay(donors[gene.source], gene, heights)
    return len(rebuilt.fresh)


def count_changes(changes: Iterable[Mapping[str, Any]]) -> int:
    """Count ``changes`` of a plan, those of plans beyond seams included."""
    return sum(1 + count_changes(change.get("changes", ())) for change in changes)


def _genes_beyond(new: Plan, kept, second: Second, sources) -> dict[int, FaceGene]:
    """Find the genes of the faces beyond a seam: those of the second parent in their places, or
    else the own buildings of its city."""
    plan, state = second
    genes = {
        face: gene for face, gene in state.genes.items() if gene.source in sources and not gene.part
    }
    fresh = sorted(set(range(1, len(new) + 1)) - set(kept.values()))
    found = {}
    for face in fresh:
        gene = moved_from(plan, new, face, genes, frozenset(), state.city)
        found[face] = own_gene(new, face, state.city) if gene is None else gene
    return found


def _halves_beyond(new: Plan, second: Second, sources) -> dict[int, list[FaceGene]]:
    """Find the genes of both halves of faces that a seam leaves as the second parent has them."""
    plan, state = second
    pairs = {}
    for old, face in renumbering(plan, new).items():
        genes = [genes[old] for genes in (state.genes, state.halves) if old in genes]
        if len(genes) == 2 and all(gene.source in sources for gene in genes):
            pairs[face] = [replace(gene, face=face) for gene in genes]
    return pairs


__all__ = ["MOST_CHANGES", "Second", "base_plans", "change_plan", "count_changes", "second_plan"]
