"""`evocity run`: breeds by a recipe."""

import os
from itertools import chain, count
from pathlib import Path

import click

import evocity
from evocity.cli.shared.checks import check_folder
from evocity.cli.shared.commands import command
from evocity.cli.shared.options import FILE, cluster_option, option, until_option
from evocity.cli.shared.search_progress import blame_options, carry_out
from evocity.errors import RunError, reason_of


@command("""
  evocity run
  evocity run runs/lyon-x-montpellier.toml --generations 500 --out runs/tonight
  evocity run my-recipe.toml --seed 8 --workers 4
  evocity run my-recipe.toml --cluster local:4 --until 07:00

A recipe is a TOML file; the run folder keeps a copy of it. Ctrl-C stops cleanly.""")
@click.argument("recipe", metavar="[RECIPE]", default="demo")
@option("--generations", "Number of generations. [the recipe's]", int)
@option("--population", "Number of individuals that live in each generation. [the recipe's]", int)
@option(
    "--workers",
    "Number of worker processes that evaluate births. With --workers 0, the command evaluates "
    "births without worker processes and without deadlines. [the recipe's, else one a core]",
    int,
)
@cluster_option("the recipe's")
@option(
    "--seed", "Seed of the random draws; the same seed gives the same births. [the recipe's]", int
)
@until_option
@option(
    "--out FOLDER",
    "Run folder to create; it must not exist. [runs/NAME of the recipe, else runs/NAME-2, …]",
    FILE,
)
def run(recipe, out, **options) -> None:
    """Breed cities according to RECIPE, and write every birth into a run folder.

    Without a RECIPE, the command runs the bundled demonstration, which breeds Lyon × Montpellier.
    RECIPE is a TOML file. The command executes the Python files of measures that the recipe names.
    At the end of the run, the command writes report.html into the run folder.
    """
    with blame_options(**options):
        chosen = evocity.read_recipe(recipe, **options)
    folder = _free_folder(chosen.default_out) if out is None else _check_new(out)
    planned = chosen.default_out if out is None else folder
    taken = f" ({planned} exists already)" if folder != planned else ""
    carry_out(
        lambda progress: evocity.Search(chosen, out=folder, progress=progress),
        folder,
        made=f"run: {folder}{taken}",
    )


def _check_new(folder: Path) -> Path:
    from evocity.store import refuse_existing

    refuse_existing(folder)
    _make_parent(folder.parent)
    return folder


def _free_folder(folder: Path) -> Path:
    """``folder``, or the first of ``folder-2``, ``folder-3``, … that does not exist."""
    _make_parent(folder.parent)
    others = (folder.with_name(f"{folder.name}-{number}") for number in count(2))
    return next(free for free in chain([folder], others) if not os.path.lexists(free))


def _make_parent(parent: Path) -> None:
    """Create the folder that will contain the run's. Raises `RunError` if it is unusable."""
    try:
        parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(
            f"the folder {parent} cannot be created: {reason_of(error)}",
            "a folder in which this user may create files",
            "choose another run folder with --out",
        ) from error
    check_folder(parent)
