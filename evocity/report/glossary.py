"""Words of the report that a newcomer may not know, explained in a sentence or two each.
`docs/glossary.md` has all of them, with their sources."""

from collections.abc import Sequence

from evocity.analysis import Aim
from evocity.fitness import measures
from evocity.fitness.part import own_name

#: Word -> explanation. Templates explain a word at its first place, and list all at the end.
WORDS = {
    "birth": "One child: bred, decoded, measured and logged, whether it survives or not.",
    "generation": (
        "As many births as the population has places, and then the selection of the survivors."
    ),
    "genome": "A city coded as an iterated function system: one lifs per range block.",
    "lifs": (
        "A gene: the function that rebuilds one square of the map, its range block, from a "
        "larger square."
    ),
    "range block": "A square of the map that one lifs rebuilds. Range blocks tile the whole map.",
    "operator": (
        "A function that makes a child of one parent or several: mutation, crossover or fusion."
    ),
    "constraint": (
        "A measure that must lie between bounds. Individuals that keep all constraints rank "
        "before those that break one."
    ),
    "dominate": "To be at least as good in every goal, and better in one.",
    "front": "The individuals that no other dominates: a set of compromises, not one best city.",
    "rank": "0 for the front, 1 for the front of the others, and so on.",
    "archive": (
        "The births of the whole run that no other dominates, or the best of each cell of a "
        "grid. Some are no longer alive."
    ),
    "hypervolume": (
        "The volume of all scores that the living reach or surpass: how good they are together."
    ),
    "crowding": "The distance of a birth from its neighbours on the front: the larger, the rarer.",
    "compromise": (
        "The individual whose largest distance from the best of any goal is the smallest."
    ),
    "island": "One of several populations in a run. Their best individuals migrate between them.",
    "qd score": (
        "Quality-diversity score: the sum, over the filled cells of the grid, of how far the best "
        "of each is better than a reference point."
    ),
    "coverage": "The share of the grid's cells that are filled.",
    "cells": "The number of the grid's cells that are filled.",
    "seed": "The number behind all random draws of a run: the same seed gives the same births.",
}


def measure_texts(logged: Sequence[Aim]) -> tuple[dict[str, str], dict[str, str]]:
    """Explain the measures that a run ``logged``, and all other known measures of maps, in a line
    each."""
    known = {
        one.name: f"{one.summary} {one.range_text} {one.unit}".rstrip() for one in measures(None)
    }
    texts = {}
    for aim in logged:
        own = f"{aim.meaning or 'A measure of its own.'} {aim.unit}".rstrip()
        texts[aim.name] = known.get(own_name(aim.name), own)
    names = {own_name(name) for name in texts}
    others = [one.name for one in measures() if one.name not in names]
    return texts, {name: known[name] for name in others}
