"""`evocity refine`: an optimiser improves one individual of a run."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_output, report_write_errors
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


@click.command(
    epilog="""\b
Examples:
  evocity refine runs/lyon-x-montpellier --id 97 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --with 103 --side 6 --budget 400 -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way heights -o better.parquet
  evocity refine runs/lyon-x-montpellier --id 97 --way fit --towards lyon-1er -o near.parquet

The genome can be a parent of another run: [[parents]] genome = "better.parquet"."""
)
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@required_id_option
@output_option("GENOME", "Genome file to write, usually .parquet")
@option(
    "--way",
    "What to tune: the fabric or the heights of street blocks, the operator's parameters, or all "
    "lifs.",
    click.Choice(["lambda_field", "heights", "parameters", "fit"]),
    "lambda_field",
)
@option("--budget", "Largest number of evaluations.", click.IntRange(1, 1_000_000), 200)
@option("--algorithm", "Algorithm of NLopt.", click.Choice(["sbplx", "cobyla", "bobyqa"]), "sbplx")
@option(
    "--side", "Number of values along each side of a field over the map.", click.IntRange(1, 16), 4
)
@option(
    "--rounds",
    "Number of rounds of lambda_field. [one for each ten evaluations; 4 with cobyla and bobyqa]",
    click.IntRange(1, 1000),
)
@option("--seed", "Seed of the random choice of fabric.", WHOLE, 0)
@option(
    "--with others N...",
    "Individual that offers its fabric to lambda_field. [a living one and a variant, each round]",
    WHOLE,
)
@option("--tune KEY...", "Parameter to tune with --way parameters. [all numbers]")
@option("--towards MAP", "Map to approach with --way fit, at the run's window and pixels.")
@accept_changes_option
@trust_option
@map_options
@json_option
def refine(
    run: Path, identifier, output, way, budget, algorithm, side, rounds, seed, others, tune,
    towards, accept_changes, trust, reading, as_json,
) -> None:  # fmt: skip
    """Improve the individual --id of RUN with an optimiser, and write the result as a genome.

    The score of an individual is the sum of the losses of its goals, each divided by the range of
    the goal in the first generation. As in the run, constraints come first. With --way fit, the
    score is the distance to the map of --towards. If the optimiser finds nothing better, the
    command writes the genome of the individual itself. RUN stays unchanged, and may still be
    running. The command executes the Python files of measures that the recipe names.

    The way lambda_field tunes which street blocks get the fabric of other individuals; each round
    continues from the best result, with new fabric. The way heights tunes the heights of street
    blocks. The way parameters tunes the parameters of the operator that bred the individual, and
    replays the birth. The way fit tunes all lifs until the map is closest to another map, by its
    own algorithm.

    JSON keys: id, way, better, bred (number of children; equal children are measured once),
    evaluations, failures, others; score, values and, for --way fit, distance (m, RMS), each with
    before and after.
    """
    opened = evocity.open_run(run)
    check_output(output, str(run))
    if run.resolve() in output.resolve().parents:
        raise EvocityError(
            f"{str(output)!r} is in the folder of the run",
            "a file outside the folder of the run",
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
            algorithm=algorithm,
            side=side,
            rounds=rounds,
            seed=seed,
            others=others or None,
            tune=tune,
            towards=target,
            accept_changes=accept_changes,
            trust=confirm_trust(run, trust),
            progress=None if bar is None else lambda done, _: bar(done, budget),
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
        print_json(
            {
                "id": identifier,
                "way": way,
                "better": result.better,
                "bred": result.bred,
                "evaluations": result.evaluations,
                "failures": result.failures,
                "others": list(result.others),
                **{key: dict(zip(("before", "after"), p, strict=True)) for key, p in pairs.items()},
            }
        )
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
                f"{option_name} does not fit --way {way}",
                f"{option_name} with --way {own}",
                "leave one of them out",
            )
    if way == "fit" and towards is None:
        raise EvocityError("--way fit without --towards", "a map to approach", "add --towards MAP")
    if reading and towards is None:
        raise EvocityError(
            "options for reading maps are given without --towards",
            "these options only with --towards MAP",
            "leave the options out, or add --towards MAP",
        )


def _read_target(towards: str, run, reading):
    """The map to approach, at the run's window unless the options choose another."""
    window = {"pixels": run.header.height, "metres_per_pixel": run.header.metres_per_pixel}
    city = evocity.read_map(towards, **{**window, **reading})
    note_reading(city, reading)
    return city
