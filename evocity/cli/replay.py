"""`evocity replay`: recomputes births of a run, and compares them with the log."""

from pathlib import Path

import click

import evocity
from evocity.cli.shared.commands import command
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
from evocity.cli.shared.terminal import (
    echo,
    note,
    note_compiling,
    print_json,
    progress_bar,
    quiet_stdout,
)
from evocity.errors import EvocityError


@command("""
  evocity replay runs/lyon-x-montpellier 97 103
  evocity replay runs/lyon-x-montpellier --sample 100 --workers 2 --json
  evocity replay runs/lyon-x-montpellier --all""")
@click.argument("run", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("ids", metavar="[ID]...", type=click.IntRange(min=0), nargs=-1)
@flag("--all every", "Replay all births.")
@option("--sample N", "Number of births to draw at random and replay. [the IDs]", POSITIVE)
@option("--seed", "Seed of the random draw of births for --sample.", WHOLE, 0)
@option(
    "--workers",
    "Number of worker processes, each with the recipe's deadline and memory limit. With --workers "
    "0, the command uses no worker processes and no limits, and skips births that exceeded a "
    "limit in the run.",
    WHOLE,
    0,
)
@accept_changes_option
@trust_option
@json_option
def replay(run: Path, ids, every, sample, seed, workers, accept_changes, trust, as_json) -> None:
    """Repeat births of RUN by their IDs, and compare the results with the log, bit for bit.

    For each birth, the command repeats the random draw of parents and operator, then breeds and
    measures the child. The command prints every difference from the log. Measures that draw random
    numbers can return different values. Measured values can differ on another machine, or with
    other releases of libraries. The run stays unchanged, and may still be in progress. The command
    executes the Python files of measures that the recipe names. With --all, the command also names
    the files of the run that have no checksums, because an older release wrote them.

    The JSON document is a list of births with the keys "id", "same", "differs" and "reason". The
    key "same" is true or false; if the result is unknown, the key "same" is null and the key
    "reason" says why. For each column that differs, the key "differs" contains the logged value and
    the new value. The compared columns are "parents", "operator", "status", "genome", and a column
    "fitness.NAME" for each measure. The exit code is 1 if any birth differs from the log.
    """
    if bool(ids) + every + (sample is not None) != 1:
        raise EvocityError(
            "the command has none, or several, of the arguments IDs, --all and --sample",
            "exactly one of these: IDs; --all; --sample N",
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
    if every and (parts := opened.unverified()):
        note(
            f"an older release of evocity wrote {', '.join(parts)} without checksums, so that "
            "evocity cannot verify these files"
        )
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
    from evocity.search.record.complete_run import json_differences

    differs = json_differences(birth.differs)
    return {"id": birth.id, "same": birth.same, "differs": differs, "reason": birth.reason}


def _describe(birth) -> str:
    from evocity.search.record.complete_run import describe_differences

    if birth.same is None:
        return f"unknown: {birth.reason}"
    return "the same" if birth.same else f"differs: {describe_differences(birth.differs)}"


def _summary(replayed) -> str:
    counts = {same: sum(birth.same is same for birth in replayed) for same in (True, False, None)}
    parts = [f"{counts[True]} of {len(replayed)} births the same"]
    parts += [f"{counts[False]} differ"] * bool(counts[False])
    parts += [f"{counts[None]} unknown"] * bool(counts[None])
    return ", ".join(parts)
