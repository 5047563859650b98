"""Commands to a run that goes on: stops, picks and weights, logged and replayed."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_run import rows, run, started

from evocity.errors import RunError
from evocity.search import Search, archive, read_recipe
from evocity.search.breeding.birth_plans import Picks
from evocity.search.record import commands
from evocity.search.record.commands import (
    Pick,
    Reweight,
    StandingOrders,
    Stop,
    Unpick,
    command_document,
    command_of,
    command_state,
)
from evocity.search.steering.observers import Observer
from evocity.store import RunLog, append_command

SUMMED = """
[[fitness]]
name = "gsi"
target = 0.3
objective = "form"
[[fitness]]
name = "mean_height"
target = 9.0
objective = "form"
"""


def events(path, *kinds):
    return [one for one in RunLog(path).events() if one["event"] in kinds]


def steered(recipe, out, asked, workers=0, stop_after=None, **overrides):
    """A run that gets the commands ``asked``, generation -> commands, once that is written."""
    with Search(read_recipe(recipe, **overrides), out=out, workers=workers) as search:
        for generation in search:
            search.flush()
            for command in asked.get(generation.number, ()):
                commands.send(out, command)
            if generation.number == stop_after:
                break


ASKED = {
    0: [Pick(ids=(3, 5), share=0.9)],
    1: [Unpick(ids=(3,)), Pick(ids=(9,)), Reweight(weights={"mutation": 0, "gsi": 50.0})],
    2: [Reweight(weights={"lambda_crossover": 4})],
}


@pytest.mark.slow
def test_picks_and_weights_are_replayed_by_any_number_of_workers(toy, tmp_path):
    recipe = toy(recipe=SUMMED, generations=5)
    steered(recipe, tmp_path / "whole", ASKED)
    steered(recipe, tmp_path / "two", ASKED, workers=2)
    expected = rows(tmp_path / "whole")
    assert rows(tmp_path / "two") == expected
    assert len(events(tmp_path / "whole", "command")) == 5
    run(recipe, tmp_path / "plain", workers=0)
    assert rows(tmp_path / "plain") != expected
    for last in range(5):
        out = tmp_path / f"stopped-{last}"
        steered(recipe, out, ASKED, stop_after=last)
        with Search.resume(out, workers=0) as search:
            for generation in search:
                search.flush()
                for command in ASKED.get(generation.number, ()):
                    commands.send(out, command)
        assert rows(out) == expected


def test_a_command_told_but_not_bred_by_counts_once(toy, tmp_path):
    """A crash after the event and before the generation: the line is not carried out again."""
    recipe = toy(generations=3)
    asked = {1: [Pick(ids=(9,), share=1)]}
    steered(recipe, tmp_path / "whole", asked)
    out = tmp_path / "cut"
    steered(recipe, out, asked)
    for kind in ("births", "membership"):
        for number in (2, 3):
            (out / kind / f"generation-{number:08d}.parquet").unlink()
    with Search.resume(out, workers=0) as search:
        assert [one.number for one in search] == [2, 3]
    assert rows(out) == rows(tmp_path / "whole")
    assert len(events(out, "command")) == 1


def test_picks_are_bred_from(toy, tmp_path):
    out = tmp_path / "run"
    steered(toy(generations=3), out, {1: [Pick(ids=(2, 4), share=1)]})
    births = RunLog(out).births().to_pylist()
    bred = [b for b in births if b["generation"] > 1]
    assert {b["parents"][0] for b in bred} == {2, 4}
    assert all(len(set(b["parents"])) == len(b["parents"]) for b in bred)


def test_the_share_is_met():
    rng = np.random.default_rng(1)
    picks = Picks(((7, "a"), (8, "b")), share=0.3)
    firsts = [picks.among([(1, "x"), (7, "a")], rng)[0][0] for _ in range(2000)]
    assert np.mean([one in (7, 8) for one in firsts]) == pytest.approx(0.3, abs=0.04)
    assert Picks().among([(1, "x")], None) == [(1, "x")]


def test_a_stop_ends_after_the_generation_and_resuming_goes_on(toy, tmp_path):
    recipe = toy(generations=4)
    run(recipe, tmp_path / "whole", workers=0)
    out = tmp_path / "run"
    with Search(read_recipe(recipe), out=out, workers=0) as search:
        seen = []
        for generation in search:
            seen.append(generation.number)
            if generation.number == 1:
                commands.send(out, Stop())
    assert seen == [0, 1]
    assert search.asked_to_stop
    assert not search.finished
    assert events(out, "stop")[-1]["reason"] == "asked to"
    with pytest.raises(RunError, match="this run is not in progress"):
        commands.send(out, Stop())
    with open(out / "commands.jsonl", "a") as file:  # a stop of before is over
        file.write('{"command": "stop"}\n')
    assert [one.number for one in Search.resume(out, workers=0)] == [2, 3, 4]
    assert rows(out) == rows(tmp_path / "whole")
    assert "had ended" in events(out, "command refused")[0]["reason"]


@pytest.mark.slow
def test_another_process_may_ask(toy, tmp_path):
    recipe, out = toy(generations=400), tmp_path / "run"
    process = started(recipe, out)
    try:
        assert process.stdout.readline().strip() == b"0"
        assert commands.send(out, Pick(ids=(1,)))
        assert commands.send(out, Stop())
        process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0
    assert [one["command"] for one in events(out, "command")] == ["pick", "stop"]


def test_what_is_no_command_is_refused_and_told(toy, tmp_path):
    out = tmp_path / "run"
    bad = [
        "no JSON",
        '{"command": "dance"}',
        '{"command": "pick", "ids": []}',
        '{"command": "pick", "ids": [99]}',
        '{"command": "reweight", "weights": {"mutation": 1e9}}',
        '{"command": "reweight", "weights": {"spread": 2}}',
        '{"command": "pick", "ids": [1], "share": 0.5}',
        '{"command": "pick", "ids": [2]',
    ]
    with Search(read_recipe(toy()), out=out, workers=0) as search:
        next(iter(search))
        (out / "commands.jsonl").write_text("\n".join(bad))
        for _ in search:
            pass
    refused = events(out, "command refused")
    assert [one["line"] for one in refused] == [0, 1, 2, 3, 4, 5]
    assert "no individual 99" in refused[3]["reason"]
    assert [one["ids"] for one in events(out, "command")] == [[1]]


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (Pick(ids=(1, 99)), "no individual 99"),
        (Pick(ids=(8,)), "individual 8 failed"),
        (Reweight(weights={"spread": 2}), "has no weight 'spread'"),
        (Reweight(weights={"mutaton": 2}), "did you mean mutation"),
        (Stop(), "this run is not in progress"),
    ],
)
def test_commands_that_cannot_be_carried_out_are_refused_at_once(toy, tmp_path, command, says):
    body = """
