"""Logs that leave genomes out: the same run, and every genome is had as it was bred."""

import json
import shutil
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_commands import ASKED, SUMMED, steered
from test_search_islands import THREE
from test_search_replay import CELLS, FSI, GSI, REFINE, all_the_same
from toy_runs import write_toy

import evocity
from evocity import operators
from evocity.errors import RecipeError, RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.recipe.mixture import Drawn
from evocity.search import Search, read_recipe
from evocity.search.breeding.birth_plans import BirthPlan, birth_generator
from evocity.search.breeding.omitted_genomes import OmittedGenomes, describe_rebreeding
from evocity.search.record.commands import send
from evocity.store import MOST_BREEDINGS, Birth, Member, Reconstruction, generator_at, state_of
from evocity.store import RunLog as open_without

LOG = '[log]\ngenomes = "{}"\n'
WAYS = ("survivors", "front")
GENOME = "block = 4\nfit = false\nsettle = true"
#: Columns of a birth that no log leaves out, but for what it took.
TOLD = ("generation", "id", "parents", "operator", "made", "status", "error", "genome")


def left_out(run) -> list[int]:
    """Which births the log leaves out."""
    breedings = run.births(columns=["breedings"])["breedings"].to_pylist()
    return [one for one, count in enumerate(breedings) if count]


def same_as_all(path, whole) -> None:
    """The run in ``path`` leaves genomes out, and tells all that the ``whole`` one does."""
    run = evocity.open_run(path)
    columns = [*TOLD, *(f"fitness.{name}" for name in run.header.columns)]
    assert run.births(columns=columns).equals(whole.births(columns=columns))
    assert run.members().equals(whole.members())
    empty = [row["sigma"] is None for row in run.births(columns=["sigma"]).to_pylist()]
    assert [one for one, null in enumerate(empty) if null] == left_out(run) != []
    ids = range(len(empty))
    for one, other in zip(run.individuals(ids), whole.individuals(ids), strict=True):
        assert replace(one, seconds=0) == replace(other, seconds=0)  # genomes by their digests
        assert one.genome is None or one.genome.made == other.genome.made


def run_of(out, recipe, generations=None, **more):
    """A run, as far as the last of so many ``generations``."""
    with Search(read_recipe(recipe, **more), out=out, workers=0) as search:
        for generation in search:
            if generation.number == generations:
                break
    return out


SEARCHES = {
    "usual": "",
    "refine": GSI + FSI + REFINE,
    "window": "[search]\nwindow = 5\n" + GSI + FSI + REFINE,
    "cells": CELLS + GSI + FSI,
    "islands": THREE,
    "cma": "[search]\nalgorithm = 'cma'\nside = 2\n",
}


@pytest.mark.slow_cases("window", "islands")
@pytest.mark.parametrize("name", SEARCHES)
def test_every_genome_is_that_of_the_same_run_with_all(toy, tmp_path, name):
    population = 15 if name == "islands" else 8
    told = {"population": population, "generations": 3}

    def written(more):
        recipe = toy(recipe=SEARCHES[name] + more, **told)
        if name == "cells":  # one goal: a sum
            recipe.write_text(
                recipe.read_text().replace('"toys.py"', '"toys.py"\nobjective="form"')
            )
        return recipe

    whole = evocity.open_run(run_of(tmp_path / "all", written("")))
    assert whole.header.schema_version < 8
    assert "genomes" not in whole.provenance["header"]
    for way in WAYS:
        out = run_of(tmp_path / way, written(LOG.format(way)))
        same_as_all(out, whole)
        assert evocity.open_run(out).header.schema_version == 8
        refined = [b.id for b in whole.individuals(range(population)) if "refined" in b.made]
        assert not set(refined) & set(left_out(evocity.open_run(out)))
    if name in ("usual", "window"):
        all_the_same(tmp_path / "front")


