"""`evocity fitness bench`: the time that measures take."""

import click

import evocity
from evocity.cli.shared.inputs import case_of, measures_of
from evocity.cli.shared.options import POSITIVE, json_option, map_options, option
from evocity.cli.shared.terminal import describe, echo, print_json, print_table, quiet_stdout


@click.command(
    epilog="""\b
Examples:
  evocity fitness bench
  evocity fitness bench my_measure.py gsi --map villeurbanne-gratte-ciel"""
)
@click.argument("words", metavar="[NAME|FILE.py]...", nargs=-1)
@option(
    "--map source MAP|GENOME",
    "Map or genome to measure; measures that need a genome get the coded map.",
    default="lyon-1er",
)
@option("--repeats", "Number of timed calls.", POSITIVE, 7)
@map_options
@json_option
def bench(words: tuple[str, ...], source: str, repeats: int, reading, as_json: bool) -> None:
    """Time measures, or all of `evocity fitness list`, on one map and one core.

    The column "alone" is the time of a call on a map that no other measure has seen, with the views
    that the measure needs. The column "shared" is the time of a call on a map whose views already
    exist. The row "all together" is the time of one call of each measure, on one map with common
    views. The first call, which loads compiled code, does not count. Each time is the least of all
    calls, with the median in brackets.

    JSON: measures (by name, alone and shared: least and median, milliseconds) and together (least
    and median).
    """
    from evocity.fitness.check.cost import cost, cost_together

    with quiet_stdout():
        measures = {m.name: m for word in words for m in measures_of(word)}
        measures = list(measures.values()) or evocity.fitness.measures()
        case = case_of(source, reading)
        measures = [m.bound(case.city) if "reference" in m.needs else m for m in measures]
        coded = case if all(map(case.serves, measures)) else _with_code(case)
        costs = {m.name: cost(m, case if case.serves(m) else coded, repeats) for m in measures}
        together = cost_together(measures, coded, repeats)
    costs = dict(sorted(costs.items(), key=lambda item: item[1].alone.least))
    if as_json:
        each = {k: {"alone": _ms(v.alone), "shared": _ms(v.shared)} for k, v in costs.items()}
        print_json({"measures": each, "together": _ms(together)})
        return
    echo(describe(case.city))
    rows = [("milliseconds", "alone", "(median)", "shared", "(median)")]
    rows += [(name, *_cells(time.alone), *_cells(time.shared)) for name, time in costs.items()]
    if len(costs) > 1:
        rows.append(("all together", "", "", *_cells(together)))
    print_table(rows)


def _with_code(case):
    """The ``case`` with the code of its map as genome and parent. A genome without sources is its
    own parent, and its map stands for its source cities."""
    import numpy as np

    from evocity.cli.shared.trial_maps import bred_case
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
