"""`evocity replay`: births of a run recomputed, and compared with the log."""

from pathlib import Path

import click

import evocity
from evocity.cli.common import (
    echo,
    json_option,
    note_compiling,
    print_json,
    progress_bar,
    quiet_stdout,
)
from evocity.cli.trusting import confirmed, trust_option
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
@click.option("--all", "every", is_flag=True, help="All births.")
@click.option(
    "--sample",
    type=click.IntRange(min=1),
    metavar="N",
    show_default="the IDs that are named",
    help="So many births, drawn from all.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the draw of --sample.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Processes that breed and evaluate, with the recipe's deadline and memory. 0: this one, "
    "without; births that ended by them are then not measured again.",
)
@click.option(
    "--accept-changes",
    is_flag=True,
    help="Replay although a measure's source, or what else the run started from, has changed.",
)
@trust_option
@json_option
def replay(run: Path, ids, every, sample, seed, workers, accept_changes, trust, as_json) -> None:
    """Recompute the births ID of RUN from its log, and say whether they are the same, bit for bit.

    Parents and operator are drawn again, the child is bred and measured; what differs from the log
    is told. A measure that draws at random differs, and so may one on another machine or of another
    release of its libraries. The run stays as it is; it may be going on. Measures of your own that
    the recipe names are executed.

    JSON: a list, of each birth id, same (true, false; null where it cannot be told), differs
    (column of the births to what it was, then, and is, now: parents, operator, status, genome,
    fitness.NAME), reason (why it cannot be told, else null). Exit code 1 if any differs.
    """
    if bool(ids) + every + (sample is not None) != 1:
        raise EvocityError(
            "births to replay named in none or several ways",
            "IDs, --all or --sample N",
            f"name some, as in: evocity replay {run} 0 1",
        )
    opened = evocity.open_run(run)
    ids = list(dict.fromkeys(ids)) or _drawn(opened, sample, seed)
    note_compiling()
    with quiet_stdout(), progress_bar("replaying") as bar:
        found = evocity.replay(
            opened,
            ids,
            trust=confirmed(run, trust),
            accept_changes=accept_changes,
            workers=workers,
            progress=lambda done: None if bar is None else bar(done, len(ids)),
        )
    if as_json:
        print_json([_noted(one) for one in found])
    else:
        for one in found:
            echo(f"{one.id}: {_words(one)}")
        echo(_together(found))
    if any(one.same is False for one in found):
        click.get_current_context().exit(1)


def _drawn(run, sample: int | None, seed: int) -> list[int]:
    """Births of a ``run``: all, or a ``sample`` of them."""
    import numpy as np

    ids = run.births(columns=["id"])["id"].to_pylist()
    if sample is None or sample >= len(ids):
        return ids
    return sorted(np.random.default_rng(seed).choice(ids, sample, replace=False).tolist())


def _noted(one) -> dict:
    from evocity.search.differing import told

    return {"id": one.id, "same": one.same, "differs": told(one.differs), "reason": one.reason}


def _words(one) -> str:
    from evocity.search.differing import in_words

    if one.same is None:
        return f"cannot be told: {one.reason}"
    if one.same:
        return "the same"
    return f"differs: {in_words(one.differs)}"


def _together(found) -> str:
    counts = {same: sum(one.same is same for one in found) for same in (True, False, None)}
    parts = [f"{counts[True]} of {len(found)} births the same"]
    parts += [f"{counts[False]} differ"] * bool(counts[False])
    parts += [f"of {counts[None]} it cannot be told"] * bool(counts[None])
    return ", ".join(parts)