@pytest.mark.slow
def test_the_usual_mixture_leaves_all_out_that_it_may(toy, tmp_path):
    def written(more):
        recipe = toy(
            recipe=more,
            population=12,
            generations=2,
            genome="block = 4\nfit = false\nsettle = true",
        )
        text = recipe.read_text()
        start, end = text.index("[operators]"), text.index("[[fitness]]")
        recipe.write_text(text[:start] + text[end:])
        return recipe

    whole = evocity.open_run(run_of(tmp_path / "all", written("")))
    for way in WAYS:
        path = run_of(tmp_path / way, written(LOG.format(way)))
        same_as_all(path, whole)
        run = evocity.open_run(path)
        kept = [one for row in run.members().to_pylist() for one in (row,)]
        born = dict(enumerate(run.births(columns=["generation"])["generation"].to_pylist()))
        stay = {
            one["id"]
            for one in kept
            if one["generation"] == born[one["id"]] and (way == "survivors" or one["rank"] == 0)
        }
        assert set(left_out(run)) == set(born) - stay - {0, 1}  # no chain is that long
        bred = {one.operator for one in run.individuals(left_out(run))}
        assert len(bred) >= 4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "search"), [("front", ""), ("survivors", "[search]\nwindow = 6\n")]
)
def test_picks_of_those_left_out_and_resumes_go_on_to_the_same_births(toy, tmp_path, way, search):
    recipe = toy(recipe=search + SUMMED, generations=4)
    steered(recipe, tmp_path / "all", ASKED)
    recipe = toy(recipe=search + SUMMED + LOG.format(way), generations=4)
    steered(recipe, tmp_path / "whole", ASKED)
    whole = evocity.open_run(tmp_path / "whole")
    same_as_all(tmp_path / "whole", evocity.open_run(tmp_path / "all"))
    early = {generation: ASKED[generation] for generation in (0, 1)}
    steered(recipe, tmp_path / "stopped", early, stop_after=2)
    # as if it was killed between the births and the membership of the last
    (tmp_path / "stopped" / "membership" / "generation-00000002.parquet").unlink()
    with Search.resume(tmp_path / "stopped", workers=0) as again:
        for generation in again:
            again.flush()
            for command in ASKED[2] if generation.number == 2 else ():
                send(tmp_path / "stopped", command)
    found = evocity.open_run(tmp_path / "stopped").births().drop_columns(["seconds"])
    assert found.equals(whole.births().drop_columns(["seconds"]))


def test_births_that_are_measured_elsewhere_are_left_out_too(toy, tmp_path):
    recipe = toy(recipe=LOG.format("front"))
    run_of(tmp_path / "whole", recipe)
    with Search(read_recipe(recipe), out=tmp_path / "told", workers=0) as search:
        search.prepare()
        own = Evaluator(search._prepared.setup)
        while not search.finished:
            search.tell([own.evaluate(one) for one in search.ask()])
    found, whole = (evocity.open_run(tmp_path / one) for one in ("told", "whole"))
    assert found.births().drop_columns(["seconds"]).equals(whole.births().drop_columns(["seconds"]))


# -- what is left out ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", operators.OPERATORS)
def test_every_operator_of_evocity_is_nothing_but_its_parameters(name):
    operator = operators.make(name)
    again = describe_rebreeding(BirthPlan(9, operator, (1, 2), (), birth_generator(0, 1, 1)))
    made = operators.make(name, **json.loads(again.settings))
    assert json.dumps(vars(made)) == json.dumps(vars(operator))


@dataclass(frozen=True)
class Numbered:
    """A plugin's operator with something that its parameters do not tell."""

    name = "mutation"
    rate: float = 0.5

    def __post_init__(self):
        object.__setattr__(self, "memory", [1])


@pytest.mark.parametrize("operator", [None, Numbered(), Drawn("x", (1, 1), {"a": {1}}, {})])
def test_what_its_parameters_do_not_tell_is_kept(operator):
    assert describe_rebreeding(BirthPlan(9, operator, (), (), birth_generator(0, 1, 1))) is None


@given(st.integers(0, 2**63), st.lists(st.sampled_from(["u", "n", "i"]), max_size=5))
def test_a_generator_goes_on_from_its_state(seed, drawn):
    rng = np.random.default_rng(seed)
    for kind in drawn:
        {"u": rng.random, "n": rng.normal, "i": lambda: rng.integers(9, dtype=np.uint32)}[kind]()
    again = generator_at(state_of(rng))
    assert again.integers(1 << 30, size=3, dtype=np.uint32).tolist() == (
        rng.integers(1 << 30, size=3, dtype=np.uint32).tolist()
    )
    assert again.random(5).tolist() == rng.random(5).tolist()


class Code:
    digest = "d"


def birth(identifier, parents, again=True):
    told = Reconstruction("{}", bytes(37)) if again else None
    return Birth(
        1, identifier, parents, "mutation", "ok", None, 0.0, {}, Code(), reconstruction=told
    )


def test_a_chain_of_those_left_out_is_broken_where_it_would_be_too_long():
    leaving = OmittedGenomes("front")
    written = [
        leaving.omit_from([birth(n, (n - 1,) if n else (), again=n > 0)], [Member(0, n, 1)])[0]
        for n in range(20)
    ]
    counts = [one.reconstruction.breedings if one.left_out else 0 for one in written]
    assert counts == [0, *range(1, MOST_BREEDINGS + 1), 0, *range(1, MOST_BREEDINGS + 1), 0, 1]


