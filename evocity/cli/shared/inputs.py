"""Inputs named on the command line: maps, genomes, runs and their individuals, measures."""

import contextlib
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

import click

import evocity
from evocity.cli.shared.checks import check_block
from evocity.cli.shared.terminal import echo, note, note_reading, progress_bar, warn
from evocity.errors import EvocityError, FitnessError, keyword, near_miss, setting, spell

#: Bytes of a Parquet footer that are searched for the metadata of GeoParquet.
MOST_FOOTER = 64 << 20

# -- kinds of inputs ---------------------------------------------------------------------------


def is_genome(source: str) -> bool:
    """Whether a file is a genome: Parquet by its name or by its first bytes, and not GeoParquet."""
    path = Path(source)
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            with open(path, "rb") as file:
                if file.read(4) == b"PAR1":
                    return not _is_geoparquet(file)
    return path.suffix.lower() == ".parquet"


def _is_geoparquet(file: IO[bytes]) -> bool:
    """Whether the footer of a Parquet file holds the metadata of GeoParquet."""
    file.seek(-8, os.SEEK_END)
    length = int.from_bytes(file.read(4), "little")
    file.seek(-8 - min(length, MOST_FOOTER), os.SEEK_END)
    return b'"primary_column"' in file.read(min(length, MOST_FOOTER))


def is_run(source: str) -> bool:
    """Whether ``source`` is the folder of a run."""
    with contextlib.suppress(OSError, ValueError):
        return (Path(source) / "provenance.json").is_file()
    return False


def is_code(source: str) -> bool:
    """Whether the command decodes ``source``, a genome or a run, and does not read it as a map."""
    return is_genome(source) or is_run(source)


def _is_map(source: str) -> bool:
    from evocity.io import suffixes

    name = source.lower()
    return source in evocity.cities() or any(name.endswith(suffix) for suffix in suffixes())


def _refuse_missing(source: str) -> None:
    """Raise `EvocityError` if ``source`` does not exist, and looks like the name of a run
    folder."""
    path = Path(source)
    if path.suffix or os.path.lexists(source) or source in evocity.cities():
        return
    runs = [str(file.parent) for file in path.parent.glob("*/provenance.json")]
    if path.parent == Path() and not near_miss(source, runs):
        return
    raise EvocityError(
        f"nothing is at {spell(source)}"
        + ("" if path.parent.is_dir() else f": there is no folder {spell(str(path.parent))}"),
        "the folder of a run, the file of a map or a genome, or the name of a bundled city",
        near_miss(source, runs) or "check the path; `evocity cities` lists the bundled ones",
    )


def refuse_reading(what: str, reading: Mapping[str, object]) -> None:
    """Raise `EvocityError` for options of reading a map with ``what``, which is not a map."""
    if reading:
        given = ", ".join("--" + key.replace("_", "-") for key in reading)
        raise EvocityError(
            f"{given} cannot be used with {what}",
            "no options for reading maps, because a genome already has a size and heights",
            f"leave out {given}, or encode the map again with {given}",
        )


# -- maps and genomes --------------------------------------------------------------------------


def city_of(source: str, reading: Mapping[str, object], identifier: int | None = None):
    """The map in a file, of a bundled name, or of a genome, which takes no ``reading`` options."""
    if identifier is None and not is_code(source):
        _refuse_missing(source)
        city = evocity.read_map(source, **reading)
        note_reading(city, reading)
        return city
    refuse_reading(f"the {'genome' if is_genome(source) else 'run'} {source}", reading)
    return decode_genome(genome_of(source, identifier), source, identifier)


def genome_of(source: str, identifier: int | None):
    """The genome in a file, or of the individual ``identifier`` of a run folder."""
    if is_run(source) or (identifier is not None and Path(source).is_dir()):
        return _individual(source, identifier)
    _refuse_missing(source)
    if identifier is not None:
        there = os.path.lexists(source) or source in evocity.cities()
        raise EvocityError(
            f"--id {identifier} with {source}, which "
            + ("is not a run folder" if there else "does not exist"),
            "--id with the folder of a run",
            "leave --id out, or name the run's folder" if there else "check the run's name",
        )
    if not is_genome(source) and (_is_map(source) or Path(source).is_dir()):
        is_folder = Path(source).is_dir()
        raise EvocityError(
            f"{source} is {'a folder, but not the folder of a run' if is_folder else 'a map'}",
            "a genome file, or a run folder with --id",
            "name a genome file in it, or another folder"
            if is_folder
            else f"make a genome of the map: evocity encode {source} -o GENOME.parquet",
        )
    from evocity.kinds.form_files import read_chromosome

    return read_chromosome(source)


