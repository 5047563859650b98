"""What was named on the command line: a map, a genome, a run, or one individual of a run? And
which measures?"""

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path

import click

import evocity
from evocity.cli.common import converged, note_reading
from evocity.errors import EvocityError, FitnessError, keyword, near_miss, setting, shown


def one_id(told: tuple) -> int | None:
    """The one value of ``--id``, or None: of two none is left out in silence."""
    if len(told) > 1:
        raise EvocityError(
            " ".join(f"--id {one}" for one in told),
            "--id once",
            "name one individual; call the command again for the next",
        )
    return told[0] if told else None


def one_of(context: click.Context, option: click.Parameter, told: tuple) -> int | None:
    """`one_id` as the callback of an option."""
    return one_id(told)


id_option = click.option(
    "--id",
    "identifier",
    type=int,
    multiple=True,
    callback=one_of,
    metavar="N",
    show_default="none",
    help="Which individual of a run folder, by the number its report and `status` give it.",
)


at_option = click.option(
    "--at",
    metavar="CITY",
    show_default="where all source cities lie, else nowhere on Earth",
    help="Source city of the run on whose ground the map is laid, in its reference system.",
)


def place_at(run: str, at: str) -> dict:
    """Where on Earth the source city ``at`` of a ``run`` lies, for ``replace``. Raises
    `EvocityError` for what is no run, and no such city."""
    if not is_run(run):
        raise EvocityError(
            f"{setting('at', at)} with {run}, which is no run folder",
            "the folder of a run, whose source cities lie on Earth",
            f"leave {keyword('at')} out",
        )
    from evocity.analysis.placing import place_of

    return place_of(evocity.open_run(run), at)


def ids_option(told: str):
    """The option ``--id`` of a command that takes several runs; ``told`` is its help."""
    return click.option(
        "--id",
        "identifiers",
        type=int,
        multiple=True,
        metavar="N",
        show_default="none",
        help=told,
    )


def is_genome(source: str) -> bool:
    """Whether a file is meant to be a genome: Parquet by its name or by its first bytes."""
    path = Path(source)
    if path.suffix.lower() == ".parquet":
        return True
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            with open(path, "rb") as file:
                return file.read(4) == b"PAR1"
    return False


def is_run(source: str) -> bool:
    """Whether ``source`` is the folder of a run."""
    with contextlib.suppress(OSError, ValueError):
        return (Path(source) / "provenance.json").is_file()
    return False


def _refuse_missing(source: str) -> None:
    """Raise `EvocityError` for a ``source`` that is not there, and by its name may be a run's
    folder: it has a folder before it, or is nearly a run's."""
    path = Path(source)
    if path.suffix or os.path.lexists(source) or source in evocity.cities():
        return
    runs = [str(one.parent) for one in path.parent.glob("*/provenance.json")]
    if path.parent == Path() and not near_miss(source, runs):
        return
    raise EvocityError(
        f"nothing is at {shown(source)}"
        + ("" if path.parent.is_dir() else f": there is no folder {shown(str(path.parent))}"),
        "the folder of a run, the file of a map or a genome, or the name of a bundled city",
        near_miss(source, runs) or "check the path; `evocity cities` lists the bundled ones",
    )


def genome_of(source: str, identifier: int | None):
    """The genome in a file, or of the individual ``identifier`` of a run folder."""
    if is_run(source) or (identifier is not None and Path(source).is_dir()):
        return _individual(source, identifier)
    _refuse_missing(source)
    if identifier is not None:
        there = os.path.lexists(source) or source in evocity.cities()
        raise EvocityError(
            f"--id {identifier} with {source}, which "
            + ("is no run folder" if there else "does not exist"),
            "--id with the folder of a run",
            "leave --id out, or name the run's folder" if there else "check the run's name",
        )
    if not is_genome(source) and (_is_map(source) or Path(source).is_dir()):
        kind = "a folder, not that of a run" if Path(source).is_dir() else "a map"
        raise EvocityError(
            f"{source} is {kind}",
            "a genome file, or a run folder with --id",
            f"a map becomes a genome by: evocity encode {source} -o GENOME.parquet"
            if kind == "a map"
            else "name a genome file in it, or another folder",
        )
    return _read(source)


def _read(source: str):
    """The genome in a file, of whatever kind."""
    from evocity.forms.files import is_form, read_form

    return read_form(source) if is_form(source) else evocity.read_genome(source)


def fabric_in(genome, source: str):
    """What of a ``genome`` from ``source`` is fabric. Raises `EvocityError` where nothing is."""
    from evocity.genome import Genome

    found = genome if isinstance(genome, Genome) else getattr(genome, "whole", None)
    if found is None:
        raise EvocityError(
            f"{source}: a {genome.kind}, in which nothing is made of stones",
            "a genome of a city",
            "leave the option out; its picture is there: evocity show",
        )
    return found


