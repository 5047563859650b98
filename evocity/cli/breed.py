"""`evocity breed`: parents become a child, by one operator."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from evocity.cli.common import (
    check_output,
    echo,
    json_option,
    note,
    note_compiling,
    output_option,
    print_json,
    writing,
)
from evocity.cli.encode import check_no_map_name
from evocity.cli.given import ids_option
from evocity.cli.parents import parent_options, parents_of
from evocity.cli.settings import settings_of, settings_option
from evocity.errors import OperatorError

#: By how much of the map less than asked for is told.
SHORT = 0.1


@click.command(
    epilog="""\b
Examples:
  evocity breed pavement_fusion lyon.parquet montpellier.parquet -o child.parquet
  evocity breed pavement_fusion lyon-1er montpellier-pas-du-loup --seed 7 \\
      --set side_max=64 --set fill=0.3 --set domains=2,3 -o child.parquet
  evocity breed mutation runs/lyon-x-montpellier --id 97 --set repair=none -o child.parquet"""
)
@click.argument("operator", metavar="OPERATOR")
@click.argument("parents", metavar="PARENT...", nargs=-1, required=True)
@output_option("GENOME", "Genome file to write, usually .parquet; overwritten if it exists.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of all random draws: the same seed makes the same child.",
)
@settings_option("the operator's own")
@ids_option(
    "Which individual of a run folder. Give it once for each run among the parents, in order."
)
@parent_options
@json_option
def breed(
    operator: str, parents, output: Path, seed, settings, identifiers, reading, coding, as_json
) -> None:
    """Breed PARENTs by OPERATOR.

    `evocity operators list` names the operators and their parameters. A PARENT is a genome
    file, a run folder with --id, a map file or the name of a bundled district; maps are coded
    first. All must have one size, one pixel and, but for some operators, one block. What is locked
    in one, by `evocity encode --lock`, stays in the child.

    JSON keys: operator, seed, lifs, cities (each source city's share of the map), made (what
    the operator tells: what it reached, how many lifs were repaired).
    """
    import numpy as np

    for parent in parents:
        check_output(output, parent)
    check_no_map_name(output)
    breeding = chosen(operator, settings_of(settings))
    _check_count(breeding, len(parents))
    note_compiling()
    genomes = parents_of(parents, identifiers, reading, coding)
    child = breeding(genomes, np.random.default_rng(seed))
    with writing(output):
        child.write(output)
    shares = dict(zip(child.cities, child.shares.tolist(), strict=True))
    made = {key: value for key, value in child.made.items() if key != "operator"}
    _note_fill(made)
    _note_street_blocks(breeding, parents, made)
    if as_json:
        about = {"operator": operator, "seed": seed, "lifs": len(child)}
        print_json({**about, "cities": shares, "made": made})
        return
    p = child.pavement
    sides = f"B = {p.block}" if p.uniform else f"leaves of {p.finest} to {p.coarsest} px"
    echo(
        f"{operator}: {len(child)} lifs, {sides}, {p.height} × {p.width} px at "
        f"{child.metres_per_pixel:g} m"
    )
    echo("stone of " + ", ".join(f"{city}: {share:.0%}" for city, share in shares.items()))
    for key, value in made.items():
        echo(f"{key}: {_told(value)}")
    echo(f"wrote {output}")


def _note_fill(made: Mapping[str, object]) -> None:
    """Say if the parents' shares are farther from what was asked for than the margin allows, or
    nothing of one was laid."""
    if not {"fill", "fill_reached", "margin"} <= made.keys():
        return
    shares = list(zip(made["fill"], made["fill_reached"], strict=True))
    off = max(abs(asked - reached) for asked, reached in shares)
    none = [str(k) for k, (asked, reached) in enumerate(shares, 1) if asked and not reached]
    more = "a larger tolerance= lets in more, see evocity operators list"
    if none:
        note(f"nothing was laid of parent {' and '.join(none)}: no group fits; {more}")
    elif off > made["margin"]:
        note(
            f"a share is {off:.2f} off what fill asks for, margin {made['margin']:g}: too few "
            f"groups fit; {more}"
        )


def _note_street_blocks(breeding, parents: Sequence[str], made: Mapping[str, object]) -> None:
    """Say if an operator that fills street blocks filled none, or much less than asked."""
    if "street_blocks" not in made:
        return
    more = "a lower density= fills more, see evocity operators list"
    filled, asked = made["street_blocks"], getattr(breeding, "street_blocks", None)
    names = [*parents, "bare ground"]  # of the void, if it takes part
    shares = list(zip(names, made.get("fill", ()), made.get("fill_reached", ()), strict=False))[1:]
    if asked is not None:
        if filled < asked:
            note(f"asked to fill {asked} street block{'s' * (asked > 1)}, filled {filled}: {more}")
    elif not filled and any(share for _, share, _ in shares):
        note(f"no street block was filled: {more}")
    else:
        for name, share, reached in shares:
            if share - reached > SHORT:
                note(f"asked {share:.2f} of {name}, reached {reached:.2f}: {more}")


def chosen(name: str, settings: Mapping[str, object]):
    """The operator called ``name`` with its parameters as typed: ``reach=all`` stands for None,
    as in recipes, and a list of one does without its comma. Raises `OperatorError`."""
    from evocity.operators import make, operators
    from evocity.operators.parameters import wrong_types

    kind = operators().get(name)

    def meant(key: str, value: object) -> object:
        if (key, value) == ("reach", "all"):
            return None
        if kind and wrong_types(kind, {key: value}) and not wrong_types(kind, {key: [value]}):
            return [value]
        return value

    settings = {key: meant(key, value) for key, value in settings.items()}
    try:
        return make(name, **settings)
    except OperatorError as error:
        if not error.faults:
            raise
        # with colons: they are no options of this command, though some have the name of one
        raise OperatorError(
            f"{name} with --set "
            + ", ".join(f"{k}: {found}" for k, (found, _) in error.faults.items()),
            error.expected,
            error.remedy,
        ) from error


def _check_count(operator, count: int) -> None:
    """Raise, before any map is coded, unless ``count`` parents suit the ``operator``."""
    fewest, most = operator.parents
    if count < fewest or (most is not None and count > most):
        wanted = fewest if most == fewest else f"{fewest} or more" if most is None else ""
        raise OperatorError(
            f"{operator.name}: {count} parent{'s' * (count > 1)}",
            f"{wanted or f'{fewest} to {most}'} parent{'s' * (most != 1)}",
            "name that many genomes, maps or districts after the operator",
        )
    if hasattr(operator, "check_count"):
        operator.check_count(count)


def _told(value) -> str:
    """A fact of an operator's, as it is read."""
    if isinstance(value, list | tuple):
        return ", ".join(map(_told, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_told(one)}" for key, one in value.items())
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)
