"""`evocity pick`, `evocity reweight`, `evocity stop`: commands to a run."""

from pathlib import Path

import click

from evocity.cli.shared.commands import command
from evocity.cli.shared.options import flag, option
from evocity.cli.shared.terminal import echo
from evocity.errors import EvocityError, spell

_RUN = click.argument("run", metavar="RUN", type=click.Path(path_type=Path))


@command("""
  evocity pick runs/tonight 97 103
  evocity pick runs/tonight 211 --share 0.8
  evocity pick runs/tonight --clear""")
@_RUN
@click.argument("ids", metavar="[ID]...", nargs=-1, type=click.IntRange(min=0))
@option(
    "--share",
    "Share of births whose first parent is a picked individual: a number above 0 and at most 1. "
    "[unchanged, else [search] picks of the recipe, 0.5]",
    float,
)
@flag(
    "--clear", "Unpick the individuals with the given IDs; without an ID, unpick all individuals."
)
def pick(run: Path, ids: tuple[int, ...], share: float | None, clear: bool) -> None:
    """Use the given individuals of RUN as parents, even if the algorithm would not choose them.

    The picked individuals are parents from the next generation on, until you use --clear. If the
    run is stopped or finished, the picked individuals become parents when you resume the run.
    Earlier picks stay. The log records every pick, so a resumed run breeds the same births.
    """
    from evocity.search.record import commands

    if clear and share is not None:
        raise EvocityError(
            "--share cannot be combined with --clear",
            "only one of the options --share and --clear",
            "leave out one of the two options",
        )
    if not ids and not clear:
        raise EvocityError(
            "the command received neither the id of an individual nor --clear",
            "the ids of one or more individuals, or the option --clear",
            f"choose individuals that this command lists: evocity status {run}",
        )
    if clear:
        command = commands.Unpick(ids=ids)
        going = commands.send(run, command)
    else:
        going = commands.pick(run, ids, share)
        command = commands.Pick(ids=ids, share=share)
    _print(command.words, run, going)


@command("""
  evocity reweight runs/tonight quarter_fusion=2 height_scaling=3
  evocity reweight runs/tonight crumbs=0.5""")
@_RUN
@click.argument("weights", metavar="NAME=WEIGHT...", nargs=-1, required=True)
def reweight(run: Path, weights: tuple[str, ...]) -> None:
    """Change weights in a run: weights of operators, or weights of measures that add up to one
    goal.

    NAME is an operator, or a measure whose table in the recipe has the key "weight" or "objective".
    The WEIGHT of an operator may be 0. The new weights apply to all living individuals from the
    next generation on. In a stopped or finished run, the new weights apply when you resume the run.
    The log records every change of weights.
    """
    from pydantic import ValidationError

    from evocity.search.record import commands

    given = dict(map(_weight, weights))
    try:
        command = commands.Reweight(weights=given)
    except ValidationError:
        raise _weight_error(" ".join(weights)) from None
    _print(command.words, run, commands.send(run, command))


@command("""
  evocity stop runs/tonight""")
@_RUN
def stop(run: Path) -> None:
    """Stop RUN after its current generation.

    The process that executes the run writes the report, and exits without an error. The command
    `evocity resume` continues a stopped run, and the stop does not change any later birth.
    """
    from evocity.search.record import commands

    commands.send(run, commands.Stop())
    echo(f"{run} stops after this generation; go on with: evocity resume {run}")


def _weight(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value if equals else "")
    except ValueError:
        raise _weight_error(text) from None


def _weight_error(text: str) -> EvocityError:
    return EvocityError(
        spell(text),
        "NAME=WEIGHT, a weight from 0 to 1e6",
        "write for example quarter_fusion=2",
    )


def _print(text: str, run: Path, going: bool) -> None:
    when = "from the next generation on"
    if not going:
        when = f"once it goes on: evocity resume {run} (--generations for more)"
    echo(f"{text}; {when}")