def _individual(folder: str, identifier: int | None):
    run = evocity.open_run(folder)
    last = run.generations[-1:]
    if identifier is not None:
        return run.genome(identifier)
    front = [row["id"] for g in last for row in run.members(g).to_pylist() if row["rank"] == 0]
    example = f"; for example --id {front[0]}, of the last front" if front else ""
    raise EvocityError(
        f"{folder} is a run folder, which contains many genomes",
        "the option --id N, where N is the number of an individual",
        f"look up the number under the pictures of {Path(folder) / 'report.html'}, or in "
        f"`evocity status {folder}`{example}",
    )


def fabric_in(genome, source: str):
    """The fabric in a ``genome`` from ``source``. Raises `EvocityError` without fabric."""
    from evocity.genome import Genome

    fabric = genome if isinstance(genome, Genome) else getattr(genome, "whole", None)
    if fabric is None:
        raise EvocityError(
            f"{source} is a {genome.kind}, and a {genome.kind} has no range blocks",
            "a genome with range blocks, such as the genome of a city",
            "draw the picture with evocity show, without options for range blocks",
        )
    return fabric


def decode_genome(genome, source: str, identifier: int | None, zoom: float = 1.0):
    """The named map of a ``genome``. Only fabrics have a ``zoom``; others raise `EvocityError`."""
    if getattr(genome, "kind", "fabric") == "fabric":
        name = source if identifier is None else f"{source} --id {identifier}"
        city = warn_unconverged(evocity.decode(genome, zoom=zoom), name).city
        name = city.name
    else:
        if zoom != 1:
            raise EvocityError(
                f"{setting('zoom', zoom)} cannot be used with a {genome.kind}",
                "the genome of a city fabric, because only city fabrics decode at any zoom",
                f"leave {keyword('zoom')} out",
            )
        city = genome.city
        name = city.name or genome.kind
    return city.replace(city.heights, name=name_decoded(name, genome, source, identifier))


def name_decoded(name: str, genome, source: str, identifier: int | None) -> str:
    """The name of a decoded map, with the operator of a bred ``genome``."""
    if identifier is None:
        operator = str(genome.made.get("operator", "encode"))
        bred = "" if operator == "encode" else f", {operator}"
        return f"{name}{bred}, decoded"
    return f"{Path(source).resolve().name}, individual {identifier}"


def warn_unconverged(decoding, source: str):
    """Return the ``decoding``; warn if its last step still changed the map."""
    if not decoding.converged:
        warn(
            f"{source} did not converge in {decoding.iterations} steps: "
            f"the last one moved a pixel by {decoding.change:.3g} m"
        )
    return decoding


def place_at(run: str, at: str) -> dict:
    """Fields of the place on Earth of the source city ``at`` of a ``run``, for ``replace``."""
    if not is_run(run):
        raise EvocityError(
            f"{setting('at', at)} cannot be used with {run}, which is not a run folder",
            "a run folder, because it contains the coordinates of the source cities",
            f"leave {keyword('at')} out",
        )
    from evocity.analysis.individual import place_of

    return place_of(evocity.open_run(run), at)


def note_nowhere(run: str, genome, city) -> None:
    """Suggest --at for the ``city`` of a ``run``, if it has no place because the source cities of
    its ``genome`` lie in several places."""
    from evocity.genome import Genome

    if city.crs is not None or not is_run(run) or not isinstance(genome, Genome):
        return
    from evocity.analysis.individual import ground_of

    shares = dict(zip(genome.cities, genome.shares.tolist(), strict=True))
    ground = ground_of(shares, evocity.open_run(run).sources())
    if ground is not None:
        note(
            "the map lies nowhere on Earth, since its parents lie in several places; "
            f"--at {shlex.quote(ground)} puts it on the ground of its main parent"
        )


# -- measures and their cases ------------------------------------------------------------------