@given(
    st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50), st.booleans(), st.integers(0, 2))),
    st.sampled_from(WAYS),
)
def test_none_takes_more_breedings_than_it_is_told_to(told, way):
    leaving, cost = OmittedGenomes(way), []
    for number, (one, other, again, rank) in enumerate(told):
        parents = tuple(p % number for p in (one, other)) if number else ()
        members = [Member(0, number, rank)] if rank < 2 else []
        (found,) = leaving.omit_from([birth(number, parents, again)], members)
        needed = 1 + sum(cost[p] for p in parents)
        kept = not again or (members and (way == "survivors" or rank == 0))
        assert found.left_out == (not kept and needed <= MOST_BREEDINGS)
        cost.append(needed if found.left_out else 0)


# -- what is wrong ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def front(tmp_path_factory):
    folder = tmp_path_factory.mktemp("front")
    run_of(folder / "run", write_toy(folder, recipe=LOG.format("front")))
    return folder


@pytest.fixture
def copy(front, tmp_path):
    shutil.copytree(front, tmp_path / "copy")
    return tmp_path / "copy" / "run"


def changed(path, column, value, operator="mutation"):
    """The run with one value changed of a birth of its last generation that is left out; its
    id."""
    run = evocity.open_run(path)
    rows = run.births(3, ["operator", "breedings"]).to_pylist()
    at = next(n for n, one in enumerate(rows) if one["breedings"] and one["operator"] == operator)
    (piece,) = (path / "births").glob("generation-00000003*")
    table = pq.read_table(piece)
    values, kind = table[column].to_pylist(), table.schema.field(column)
    values[at] = value(values[at])
    column = table.column_names.index(column)
    pq.write_table(table.set_column(column, kind, pa.array(values, kind.type)), piece)
    return 24 + at


@pytest.mark.parametrize(
    ("column", "value", "says"),
    [
        (
            "generator",
            lambda old: bytes(16) + old[16:],
            "gets a different genome when the operator mutation",
        ),
        ("genome", lambda old: "0" * 32, "gets a different genome when the operator mutation"),
        ("settings", lambda old: '{"rate": 7}', "cannot be bred again"),
        ("settings", lambda old: "[", "cannot be bred again"),
        ("operator", lambda old: "nobody", "cannot be bred again"),
        ("breedings", lambda old: 8, "damaged"),
        ("breedings", lambda old: 9, "damaged"),
        ("breedings", lambda old: 0, "damaged"),
        ("settings", lambda old: None, "damaged"),
        ("genome", lambda old: None, "damaged"),
        ("parents", lambda old: [10**6], "no individual"),
        ("parents", lambda old: [31], "damaged"),
    ],
)
def test_a_log_that_tells_of_another_genome_is_refused(copy, column, value, says):
    identifier = changed(copy, column, value)
    with pytest.raises(RunError, match=says) as told:
        evocity.open_run(copy).genome(identifier)
    text = str(told.value)
    assert text.count("expected:") == text.count("what to do:") == 1
    if says.startswith("is another"):
        assert "evocity 0." in text


def test_replay_compares_digests_of_what_was_not_kept(copy):
    identifier = changed(copy, "genome", lambda old: "0" * 32)
    (found,) = evocity.replay(copy, [identifier])
    assert list(found.differs) == ["genome"]
    assert found.differs["genome"]["then"] == "0" * 32


def test_a_run_opened_by_the_store_alone_says_how_to_open_it(front):
    run = open_without(front / "run")
    with pytest.raises(RunError, match=r"evocity\.open_run"):
        run.individuals(left_out(run)[:1])
    (one,) = run.individuals(left_out(run)[:1], rebred=False)
    assert one.genome is None
    assert one.left_out
    assert one.digest == one.reconstruction.digest


def test_ancestors_of_a_strangers_log_are_not_followed_without_end(copy):
    (piece,) = (copy / "births").glob("generation-00000003*")
    table = pq.read_table(piece)
    identifiers = table["id"].to_pylist()
    column = table.column_names.index("parents")
    told = [[max(0, one - 1)] for one in identifiers]
    kind = table.schema.field("parents")
    pq.write_table(table.set_column(column, kind, pa.array(told, kind.type)), piece)
    run = evocity.open_run(copy)
    with pytest.raises(RunError, match="damaged"):
        run.individuals([one for one in left_out(run) if one >= 24])


def test_a_run_keeps_what_it_began_to_keep(copy):
    recipe = copy.parent / "toy.toml"
    recipe.write_text(recipe.read_text().replace('genomes = "front"', 'genomes = "all"'))
    with pytest.raises(RecipeError, match=r"log\.genomes: was 'front', is 'all'"):
        Search.resume(copy, recipe=recipe, generations=4, workers=0)


def test_faults_of_the_section_are_told_with_all_others(toy):
    with pytest.raises(RecipeError) as told:
        read_recipe(toy(recipe='[log]\ngenomes = "some"\nkeep = 1\n[stop]\nstagnation = 0\n'))
    text = str(told.value)
    assert "log.genomes: 'some'; allowed: 'all', 'survivors' or 'front'" in text
    assert "log.keep: unknown key; allowed: genomes" in text
    assert "stop.stagnation" in text
