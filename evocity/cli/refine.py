"""`evocity refine`: an optimiser improves one individual of a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_needs, check_output, report_write_errors
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import confirm_trust
from evocity.cli.shared.options import (
    WHOLE,
    accept_changes_option,
    json_option,
    map_options,
    option,
    output_option,
    required_id_option,
    trust_option,
)
from evocity.cli.shared.terminal import (
    echo,
    note,
    note_compiling,
    note_reading,
    print_json,
    print_table,
    progress_bar,
    quiet_stdout,
)
from evocity.errors import EvocityError


@command("""
  evocity refine runs/lyon-x-montpellier --id 97 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --with 103 --side 6 --budget 400 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way heights -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way fit --towards lyon-1er -o near.parquet

The genome can be a parent of another run: [[parents]] genome = "better.parquet".""")
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@required_id_option
@output_option("GENOME", "Genome file to write, usually .parquet")
@option(
    "--way",
    "Object that the optimiser tunes: the fabric of street blocks, the heights of street "
    "blocks, the parameters of the operator, or all lifs (affine maps).",
    click.Choice(["lambda_field", "heights", "parameters", "fit"]),
    "lambda_field",
)
@option("--budget", "Largest number of evaluations.", click.IntRange(1, 1_000_000), 200)
@option("--algorithm", "Algorithm of NLopt.", click.Choice(["sbplx", "cobyla", "bobyqa"]), "sbplx")
@option(
    "--side",
    "Number of rows, and of columns, in the square grid of numbers that the optimiser tunes "
    "over the map.",
    click.IntRange(1, 16),
    4,
)
@option(
    "--rounds",
    "Number of rounds for --way lambda_field. [one for each ten evaluations; 4 with cobyla and "
    "bobyqa]",
    click.IntRange(1, 1000),
)
@option(
    "--seed",
    "Seed of the random choice of the individuals whose fabric the command uses.",
    WHOLE,
    0,
)
@option(
    "--with others N...",
    "Number of an individual whose fabric --way lambda_field can use. [a living one and a variant,"
    " each round]",
    WHOLE,
)
@option("--tune KEY...", "Parameter to tune with --way parameters. [all numbers]")
@option(
    "--towards MAP",
    "Map that --way fit approaches; the command reads this map with the window and the "
    "pixels of the run.",
)
@accept_changes_option
@trust_option
@map_options
@json_option
def refine(
    run: Path,
    identifier,
    output,
    way,
    budget,
    others,
    tune,
    towards,
    trust,
    reading,
    as_json,
    **how,
) -> None:
    """Improve an individual of RUN with an optimiser, and write the improved genome.

    To score an individual, the command adds up the losses of all goals. The command divides each
    loss by the range of the goal's values in the first generation. An individual that breaks
    constraints is always worse than an individual that breaks no constraint. With --way fit, the
    score is the distance between the decoded map and the map given by --towards. If the optimiser
    finds nothing better, the command writes the unchanged genome of the individual. The run stays
    unchanged, and may still be in progress. The command executes the Python files of measures that
    the recipe names.

    With --way lambda_field, the optimiser chooses the street blocks that get the fabric of other
    individuals. With --way lambda_field, each round starts from the best result of all earlier
    rounds, and uses fabric of newly chosen individuals. With --way heights, the optimiser tunes the
    heights of street blocks. With --way parameters, the optimiser tunes the parameters of the
    operator that bred the individual, and replays the birth. With --way fit, the command tunes all
    lifs until the decoded map is as close as possible to the map given by --towards. With --way
    fit, the command uses its own algorithm instead of NLopt.

    The JSON document has the keys "id", "way", "better", "bred", "evaluations", "failures",
    "others", "score" and "values". With --way fit, the key "distance" contains the root-mean-square
    distance, in metres, between the decoded map and the map given by --towards. The key "bred"
    counts all children that the command bred. The command measures children with identical genomes
    only once. The keys "score", "values" and "distance" contain the results before and after the
    refinement.
    """
    opened = evocity.open_run(run)
    check_output(output, str(run))
    if run.resolve() in output.resolve().parents:
        raise EvocityError(
            f"{str(output)!r} is in the folder of the run",
            "an output file outside the folder of the run",
            "choose another name after -o",
        )
    _check_options(way, others, tune, towards, reading)
    note_compiling()
    target = None if towards is None else _read_target(towards, opened, reading)
    with quiet_stdout(), progress_bar(f"refining {identifier}") as bar:
        result = evocity.refine(
            opened,
            identifier,
            way=way,
            budget=budget,
            others=others or None,
            tune=tune,
            towards=target,
            trust=confirm_trust(run, trust),
            progress=None if bar is None else lambda done, _: bar(done, budget),
            **how,
        )
    with report_write_errors(output):
        result.genome.write(output)
    if result.failures:
        note(f"{result.failures} of {result.evaluations} failed, the first: {result.error}")
    if not result.better:
        note(f"no better individual found: {output} holds individual {identifier} as it is")
    if way != "fit" and result.evaluations < budget:
        note(_describe_early_end(result, way, budget))
    distances = None
    if target is not None:
        distances = [_distance(one, target) for one in (opened.genome(identifier), result.genome)]
    if as_json:
        pairs = {
            "score": (result.score_before, result.score),
            "values": (dict(result.before), dict(result.values)),
        }
        if distances is not None:
            pairs["distance"] = tuple(distances)
        facts = {key: getattr(result, key) for key in ("better", "bred", "evaluations", "failures")}
        facts["others"] = list(result.others)
        changes = {
            k: dict(zip(("before", "after"), pair, strict=True)) for k, pair in pairs.items()
        }
        print_json({"id": identifier, "way": way} | facts | changes)
        return
    offered = f", fabric of {', '.join(map(str, result.others))}" if result.others else ""
    echo(f"individual {identifier}: {way}{offered}, {result.evaluations} evaluations")
    rows = [("", "before", "after")]
    for name, value in result.before.items():
        after = f"{result.values[name]:.4g}" if name in result.values else "–"
        rows.append((name, f"{value:.4g}", after))
    losses = "sum of losses, less is better"
    rows.append((losses, f"{result.score_before:.4g}", f"{result.score:.4g}"))
    if distances is not None:
        rows.append((f"m from {target.name} (RMS)", *(f"{metres:.4g}" for metres in distances)))
    print_table(rows)
    echo(f"wrote {output}")


def _describe_early_end(result, way: str, budget: int) -> str:
    """Why there are fewer evaluations than the ``budget`` allows, and what to do."""
    other = {
        "lambda_field": "offer the fabric of others with --with, or a finer field with --side",
        "heights": "choose a finer field with --side",
        "parameters": "tune other parameters with --tune",
    }[way]
    if not result.evaluations:
        return (
            f"all {result.bred} children have the genome of the individual: this way changes "
            f"nothing; {other}, or choose another --way"
        )
    return (
        f"{result.evaluations} of {budget} evaluations: the optimiser settled; of {result.bred} "
        f"children, {result.evaluations} differ. To go further, {other}"
    )


def _distance(genome, target) -> float:
    """Metres by which the heights of a genome's map differ from a ``target``, root mean square."""
    heights = evocity.decode(genome).city.heights
    return float(((heights - target.heights) ** 2).mean(dtype=float) ** 0.5)


def _check_options(way: str, others, tune, towards, reading) -> None:
    """Raise `EvocityError` for options of another way, and for missing ones."""
    own_way = {"--with": (others, "lambda_field"), "--tune": (tune, "parameters")}
    own_way |= {"--towards": (towards, "fit")}
    for option_name, (given, own) in own_way.items():
        if given and way != own:
            raise EvocityError(
                f"{option_name} cannot be used with --way {way}",
                f"{option_name} only together with --way {own}",
                f"leave out {option_name}, or choose --way {own}",
            )
    check_needs("--way fit", "--towards MAP", way == "fit" and towards is None)
    given = ", ".join(f"--{key.replace('_', '-')}" for key in reading)
    check_needs(given, "--towards MAP", bool(reading) and towards is None)


def _read_target(towards: str, run, reading):
    """The map to approach, at the run's window unless the options choose another."""
    window = {"pixels": run.header.height, "metres_per_pixel": run.header.metres_per_pixel}
    city = evocity.read_map(towards, **{**window, **reading})
    note_reading(city, reading)
    return city