@evocity.fitness(goal="max")
def first(city):
    if number(city) % 3 == 0:
        raise ValueError("no")
    return 1.0
"""
    out = tmp_path / "run"
    run(toy(body, max_failures=1), out, workers=0, generations=2)
    if isinstance(command, Pick) and command.ids == (8,):
        failed = next(b["id"] for b in RunLog(out).births().to_pylist() if b["status"] != "ok")
        command, says = Pick(ids=(failed,)), f"individual {failed} failed"
    with pytest.raises(RunError, match=says):
        commands.send(out, command)
    assert not (out / "commands.jsonl").exists()


def test_all_weights_of_nothing_are_refused(toy, tmp_path):
    names = ("pavement_fusion", "lambda_crossover", "mutation")
    out, nothing = tmp_path / "run", Reweight(weights=dict.fromkeys(names, 0))
    with Search(read_recipe(toy()), out=out, workers=0) as search:
        for generation in search:
            if generation.number == 0:
                with pytest.raises(RunError, match="all operators would have the weight 0"):
                    commands.send(out, nothing)
                commands.send(out, Reweight(weights=dict.fromkeys(names[:2], 0)))
                with pytest.raises(RunError, match="all operators"):  # with what waits
                    commands.send(out, Reweight(weights={"mutation": 0}))
                append_command(out / "commands.jsonl", command_document(nothing))
    assert "weight 0" in events(out, "command refused")[0]["reason"]


def test_an_algorithm_that_breeds_by_itself_weighs_no_operators(toy, tmp_path):
    recipe = toy(
        '\n@evocity.fitness(goal="max")\ndef first(city):\n    return number(city)\n',
        recipe='[search]\nalgorithm = "cma"\nside = 2\n',
    )
    run(recipe, tmp_path / "run", workers=0, generations=1)
    with pytest.raises(RunError, match="has no weight 'mutation'"):
        commands.send(tmp_path / "run", Reweight(weights={"mutation": 2}))


def test_what_waits_and_what_was_refused_is_told(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=1)
    commands.send(out, Pick(ids=(1, 3), share=0.25))
    commands.send(out, Unpick(ids=(3,)))
    with (out / "commands.jsonl").open("a") as lines:
        lines.write('no JSON\n{"command": "pick", "ids": [99]}\n')
    asked = command_state(RunLog(out))
    assert [one.words for one in asked.pending] == [
        "picked: 1 3, first parents of 25 % of the births",
        "no longer picked: 3",
        "picked: 99",
    ]
    assert (asked.refused, asked.orders.picks) == ((), (1, 99))
    for ids, says in (((3,), "3 is not picked"), ((3, 5), "3 5 are not picked")):
        with pytest.raises(RunError, match=says):
            commands.send(out, Unpick(ids=ids))
    with Search.resume(out, generations=2, workers=0) as search:
        for _ in search:
            pass
    asked = command_state(RunLog(out))
    assert (asked.pending, asked.orders.picks) == ((), (1,))
    assert [generation for generation, _ in asked.refused] == [2, 2]
    commands.send(out, Unpick())
    with pytest.raises(RunError, match="nobody is picked"):
        commands.send(out, Unpick())


def test_new_weights_of_a_sum_count_at_once_and_in_the_archive(toy, tmp_path):
    out = tmp_path / "run"
    recipe = toy(recipe=SUMMED, generations=3)
    steered(recipe, out, {1: [Reweight(weights={"gsi": 1000.0})]})
    (run_,) = [RunLog(out)]
    told_of = {one["id"]: one for one in run_.births().to_pylist()}
    front = archive(run_).births.to_pylist()
    best = min(abs(one["fitness.gsi"] - 0.3) for one in told_of.values())
    assert min(abs(one["fitness.gsi"] - 0.3) for one in front) == best
    resumed = Search.resume(out, workers=0, generations=4)
    assert resumed._population.islands[0].aims.wanted[-2].weight == 1000.0
    resumed.close()


def test_a_search_without_a_folder_is_steered_too(toy):
    with Search(read_recipe(toy(generations=4)), workers=0) as search:
        generations = iter(search)
        living = next(generations).population
        search.pick([living[0].id, 10_000], share=1.0)  # refused whole
        assert search._steering.picks.individuals == ()
        next(generations)
        search.pick([search._population.living[0].id], share=1.0)
        next(generations)
        assert len(search._steering.picks.individuals) == 1
        search.reweight(mutation=0)
        search.stop()
        assert list(generations) == []
    assert search.asked_to_stop
    with Search(read_recipe(toy(generations=4)), workers=0) as search:
        search.stop()
        with pytest.raises(RunError, match="asked to stop"):
            search.ask()


def test_observers_see_all_and_cannot_end_a_night(toy, tmp_path):
    class Watcher(Observer):
        def __init__(self):
            self.seen, self.told = [], []

        def generation(self, generation, births, members):
            self.seen.append((generation.number, len(births), len(members)))

        def event(self, event, details):
            self.told.append(event)

    class Clumsy(Observer):
        def generation(self, generation, births, members):
            raise ValueError("clumsy")

    watcher, out = Watcher(), tmp_path / "run"
    with Search(read_recipe(toy()), out=out, workers=0, observers=[Clumsy(), watcher]) as search:
        assert [one.number for one in search] == [0, 1, 2, 3]
    assert watcher.seen == [(n, 8, 8) for n in range(4)]
    assert watcher.told == ["start", "observer failed", "finish"]
    assert events(out, "observer failed")[0]["observer"] == "Clumsy"


COMMANDS = st.one_of(
    st.just(Stop()),
    st.builds(
        Pick,
        ids=st.lists(st.integers(0, 99), min_size=1).map(tuple),
        share=st.none() | st.floats(0.01, 1),
    ),
    st.builds(Unpick, ids=st.lists(st.integers(0, 99)).map(tuple)),
    st.builds(
        Reweight,
        weights=st.dictionaries(st.sampled_from("abc"), st.floats(0, 1e6), min_size=1),
    ),
)


@given(st.lists(COMMANDS))
def test_what_stands_is_what_the_events_tell(asked):
    written = [json.loads(json.dumps(command_document(one))) for one in asked]
    assert [command_of(one) for one in written] == asked
    standing = StandingOrders()
    for one in asked:
        standing = standing if isinstance(one, Stop) else standing.after(one)
    events = [{"event": "command", "generation": g, **one} for g, one in enumerate(written)]
    assert StandingOrders.of(events, len(asked)) == standing
    assert StandingOrders.of(events, -1) == StandingOrders()
    assert len(set(standing.picks)) == len(standing.picks)
