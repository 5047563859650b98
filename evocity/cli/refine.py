"""`evocity refine`: one individual of a run made better by an optimiser."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    check_output,
    echo,
    json_option,
    map_options,
    note,
    note_compiling,
    note_reading,
    output_option,
    print_json,
    print_table,
    progress_bar,
    quiet_stdout,
    writing,
)
from evocity.cli.given import one_of
from evocity.cli.trusting import confirmed, trust_option
from evocity.errors import EvocityError


@click.command(
    epilog="""\b
Examples:
  evocity refine runs/lyon-x-montpellier --id 97 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --with 103 --side 6 --budget 400 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way heights -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way fit --towards lyon-1er -o near.parquet

What is written can be a parent of another night: [[parents]] genome = "better.parquet"."""
)
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.option(
    "--id",
    "identifier",
    type=click.IntRange(min=0),
    multiple=True,
    callback=one_of,
    required=True,
    metavar="N",
    help="Which individual, by the number its report and `status` give it.",
)
@output_option("GENOME", "Genome file to write, usually .parquet; overwritten if it exists.")
@click.option(
    "--way",
    type=click.Choice(["lambda_field", "heights", "parameters", "fit"]),
    default="lambda_field",
    show_default=True,
    help="What is tuned. lambda_field: which street blocks get the fabric of others. heights: "
    "those of street blocks. parameters: of the operator that made it, its making replayed. fit: "
    "all lifs, until the map is closest to another.",
)
@click.option(
    "--budget",
    type=click.IntRange(1, 1_000_000),
    default=200,
    show_default=True,
    help="Evaluations at most.",
)
@click.option(
    "--algorithm",
    type=click.Choice(["sbplx", "cobyla", "bobyqa"]),
    default="sbplx",
    show_default=True,
    help="NLopt's algorithm; --way fit has its own.",
)
@click.option(
    "--side",
    type=click.IntRange(1, 16),
    default=4,
    show_default=True,
    help="Numbers along each side of the field, of lambda_field and heights.",
)
@click.option(
    "--rounds",
    type=click.IntRange(1, 1000),
    show_default="one for each ten evaluations; 4 with cobyla and bobyqa",
    help="Rounds that the budget is spent in, of lambda_field: each goes on from the best of the "
    "one before, with other fabric.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the draws of whose fabric is offered.",
)
@click.option(
    "--with",
    "others",
    type=click.IntRange(min=0),
    multiple=True,
    metavar="N",
    show_default="in each round one of those who live, and a variant of the individual",
    help="An individual whose fabric is offered, of lambda_field. Give it once for each.",
)
@click.option(
    "--tune",
    multiple=True,
    metavar="KEY",
    show_default="all of its numbers",
    help="A parameter to be tuned, of parameters. Give it once for each.",
)
@click.option(
    "--towards",
    metavar="MAP",
    show_default="none",
    help="The map to come close to, of fit; read at the run's window and pixel size.",
)
@click.option(
    "--accept-changes",
    is_flag=True,
    help="Go on although a measure's source, or what else the run started from, has changed.",
)
@trust_option
@map_options
@json_option
def refine(
    run: Path, identifier, output, way, budget, algorithm, side, rounds, seed, others, tune,
    towards, accept_changes, trust, reading, as_json,
) -> None:  # fmt: skip
    """Make the individual --id of RUN better by an optimiser, as a genome of its own.

    What is better is what the run wants: its goals' losses are summed, each over its range in the
    first generation, and constraints come first. The run stays as it is; it may be going on. If
    nothing better is found, the individual itself is written. With --way fit, better is nearer to
    the map of --towards, whatever the run wants. Measures of your own that the recipe names are
    executed.

    JSON keys: id, way, better, bred (children; equal ones are measured once), evaluations,
    failures, others; score, values and, of --way fit, distance (m, RMS), each with before and
    after.
    """
    opened = evocity.open_run(run)
    check_output(output, str(run))
    if run.resolve() in output.resolve().parents:
        raise EvocityError(
            f"{str(output)!r} in the folder of the run",
            "a file elsewhere: the run stays as it is",
            "choose another name after -o",
        )
    _refuse_strange(way, others, tune, towards, reading)
    note_compiling()
    target = None if towards is None else _map(towards, opened, reading)
    with quiet_stdout(), progress_bar(f"refining {identifier}") as bar:
        found = evocity.refine(
            opened,
            identifier,
            way=way,
            budget=budget,
            algorithm=algorithm,
            side=side,
            rounds=rounds,
            seed=seed,
            others=others or None,
            tune=tune,
            towards=target,
            accept_changes=accept_changes,
            trust=confirmed(run, trust),
            progress=None if bar is None else lambda done, _: bar(done, budget),
        )
    with writing(output):
        found.genome.write(output)
    if found.failures:
        note(f"{found.failures} of {found.evaluations} failed, the first: {found.error}")
    if not found.better:
        note(f"nothing better was found: {output} holds individual {identifier} as it is")
    if way != "fit" and found.evaluations < budget:
        note(_early(found, way, budget))
    names = list(found.before)
    apart = None
    if target is not None:
        apart = [_distance(one, target) for one in (opened.genome(identifier), found.genome)]
    if as_json:
        print_json(
            {
                "id": identifier,
                "way": way,
                "better": found.better,
                "bred": found.bred,
                "evaluations": found.evaluations,
                "failures": found.failures,
                "others": list(found.others),
                "score": {"before": found.score_before, "after": found.score},
                "values": {"before": dict(found.before), "after": dict(found.values)},
            }
            | ({} if apart is None else {"distance": {"before": apart[0], "after": apart[1]}})
        )
        return
    offered = f", fabric of {', '.join(map(str, found.others))}" if found.others else ""
    echo(f"individual {identifier}: {way}{offered}, {found.evaluations} evaluations")
    rows = [("", "before", "after")]
    rows += [(name, f"{found.before[name]:.4g}", _told(found.values, name)) for name in names]
    losses = "sum of losses, less is better"
    rows.append((losses, f"{found.score_before:.4g}", f"{found.score:.4g}"))
    if apart is not None:
        rows.append((f"m from {target.name} (RMS)", *(f"{one:.4g}" for one in apart)))
    print_table(rows)
    echo(f"wrote {output}")


def _early(found, way: str, budget: int) -> str:
    """Why fewer children were measured than the ``budget`` allows, and what to do."""
    other = {
        "lambda_field": "offer the fabric of others with --with, or a finer field with --side",
        "heights": "ask for a finer field with --side",
        "parameters": "tune other parameters with --tune",
    }[way]
    if not found.evaluations:
        return (
            f"all {found.bred} children have its own genome: nothing of it changes so; "
            f"{other}, or choose another --way"
        )
    return (
        f"{found.evaluations} of {budget} evaluations: the optimiser settled; of {found.bred} "
        f"children bred, {found.evaluations} are different. To go further, {other}"
    )


def _distance(genome, target) -> float:
    """Metres by which the heights of a genome's map differ from a ``target``, root mean square."""
    heights = evocity.decode(genome).city.heights
    return float(((heights - target.heights) ** 2).mean(dtype=float) ** 0.5)


def _refuse_strange(way: str, others, tune, towards, reading) -> None:
    """Options of another way."""
    of = {"--with": (others, "lambda_field"), "--tune": (tune, "parameters")}
    of |= {"--towards": (towards, "fit")}
    for option, (given, own) in of.items():
        if given and way != own:
            raise EvocityError(
                f"{option} with --way {way}", f"{option} with --way {own}", "leave one of them out"
            )
    if way == "fit" and towards is None:
        raise EvocityError("--way fit without --towards", "the map to come close to", "name it")
    if reading and towards is None:
        raise EvocityError(
            "options of the reading of maps without --towards",
            "them with a map to be read",
            "leave them out",
        )


def _map(towards: str, run, reading):
    """The map to come close to, at the run's window unless another is asked for."""
    window = {"pixels": run.header.height, "metres_per_pixel": run.header.metres_per_pixel}
    city = evocity.read_map(towards, **{**window, **reading})
    note_reading(city, reading)
    return city


def _told(values, name: str) -> str:
    return f"{values[name]:.4g}" if name in values else "–"