def measures_of(word: str) -> list:
    """The measures that ``word`` names: a measure, a function, an executed file, or a table."""
    fitness = evocity.fitness
    if word.endswith((".py", ".toml")):
        return fitness.load_file(word)
    try:
        return fitness.named(word)
    except FitnessError as error:
        if Path(f"{word}.py").is_file():
            raise FitnessError(error.found, error.expected, f"did you mean {word}.py?") from error
        raise


def case_of(source: str, reading: Mapping[str, object], identifier: int | None = None):
    """The `Case` to measure, with genome, parents and sources where ``source`` has them."""
    from evocity.fitness.check import Case

    city = city_of(source, reading) if identifier is None and not is_code(source) else None
    if city is not None:
        return Case(city)
    refuse_reading(f"the {'genome' if is_genome(source) else 'run'} {source}", reading)
    genome = genome_of(source, identifier)
    city = decode_genome(genome, source, identifier)
    if identifier is None:
        return Case(city, genome)
    run = evocity.open_run(source)
    sources = [parent.city for parent in run.sources()]
    reference = evocity.fitness.Reference.sources(sources)
    parents = run.parents(run.individuals([identifier]))[0]
    return Case(city, genome, parents, reference=reference, sources=sources)


# -- parents of a child ------------------------------------------------------------------------


def individuals_of(sources: Sequence[str], identifiers: Sequence[int]) -> list[int | None]:
    """The individual of each of ``sources`` that is a run, by the --id in order; else None."""
    runs = sum(is_run(source) for source in sources)
    if identifiers and len(identifiers) != runs:
        raise EvocityError(
            f"the number of --id options is {len(identifiers)}, but the number of run folders is "
            f"{runs}",
            "one --id N for each run folder, in the order of the run folders",
            "write one --id for each run folder, or leave out --id if there is no run folder",
        )
    numbers = iter(identifiers)
    return [next(numbers, None) if is_run(source) else None for source in sources]


def parents_of(
    sources: Sequence[str],
    identifiers: Sequence[int],
    reading: Mapping[str, object],
    coding: Mapping[str, object],
) -> list:
    """The genomes of ``sources``: read, decoded from runs, or coded from maps. If no source is a
    map, options of ``reading`` and ``coding`` raise `EvocityError`."""
    individuals = individuals_of(sources, identifiers)
    genomes = {
        place: genome_of(source, individuals[place])
        for place, source in enumerate(sources)
        if is_code(source)
    }
    if len(genomes) == len(sources):
        refuse_reading("only genomes", {**reading, **coding})
    for genome in list(genomes.values())[:1]:
        coding = {**_coding_of(genome), **coding}
    for place, source in enumerate(sources):
        if place not in genomes:
            genomes[place] = _encode_map(source, reading, coding)
    return [genomes[place] for place in range(len(sources))]


def _coding_of(genome) -> dict[str, object]:
    """How maps are coded to breed with ``genome``: in its range blocks, its roofs as they are."""
    p = genome.pavement
    sides = p.block if p.uniform else (p.finest, p.coarsest)
    return {"block": sides, "settle": genome.settle}


def _encode_map(source: str, reading: Mapping[str, object], coding: Mapping[str, object]):
    """The genome of a map."""
    if Path(source).is_dir():
        raise EvocityError(
            f"{source} is a folder, but not the folder of a run",
            "a genome file, a map file, the name of a bundled district, or a run folder with --id",
            "name a file in this folder, or name a run folder",
        )
    city = evocity.read_map(source, **reading)
    note_reading(city, reading)
    check_block(city, coding.get("block"))
    with progress_bar(f"coding {city.name}") as progress:
        return evocity.encode(city, progress=progress, **coding).genome


# -- trust in a run ----------------------------------------------------------------------------


def confirm_trust(run: Path, trust: bool) -> bool:
    """Whether to execute the files of ``run``: ``trust``, or the user's answer at a terminal."""
    if trust or not _at_terminal():
        return trust
    from evocity.search.preparation.trust import list_untrusted

    brought = []
    with contextlib.suppress(EvocityError, LookupError, TypeError, AttributeError):  # raised later
        brought = list_untrusted(evocity.open_run(run))
    if not brought:
        return False
    echo(
        f"{run} was not started on this machine, and would execute files or commands:",
        err=True,
    )
    for text in brought:
        echo(f"  {text}", err=True)
    return click.confirm("Do you know and trust all of these?", err=True)


def _at_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()
