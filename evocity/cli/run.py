"""`evocity run`: breed what a recipe says."""

import os
from itertools import chain, count
from pathlib import Path

import click

import evocity
from evocity.cli.common import check_folder
from evocity.cli.searching import blaming_options, carry_out, cluster_option, until_option
from evocity.errors import RunError


@click.command(
    epilog="""\b
Examples:
  evocity run
  evocity run runs/lyon-x-montpellier.toml --generations 500 --out runs/tonight
  evocity run my-recipe.toml --seed 8 --workers 4
  evocity run my-recipe.toml --cluster local:4 --until 07:00

A recipe is a TOML file; the run folder keeps a copy of it. Ctrl-C stops cleanly."""
)
@click.argument("recipe", metavar="[RECIPE]", default="demo")
@click.option("--generations", type=int, show_default="the recipe's", help="Generations bred.")
@click.option("--population", type=int, show_default="the recipe's", help="Individuals alive.")
@click.option(
    "--workers",
    type=int,
    show_default="the recipe's, else one a core",
    help="Processes that evaluate; the result does not depend on them. 0 evaluates in this one, "
    "without deadlines.",
)
@cluster_option("the recipe's")
@click.option("--seed", type=int, show_default="the recipe's", help="Same seed, same bits.")
@until_option
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    show_default="runs/NAME of the recipe, else runs/NAME-2, …",
    help="Run folder to make; refused if it exists.",
)
def run(recipe, generations, population, workers, cluster, seed, until, out) -> None:
    """Breed what RECIPE says; write every birth into a run folder.

    Without a RECIPE, breeds the bundled demonstration, Lyon × Montpellier. RECIPE is a TOML
    file; the measures of your own that it names are executed. The report is written at the
    end: report.html in the run folder.
    """
    options = {
        "generations": generations,
        "population": population,
        "workers": workers,
        "cluster": cluster,
        "seed": seed,
        "until": until,
    }
    with blaming_options(**options):
        chosen = evocity.read_recipe(recipe, **options)
    folder = _free(chosen.default_out) if out is None else _new(out)
    wanted = chosen.default_out if out is None else folder
    taken = f" ({wanted} exists already)" if folder != wanted else ""
    carry_out(
        lambda tell: evocity.Search(chosen, out=folder, progress=tell),
        folder,
        made=f"run: {folder}{taken}",
    )


def _new(folder: Path) -> Path:
    from evocity.store import refuse_existing

    refuse_existing(folder)
    _made(folder.parent)
    return folder


def _free(folder: Path) -> Path:
    """``folder``, or the first of ``folder-2``, ``folder-3``, … that does not exist."""
    _made(folder.parent)
    others = (folder.with_name(f"{folder.name}-{number}") for number in count(2))
    return next(free for free in chain([folder], others) if not os.path.lexists(free))


def _made(parent: Path) -> None:
    """Make the folder that run folders are kept in; `RunError` if it cannot be used."""
    try:
        parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(
            f"the folder {parent} cannot be made: {error.strerror}",
            "a place this user may write to",
            "name another folder with --out",
        ) from error
    check_folder(parent)
