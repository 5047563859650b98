"""Words of the report that a newcomer does not know, a sentence each. `docs/glossary.md` has them
all, and where they are from."""

from collections.abc import Sequence

from evocity.analysis import Aim
from evocity.fitness import measures
from evocity.fitness.part import own_name

#: Word -> what it is. The templates explain it where it first stands, and list all at the end.
WORDS = {
    "birth": "One child: bred, decoded, measured and written down, whether it lives on or not.",
    "generation": (
        "So many births as the population has places, and then the choice of who lives on."
    ),
    "genome": "A city coded as an iterated function system: one lifs a range block.",
    "lifs": (
        "A gene: the one function that rebuilds one square of the map, its range block, from a "
        "larger one."
    ),
    "range block": "A square of the map that one lifs rebuilds; they tile the map without gap.",
    "operator": "What makes a child of one parent or several: mutation, crossover or fusion.",
    "constraint": (
        "A measure that must lie between bounds. Whoever keeps all constraints comes before "
        "whoever breaks one."
    ),
    "dominate": "To be at least as good in every goal, and better in one.",
    "front": "Those that nobody dominates: a set of compromises, not one best city.",
    "rank": "0 for the front, 1 for the front of the others, and so on.",
    "archive": (
        "Of all births ever, those that no other dominates, or the best of each cell of a grid; "
        "some no longer live."
    ),
    "hypervolume": (
        "The volume of all scores that one of the living reaches or surpasses: how much they "
        "reach together."
    ),
    "crowding": "How far the neighbours of a birth are along its front: the wider, the rarer.",
    "compromise": (
        "The one that is least behind the best, in the goal where it is farthest behind."
    ),
    "island": "One of several populations in a run; their best migrate between them.",
    "qd score": (
        "Quality-diversity score: how far the best of each filled cell of the grid is better than "
        "a reference point, summed."
    ),
    "coverage": "Which share of the grid's cells is filled.",
    "cells": "How many cells of the grid are filled.",
    "seed": "The number that all draws of a run come from: the same seed gives the same births.",
}


def told_measures(logged: Sequence[Aim]) -> tuple[dict[str, str], dict[str, str]]:
    """What measures say, in a line each: those that a run ``logged``, by their names there; and
    all others of maps that are known here."""
    known = {
        one.name: f"{one.summary} {one.told_range} {one.unit}".rstrip() for one in measures(None)
    }
    told = {}
    for aim in logged:
        own = f"{aim.meaning or 'A measure of its own.'} {aim.unit}".rstrip()
        told[aim.name] = known.get(own_name(aim.name), own)
    names = {own_name(name) for name in told}
    others = [one.name for one in measures() if one.name not in names]
    return told, {name: known[name] for name in others}


__all__ = ["WORDS", "told_measures"]