def city_of(source: str, reading: Mapping[str, object], identifier: int | None = None):
    """The map in a map file, of a bundled name, or the one a genome decodes to.

    ``reading``: options of `evocity.read_map`; a genome, from a file or a run, takes none.
    """
    if identifier is None and not is_genome(source) and not is_run(source):
        _refuse_missing(source)
        city = evocity.read_map(source, **reading)
        note_reading(city, reading)
        return city
    what = f"the genome {source}" if is_genome(source) else f"the run {source}"
    refuse_reading(what, reading)
    return decoded(genome_of(source, identifier), source, identifier)


def case_of(source: str, reading: Mapping[str, object], identifier: int | None = None):
    """What to measure, a `Case`: the map as `city_of` finds it; of a genome also the genome; of an
    individual of a run those it was bred from, and the run's source cities, which it is made of and
    compared with."""
    from evocity.authoring import Case

    if identifier is None and not is_genome(source) and not is_run(source):
        return Case(city_of(source, reading))
    refuse_reading(f"the {'genome' if is_genome(source) else 'run'} {source}", reading)
    genome = genome_of(source, identifier)
    city = decoded(genome, source, identifier)
    if identifier is None:
        return Case(city, genome)
    sources = [one.city for one in evocity.open_run(source).sources()]
    reference = evocity.fitness.Reference.sources(sources)
    parents = _parents(source, identifier)
    return Case(city, genome, parents, reference=reference, sources=sources)


def _parents(folder: str, identifier: int) -> tuple:
    """The genomes an individual of a run was bred from; a source city is its own parent."""
    run = evocity.open_run(folder)
    return run.parents(run.individuals([identifier]))[0]


def measures_of(word: str) -> list:
    """The measures that ``word`` names: one; all numbers of a function that returns several; or
    those of a Python file, which is executed, or of a table of building types. Raises
    `FitnessError`."""
    fitness = evocity.fitness
    if word.endswith((".py", ".toml")):
        return fitness.load_file(word)
    try:
        return fitness.named(word)
    except FitnessError as error:
        if Path(f"{word}.py").is_file():
            raise FitnessError(error.found, error.expected, f"did you mean {word}.py?") from error
        raise


def decoded(genome, source: str, identifier: int | None, zoom: float = 1.0):
    """The map that a ``genome`` from ``source`` stands for, called what it is."""
    name = source if identifier is None else f"{source} --id {identifier}"
    if getattr(genome, "kind", "fabric") != "fabric":
        return _formed(genome, source, identifier, zoom)
    city = converged(evocity.decode(genome, zoom=zoom), name).city
    return city.replace(city.heights, name=decoded_name(city.name, genome, source, identifier))


def _formed(form, source: str, identifier: int | None, zoom: float):
    """The map of a form, at the size it has."""
    if zoom != 1:
        raise EvocityError(
            f"{setting('zoom', zoom)} of a {form.kind}",
            "a fabric, which decodes at any size",
            f"leave {keyword('zoom')} out",
        )
    city = form.city
    name = decoded_name(city.name or form.kind, form, source, identifier)
    return city.replace(city.heights, name=name)


def decoded_name(name: str, genome, source: str, identifier: int | None) -> str:
    """What a decoded map is called in pictures and tables: of a bred ``genome`` by which operator,
    since a child of one parent has its cities."""
    if identifier is None:
        operator = str(genome.made.get("operator", "encode"))
        bred = "" if operator == "encode" else f", {operator}"
        return f"{name}{bred}, decoded"
    return f"{Path(source).resolve().name}, individual {identifier}"


def refuse_reading(what: str, reading: Mapping[str, object]) -> None:
    """Raise if there are options of reading a map with ``what`` is none."""
    if reading:
        given = ", ".join("--" + key.replace("_", "-") for key in reading)
        raise EvocityError(
            f"{given} with {what}",
            "no options of reading: a genome knows its own size and heights",
            f"leave {given} out, or encode the map again with it",
        )


def _individual(folder: str, identifier: int | None):
    run = evocity.open_run(folder)
    last = run.generations[-1:]
    if identifier is not None:
        return run.genome(identifier)
    front = [row["id"] for g in last for row in run.members(g).to_pylist() if row["rank"] == 0]
    example = f"; for example --id {front[0]}, of the last front" if front else ""
    raise EvocityError(
        f"{folder} is a run, with many genomes",
        "--id N, the number of one individual",
        f"find it under the pictures of {Path(folder) / 'report.html'}, or in "
        f"`evocity status {folder}`{example}",
    )


def _is_map(source: str) -> bool:
    from evocity.io import suffixes

    name = source.lower()
    return source in evocity.cities() or any(name.endswith(suffix) for suffix in suffixes())
