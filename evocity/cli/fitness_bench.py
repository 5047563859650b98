"""`evocity fitness bench`: what measures cost."""

import click

import evocity
from evocity.cli.common import (
    describe,
    echo,
    json_option,
    map_options,
    print_json,
    print_table,
    quiet_stdout,
)
from evocity.cli.given import case_of, measures_of


@click.command(
    epilog="""\b
Examples:
  evocity fitness bench
  evocity fitness bench my_measure.py gsi --map villeurbanne-gratte-ciel"""
)
@click.argument("measures", metavar="[NAME|FILE.py]...", nargs=-1)
@click.option(
    "--map",
    "source",
    metavar="MAP|GENOME",
    default="lyon-1er",
    show_default=True,
    help="What is measured; the code of a map too, by measures that ask for genome, parents or "
    "sources.",
)
@click.option(
    "--repeats",
    type=click.IntRange(min=1),
    default=7,
    show_default=True,
    help="Calls that are timed; the fewest milliseconds and their median are told.",
)
@map_options
@json_option
def bench(measures: tuple[str, ...], source: str, repeats: int, reading, as_json: bool) -> None:
    """Time measures, all of `evocity fitness list` if none is named, on one map and one core.

    Alone: a call on a map that no other measure has seen, the views it asks for included. Shared:
    on a map whose views are there already. All together: one call of each, on one map whose views
    they share. A first call, which loads what is compiled, is not counted.

    JSON: measures (each name to alone and shared, milliseconds: least, median) and together
    (least, median).
    """
    from evocity.authoring.timing import cost, cost_together

    with quiet_stdout():
        wanted = {m.name: m for word in measures for m in measures_of(word)}
        wanted = list(wanted.values()) or evocity.fitness.measures()
        case = case_of(source, reading)
        wanted = [m.bound(case.city) if "reference" in m.needs else m for m in wanted]
        coded = case if all(map(case.serves, wanted)) else _coded(case)
        costs = {m.name: cost(m, case if case.serves(m) else coded, repeats) for m in wanted}
        together = cost_together(wanted, coded, repeats)
    costs = dict(sorted(costs.items(), key=lambda item: item[1].alone.least))
    if as_json:
        each = {k: {"alone": _ms(v.alone), "shared": _ms(v.shared)} for k, v in costs.items()}
        print_json({"measures": each, "together": _ms(together)})
        return
    echo(describe(case.city))
    rows = [("milliseconds", "alone", "(median)", "shared", "(median)")]
    rows += [(name, *_cells(one.alone), *_cells(one.shared)) for name, one in costs.items()]
    if len(costs) > 1:
        rows.append(("all together", "", "", *_cells(together)))
    print_table(rows)


def _coded(case):
    """The ``case`` of a map's own code, or of the genome it has, which is its own parent; the
    genome's map stands in for the cities it is made of."""
    import numpy as np

    from evocity.cli.trials import bred_case
    from evocity.genome import packed

    genome, name = case.genome, f"{case.city.name}, decoded"
    if genome is None:
        genome = evocity.encode(case.city).genome
        return bred_case(name, genome, [genome], [case.city])
    own = genome.replace(
        cities=(case.city.name,),
        source=packed(*genome.pavement.corners),
        **dict.fromkeys(("parent", "turn"), np.zeros(len(genome), np.uint8)),
    )
    return bred_case(name, own, [own], [case.city])


def _ms(time) -> dict[str, float]:
    return {"least": 1e3 * time.least, "median": 1e3 * time.median}


def _cells(time) -> tuple[str, str]:
    return f"{1e3 * time.least:.3g}", f"({1e3 * time.median:.3g})"
