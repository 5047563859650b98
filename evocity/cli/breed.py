"""`evocity breed`: one child of parents, by an operator."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evocity.cli.shared.checks import check_genome_output, check_output, report_write_errors
from evocity.cli.shared.commands import command
from evocity.cli.shared.inputs import parents_of
from evocity.cli.shared.options import (
    WHOLE,
    frames_option,
    ids_option,
    json_option,
    option,
    output_option,
    parent_options,
    settings_of,
    settings_option,
)
from evocity.cli.shared.terminal import echo, note, note_compiling, print_json
from evocity.errors import OperatorError

if TYPE_CHECKING:
    from evocity.genome import Genome

#: Operators whose ``share`` runs from one parent to the other.
FILMED = ("interpolation", "lambda_crossover", "symmetric_fusion")
#: How often a child that equals a parent is bred again, by default and at most.
REDRAWS, MOST_REDRAWS = 3, 16
#: The least shortfall of a share that is noted.
SHORT = 0.1


@command("""
  evocity breed pavement_fusion lyon.parquet montpellier.parquet -o child.parquet
  evocity breed pavement_fusion lyon-1er montpellier-pas-du-loup --seed 7 \\
      --set side_max=64 --set fill=0.3 --set domains=2,3 -o child.parquet
  evocity breed interpolation lyon.parquet montpellier.parquet --frames 25 -o film.webp
  evocity breed mutation runs/lyon-x-montpellier --id 97 --set repair=none -o child.parquet""")
@click.argument("operator", metavar="OPERATOR")
@click.argument("parents", metavar="PARENT...", nargs=-1, required=True)
@output_option("GENOME", "Genome file to write, usually .parquet; with --frames .webp or .png")
@option("--seed", "Seed of the random draws; the same seed makes the same child.", WHOLE, 0)
@settings_option("the operator's own")
@frames_option
@ids_option("Give one --id for each run folder among the parents, in the order of the folders")
@option(
    "--redraws N",
    "How often a child that equals a parent is bred again, with less strict parameters.",
    click.IntRange(0, MOST_REDRAWS),
    REDRAWS,
)
@parent_options
@json_option
def breed(
    operator: str, parents, output: Path, seed, settings, frames, identifiers, redraws, reading,
    coding, as_json,
) -> None:  # fmt: skip
    """Breed a child of PARENTs with OPERATOR, and write the genome of the child.

    The command `evocity operators list` prints the operators and their parameters. A PARENT is a
    genome file, a run folder with --id, a map file, or the name of a bundled district. If you name
    a map, the command first encodes the map as a genome. All parents must have the same number of
    pixels and the same pixel size. Most operators need parents that have the same range blocks. The
    child keeps the pixels that were locked in a parent with `evocity encode --lock`.

    If the child equals a parent, the command breeds again, up to --redraws times. Each redraw has
    other random draws; fusions get a larger tolerance, and region fusion may cut more. The command
    prints how often it bred again, and with which parameters.

    With --frames, the command writes pictures of children in place of a genome, from the first
    PARENT (share λ = 1) to the second PARENT (λ = 0) in equal steps. OPERATOR is then
    interpolation, lambda_crossover or symmetric_fusion.

    The JSON document has the keys "operator", "seed", "lifs", "cities", "made", "redraws" and
    "copy_of". The key "cities" contains the share of the map that comes from each source city. The
    key "made" contains results that the operator reports, for example the number of repaired lifs.
    The key "redraws" contains the number of redraws. The key "copy_of" contains the number of the
    parent that the child equals, or null.
    """
    given = settings_of(settings)
    if frames is None:
        check_genome_output(output, *parents)
    else:
        _check_frames(operator, given, output, frames, parents)
    breeding = make_operator(operator, given)
    _check_count(breeding, len(parents))
    note_compiling()
    if frames is not None:
        genomes = parents_of(parents, identifiers, reading, coding)
        _write_frames(operator, given, genomes, seed, frames, output)
        if as_json:
            print_json({"operator": operator, "seed": seed, "frames": frames})
        else:
            echo(f"{operator}: {frames} frames from λ = 1 to λ = 0\nwrote {output}")
        return
    genomes = parents_of(parents, identifiers, reading, coding)
    child, done, changed = _breed_again(breeding, genomes, seed, redraws)
    copied = next((k for k, one in enumerate(genomes, 1) if one.digest == child.digest), None)
    with report_write_errors(output):
        child.write(output)
    shares = dict(zip(child.cities, child.shares.tolist(), strict=True))
    made = {key: value for key, value in child.made.items() if key != "operator"}
    _note_copies(done, changed, copied)
    _note_fill(made)
    _note_street_blocks(breeding, parents, made)
    if as_json:
        about = {"operator": operator, "seed": seed, "lifs": len(child)}
        print_json({**about, "cities": shares, "made": made, "redraws": done, "copy_of": copied})
        return
    p = child.pavement
    sides = f"B = {p.block}" if p.uniform else f"leaves of {p.finest} to {p.coarsest} px"
    echo(
        f"{operator}: {len(child)} lifs, {sides}, {p.height} × {p.width} px at "
        f"{child.metres_per_pixel:g} m"
    )
    echo("shares: " + ", ".join(f"{city}: {100 * share:.0f} %" for city, share in shares.items()))
    for key, value in made.items():
        echo(f"{key}: {_format(value)}")
    echo(f"wrote {output}")


def _breed_again(
    operator, genomes: "Sequence[Genome]", seed: int, redraws: int
) -> "tuple[Genome, int, dict[str, object]]":
    """Breed a child, and breed again while it equals one of the ``genomes``: the child, the number
    of redraws, and the parameters that differ from those of the ``operator``."""
    import numpy as np

    from evocity.search.breeding.redraws import relax

    known, first = {genome.digest for genome in genomes}, operator
    child = operator(genomes, np.random.default_rng(seed))
    done = 0
    while done < redraws and child.digest in known:
        done += 1
        operator = relax(operator)
        child = operator(genomes, np.random.default_rng([seed, done]))
    before, now = (getattr(one, "__dict__", {}) for one in (first, operator))
    return child, done, {key: value for key, value in now.items() if value != before[key]}


def _note_copies(redraws: int, changed: Mapping[str, object], copied: int | None) -> None:
    """Note redraws with the parameters that they ``changed``, and a child that equals a parent."""
    if redraws and copied is None:
        by = ", with " + ", ".join(f"{k} = {_format(v)}" for k, v in changed.items())
        times = f"{redraws} time{'s' * (redraws > 1)}"
        note(f"the child equalled a parent, so it was bred again {times}{by if changed else ''}")
    elif copied is not None:
        tried = f", also after {redraws} redraw{'s' * (redraws > 1)}" if redraws else ""
        note(
            f"the child equals parent {copied}{tried}: give less strict parameters by --set, see "
            "evocity operators list"
        )


def _check_frames(operator: str, settings, output: Path, frames: int, parents) -> None:
    """Raise unless ``frames`` of an ``operator`` can be written to ``output``."""
    from evocity.cli.shared.frames import check_film

    check_film(output, frames)
    for parent in parents:
        check_output(output, parent)
    if operator not in FILMED:
        raise OperatorError(
            f"--frames cannot be used with the operator {operator}",
            f"an operator with a share of the first parent: {', '.join(FILMED)}",
            "choose one of these operators, or leave --frames out",
        )
    if "share" in settings:
        raise OperatorError(
            f"--frames cannot be used with --set share={settings['share']}",
            "no share, because each frame has its own",
            "leave --set share=… out",
        )


def _write_frames(operator: str, settings, genomes, seed: int, frames: int, output: Path) -> None:
    """Write pictures of children with shares from 1 to 0, all in the same colours."""
    import numpy as np

    from evocity import decode
    from evocity.cli.shared.frames import write_film
    from evocity.pictures import render

    cities = []
    for number in range(frames):
        breeding = make_operator(operator, {**settings, "share": 1 - number / (frames - 1)})
        cities.append(decode(breeding(genomes, np.random.default_rng(seed))).city)
    highest = max(max(float(city.heights.max()) for city in cities), 1.0)
    pictures = (render(city, highest=highest) for city in cities)
    with report_write_errors(output):
        write_film(pictures, output, frames=frames, milliseconds=120)


def _note_fill(made: Mapping[str, object]) -> None:
    """Note shares that miss ``fill`` by more than the margin, and parents that left nothing."""
    if not {"fill", "fill_reached", "margin"} <= made.keys():
        return
    shares = list(zip(made["fill"], made["fill_reached"], strict=True))
    off = max(abs(share - reached) for share, reached in shares)
    absent = [str(k) for k, (share, reached) in enumerate(shares, 1) if share and not reached]
    more = "a larger tolerance= admits more, see evocity operators list"
    if absent:
        note(f"the child has nothing of parent {' and '.join(absent)}: no group fits; {more}")
    elif off > made["margin"]:
        note(
            f"a share misses fill by {off:.2f}, margin {made['margin']:g}: too few groups fit; "
            f"{more}"
        )


def _note_street_blocks(breeding, parents: Sequence[str], made: Mapping[str, object]) -> None:
    """Note if an operator filled no street block, or far fewer than it should."""
    if "street_blocks" not in made:
        return
    more = "a lower density= fills more, see evocity operators list"
    filled, planned = made["street_blocks"], getattr(breeding, "street_blocks", None)
    names = [*parents, "bare ground"]  # of the void, if it takes part
    shares = list(zip(names, made.get("fill", ()), made.get("fill_reached", ()), strict=False))[1:]
    if planned is not None:
        if filled < planned:
            blocks = f"street block{'s' * (planned > 1)}"
            note(f"{filled} of {planned} {blocks} filled: {more}")
    elif not filled and any(share for _, share, _ in shares):
        note(f"no street block was filled: {more}")
    else:
        for name, share, reached in shares:
            if share - reached > SHORT:
                note(f"{name} has a share of {reached:.2f}, not {share:.2f}: {more}")


def make_operator(name: str, settings: Mapping[str, object]):
    """Make the operator ``name`` from typed parameters: ``reach=all`` is None, 2 may be a list."""
    from evocity.operators import make, operators
    from evocity.operators.parameters import wrong_types

    kind = operators().get(name)

    def typed(key: str, value: object) -> object:
        if (key, value) == ("reach", "all"):
            return None
        if kind and wrong_types(kind, {key: value}) and not wrong_types(kind, {key: [value]}):
            return [value]
        return value

    settings = {key: typed(key, value) for key, value in settings.items()}
    try:
        return make(name, **settings)
    except OperatorError as error:
        if not error.faults:
            raise
        # with colons: some have the name of an option of this command
        raise OperatorError(
            f"{name} with --set "
            + ", ".join(f"{key}: {fault}" for key, (fault, _) in error.faults.items()),
            error.expected,
            error.remedy,
        ) from error


def _check_count(operator, count: int) -> None:
    """Raise, before any map is coded, unless ``count`` parents suit the ``operator``."""
    fewest, most = operator.parents
    if count < fewest or (most is not None and count > most):
        counts = f"{fewest} or more" if most is None else f"{fewest} to {most}"
        raise OperatorError(
            f"{operator.name} cannot breed from {count} parent{'s' * (count > 1)}",
            f"{fewest if most == fewest else counts} parent{'s' * (most != 1)}",
            "after the name of the operator, name the expected number of genomes, maps or "
            "districts",
        )
    if hasattr(operator, "check_count"):
        operator.check_count(count)


def _format(value) -> str:
    """A fact from an operator, for reading."""
    if isinstance(value, list | tuple):
        return ", ".join(map(_format, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_format(item)}" for key, item in value.items())
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value)
