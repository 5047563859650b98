"""What is bred or grown: genomes, from files and runs, and maps, which are coded first."""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import click
from click.core import ParameterSource

import evocity
from evocity.cli.common import map_options, note_reading, progress_bar
from evocity.cli.encode import Domains, Reach, Sides, check_block
from evocity.cli.given import genome_of, is_genome, is_run, refuse_reading
from evocity.errors import EvocityError

_CODING_OPTIONS = (
    click.option(
        "--block",
        type=Sides(),
        metavar="SIDE|FINEST-LARGEST",
        show_default="as a genome among them, else 2-16",
        help="Sides of the range blocks that maps are coded in, pixels.",
    ),
    click.option(
        "--domains",
        type=Domains(),
        metavar="N[,N…]",
        show_default="2",
        help="Sides of the domain blocks that maps are coded with, in range blocks.",
    ),
    click.option(
        "--reach",
        type=Reach(),
        metavar="PIXELS|all",
        show_default="24",
        help="How far a domain block may lie from its range block when maps are coded.",
    ),
)
_CODING_KEYS = ("block", "domains", "reach")


def parent_options(command: Callable) -> Callable:
    """Add the options by which maps are read and coded; those given arrive as the mappings
    ``reading`` and ``coding``."""

    @functools.wraps(command)
    def gathered(**given):
        source = click.get_current_context().get_parameter_source
        values = {key: given.pop(key) for key in _CODING_KEYS}
        coding = {k: v for k, v in values.items() if source(k) is not ParameterSource.DEFAULT}
        return command(coding=coding, **given)

    for option in reversed(_CODING_OPTIONS):
        gathered = option(gathered)
    return map_options(gathered)


def parents_of(
    sources: Sequence[str],
    identifiers: Sequence[int],
    reading: Mapping[str, object],
    coding: Mapping[str, object],
) -> list:
    """The genomes that ``sources`` stand for.

    identifiers : which individual of each run folder among them, in order.
    reading, coding : how maps are read (`evocity.read_map`) and coded (`evocity.encode`); where
        there is no map, none of these may be given.
    """
    runs = sum(is_run(source) for source in sources)
    if identifiers and len(identifiers) != runs:
        raise EvocityError(
            f"{len(identifiers)} × --id for {runs} run folders",
            "--id N once for each run folder, in their order",
            "give as many, or leave --id out where there is no run",
        )
    individuals = iter(identifiers)
    genomes = {}
    for place, source in enumerate(sources):
        if is_run(source):
            genomes[place] = genome_of(source, next(individuals, None))
        elif is_genome(source):
            genomes[place] = genome_of(source, None)
    if len(genomes) == len(sources):
        refuse_reading("genomes alone", {**reading, **coding})
    for genome in list(genomes.values())[:1]:
        coding = {**_coding_of(genome), **coding}
    for place, source in enumerate(sources):
        if place not in genomes:
            genomes[place] = _coded(source, reading, coding)
    return [genomes[place] for place in range(len(sources))]


def _coding_of(genome) -> dict[str, object]:
    """How maps are coded to breed with ``genome``: in its range blocks, its roofs as they are."""
    p = genome.pavement
    sides = p.block if p.uniform else (p.finest, p.coarsest)
    return {"block": sides, "settle": genome.settle}


def _coded(source: str, reading: Mapping[str, object], coding: Mapping[str, object]):
    """The genome of a map."""
    if Path(source).is_dir():
        raise EvocityError(
            f"{source} is a folder, not that of a run",
            "a genome file, a map, a bundled name, or a run folder with --id",
            "name a file in it, or another folder",
        )
    city = evocity.read_map(source, **reading)
    note_reading(city, reading)
    check_block(city, coding.get("block"))
    with progress_bar(f"coding {city.name}") as progress:
        return evocity.encode(city, progress=progress, **coding).genome
