"""`evocity pick`, `evocity reweight`, `evocity stop`: commands to a run that goes on."""

from pathlib import Path

import click

from evocity.cli.common import echo
from evocity.errors import EvocityError, shown

_RUN = click.argument("run", metavar="RUN", type=click.Path(path_type=Path))


@click.command(
    epilog="""\b
Examples:
  evocity pick runs/tonight 97 103
  evocity pick runs/tonight 211 --share 0.8
  evocity pick runs/tonight --clear"""
)
@_RUN
@click.argument("ids", metavar="[ID]...", nargs=-1, type=click.IntRange(min=0))
@click.option(
    "--share",
    type=float,
    show_default="as it is set, else [search] picks of the recipe, 0.5",
    help="Share of the births that have a pick for their first parent, above 0 to 1.",
)
@click.option("--clear", is_flag=True, help="Drop the picks named; without an ID, drop all.")
def pick(run: Path, ids: tuple[int, ...], share: float | None, clear: bool) -> None:
    """Breed from the individuals ID of RUN too, whatever the algorithm thinks of them.

    They are bred from beginning with the next generation, until they are cleared; a run that was
    stopped or has ended takes them up when it is resumed. Earlier picks stay. The log tells every
    pick, so that a resumed run breeds the same births.
    """
    from evocity.search import commands

    if clear and share is not None:
        raise EvocityError("--share with --clear", "one of them", "leave one out")
    if not ids and not clear:
        raise EvocityError(
            "no ID to pick",
            "ids of births, one or more, or --clear",
            f"take some from the front: evocity status {run}",
        )
    if clear:
        asked = commands.Unpick(ids=ids)
        going = commands.send(run, asked)
    else:
        going = commands.pick(run, ids, share)
        asked = commands.Pick(ids=ids, share=share)
    _tell(asked.words, run, going)


@click.command(
    epilog="""\b
Examples:
  evocity reweight runs/tonight quarter_fusion=2 height_scaling=3
  evocity reweight runs/tonight crumbs=0.5"""
)
@_RUN
@click.argument("weights", metavar="NAME=WEIGHT...", nargs=-1, required=True)
def reweight(run: Path, weights: tuple[str, ...]) -> None:
    """Change the weights of operators of RUN, or of measures that count in a sum.

    NAME is an operator of the recipe's mixture, whose WEIGHT may be 0, or a measure that has a
    weight or an objective there. What lives is judged by the new weights, beginning with the next
    generation; a run that was stopped or has ended takes them up when it is resumed. The log tells
    every change.
    """
    from pydantic import ValidationError

    from evocity.search import commands

    given = dict(map(_weight, weights))
    try:
        asked = commands.Reweight(weights=given)
    except ValidationError:
        raise _no_weight(" ".join(weights)) from None
    _tell(asked.words, run, commands.send(run, asked))


@click.command(epilog="\b\nExample:\n  evocity stop runs/tonight")
@_RUN
def stop(run: Path) -> None:
    """Stop RUN after the generation that it is breeding now.

    The process that breeds it writes its report and ends as with a finished run. `evocity resume`
    goes on with it later, with the same births as if it had not been stopped.
    """
    from evocity.search import commands

    commands.send(run, commands.Stop())
    echo(f"{run} stops after this generation; go on with: evocity resume {run}")


def _weight(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    try:
        return name.strip(), float(value if equals else "")
    except ValueError:
        raise _no_weight(text) from None


def _no_weight(text: str) -> EvocityError:
    return EvocityError(
        shown(text), "NAME=WEIGHT, a weight from 0 to 1e6", "write for example quarter_fusion=2"
    )


def _tell(told: str, run: Path, going: bool) -> None:
    when = "from the next generation on"
    if not going:
        when = f"once it goes on: evocity resume {run} (--generations for more)"
    echo(f"{told}; {when}")
