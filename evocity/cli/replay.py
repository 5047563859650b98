"""`evocity replay`: recomputes births of a run, and compares them with the log."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.inputs import confirm_trust
from evocity.cli.shared.options import (
    POSITIVE,
    WHOLE,
    accept_changes_option,
    flag,
    json_option,
    option,
    trust_option,
)
from evocity.cli.shared.terminal import echo, note_compiling, print_json, progress_bar, quiet_stdout
from evocity.errors import EvocityError


@click.command(
    epilog="""\b
Examples:
  evocity replay runs/lyon-x-montpellier 97 103
  evocity replay runs/lyon-x-montpellier --sample 100 --workers 2 --json
  evocity replay runs/lyon-x-montpellier --all"""
)
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("ids", metavar="[ID]...", type=click.IntRange(min=0), nargs=-1)
@flag("--all every", "Replay all births.")
@option("--sample N", "Number of births to replay, drawn from all at random. [the IDs]", POSITIVE)
@option("--seed", "Seed of the births that --sample draws.", WHOLE, 0)
@option(
    "--workers",
    "Number of processes, each with the recipe's deadline and memory limit; 0 uses this process "
    "without limits, and skips births that exceeded a limit.",
    WHOLE,
    0,
)
@accept_changes_option
@trust_option
@json_option
def replay(run: Path, ids, every, sample, seed, workers, accept_changes, trust, as_json) -> None:
    """Recompute the births ID of RUN, and compare them with its log, bit for bit.

    For each birth, the command draws the parents and the operator again, breeds the child and
    measures it. The command prints every difference from the log. Measures with random draws give
    other values. Values may also differ on another machine, or with other releases of libraries.
    RUN stays unchanged, and may still be running. The command executes the Python files of measures
    that the recipe names.

    JSON: a list with an object for each birth. Keys: id; same (true or false; null if unknown);
    differs (by column of the births, the values then and now: parents, operator, status, genome,
    fitness.NAME); reason (why same is unknown, else null). The exit code is 1 if any birth differs.
    """
    if bool(ids) + every + (sample is not None) != 1:
        raise EvocityError(
            "IDs, --all and --sample are all missing, or several are given",
            "only one of these: IDs, --all or --sample N",
            f"name births, for example: evocity replay {run} 0 1",
        )
    opened = evocity.open_run(run)
    ids = list(dict.fromkeys(ids)) or _draw_births(opened, sample, seed)
    note_compiling()
    with quiet_stdout(), progress_bar("replaying") as bar:
        replayed = evocity.replay(
            opened,
            ids,
            trust=confirm_trust(run, trust),
            accept_changes=accept_changes,
            workers=workers,
            progress=lambda done: None if bar is None else bar(done, len(ids)),
        )
    if as_json:
        print_json([_document(birth) for birth in replayed])
    else:
        for birth in replayed:
            echo(f"{birth.id}: {_describe(birth)}")
        echo(_summary(replayed))
    if any(birth.same is False for birth in replayed):
        click.get_current_context().exit(1)


def _draw_births(run, sample: int | None, seed: int) -> list[int]:
    """Births of a ``run``: all, or a ``sample`` of them."""
    import numpy as np

    ids = run.births(columns=["id"])["id"].to_pylist()
    if sample is None or sample >= len(ids):
        return ids
    return sorted(np.random.default_rng(seed).choice(ids, sample, replace=False).tolist())


def _document(birth) -> dict:
    from evocity.search.record.diff import json_differences

    differs = json_differences(birth.differs)
    return {"id": birth.id, "same": birth.same, "differs": differs, "reason": birth.reason}


def _describe(birth) -> str:
    from evocity.search.record.diff import describe_differences

    if birth.same is None:
        return f"unknown: {birth.reason}"
    return "the same" if birth.same else f"differs: {describe_differences(birth.differs)}"


def _summary(replayed) -> str:
    counts = {same: sum(birth.same is same for birth in replayed) for same in (True, False, None)}
    parts = [f"{counts[True]} of {len(replayed)} births the same"]
    parts += [f"{counts[False]} differ"] * bool(counts[False])
    parts += [f"{counts[None]} unknown"] * bool(counts[None])
    return ", ".join(parts)
