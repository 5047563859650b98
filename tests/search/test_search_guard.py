"""Guards: constraints of which the parents' codes have most, said before the first birth."""

import math
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_search_recipe import replaced
from test_search_run import run

from evocity import CityMap, fitness
from evocity.coding import decode
from evocity.errors import RecipeError, RunError
from evocity.fitness import Constraint, Measure
from evocity.recipe.mixture import plan_operators
from evocity.report import unrecorded, write_report
from evocity.search import Search, archive, read_recipe
from evocity.search.calibration.guard import OF_FABRIC, calibrate_bound, tighten_bound
from evocity.search.calibration.recipe_notes import _note_idle, _note_unkept, notes_on
from evocity.search.calibration.recipe_text import Bound, Goal
from evocity.search.preparation.constraints import ParentConstraint, describe_unkept, round_bound
from evocity.search.preparation.constraints import parent_constraints as bounds_of
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

#: Of children undefined; of what they have of their sources, too little for a bound of .5.
OWN = """
import evocity

@evocity.fitness(goal="max")
def settled(city, genome, parents):
    if parents[0] is genome:
        return 1.0
    return evocity.fitness.Undefined("a child")

@evocity.fitness(goal="max", range=(0, 1))
def kin(city, genome, sources):
    return 0.25 + 0.125 * genome.parent[0]

@evocity.fitness(goal="max")
def moody(city):
    raise ValueError("out of sorts")
"""
SPREAD = '[[fitness]]\nfile = "toys.py"\nname = "spread"\n'


def guarded(toy, bounds, **settings):
    path = replaced(toy(**settings), '[[fitness]]\nfile = "toys.py"\n', SPREAD + bounds)
    (path.parent / "own.py").write_text(OWN, encoding="utf-8")
    return path


def of_own(name, bound):
    return f'[[fitness]]\nfile = "own.py"\nname = "{name}"\n{bound}\n'


# -- a constraint that is undefined ------------------------------------------------------------


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_a_constraint_that_is_undefined_is_broken_and_ends_nothing(toy, tmp_path, workers):
    path = guarded(toy, of_own("settled", "min = 0.5"), max_failures=0.0)
    last = run(path, tmp_path / "run", workers=workers)[-1]
    assert last.failures == 0
    assert {one.id for one in last.population if not one.violation} == {0, 1}
    assert last.population[0].violation == 0 < last.population[-1].violation
    found = RunLog(tmp_path / "run")
    for row in found.births().to_pylist():
        child = row["id"] > 1
        assert row["status"] == "ok"
        assert row["feasible"] is not child
        assert row["fitness.settled"] == (None if child else 1.0)
        reason = "not recorded: settled is nan: a child, which breaks its bound"
        assert row["error"] == (reason if child else None)
    assert set(archive(found).births["id"].to_pylist()) <= {0, 1}
    count = len(found.births())
    assert unrecorded(found).startswith(f"{count - 2} of {count} births, such as: settled is nan")
    page = write_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "break a constraint" in page
    text = re.sub(r"data:[^\"]*", "", page.partition('<script type="application')[0])
    assert "NaN" not in text


def test_a_run_with_undefined_constraints_resumes_to_the_same_rows(toy, tmp_path):
    path = guarded(toy, of_own("settled", "min = 0.5"))
    run(path, tmp_path / "whole", workers=0)
    run(path, tmp_path / "parts", workers=0, generations=1)
    with Search.resume(tmp_path / "parts", generations=3, workers=0) as search:
        list(search)
    whole, parts = (
        RunLog(tmp_path / name).births().drop_columns(["seconds"]) for name in ("whole", "parts")
    )
    assert whole.equals(parts)


def test_a_goal_that_is_undefined_still_fails(toy, tmp_path):
    path = guarded(toy, of_own("settled", 'min = 0.5\ngoal = "max"'), max_failures=1.0)
    run(path, tmp_path / "run", workers=0, generations=0)
    births = RunLog(tmp_path / "run").births(columns=["id", "status"]).to_pylist()
    assert {row["status"] for row in births if row["id"] > 1} == {"invalid"}


def test_what_is_told_as_nan_breaks_a_constraint(toy):
    path = guarded(toy, of_own("settled", "min = 0.5"))
    with Search(read_recipe(path), workers=0) as search:
        genomes = search.ask()
        told = [{"spread": 1.0, "settled": math.nan if k else 1.0} for k in range(len(genomes))]
        told[2] = {"spread": math.nan, "settled": 1.0}
        found = search.tell(told)
    assert (found.feasible, found.failures) == (1, 1)


# -- what no parent keeps ----------------------------------------------------------------------


def test_a_bound_that_no_parent_keeps_is_told_before_the_first_birth(toy, tmp_path):
    path = guarded(toy, '[[fitness]]\nname = "gsi"\nmin = 0.9\n')
    with Search(read_recipe(path), out=tmp_path / "run", workers=0) as search:
        search.prepare()
        (told,) = [note for note in search.notes if "keeps" in note]
        assert len(RunLog(tmp_path / "run").generations) == 0
        sources = RunLog(tmp_path / "run").sources()
        densities = [fitness.gsi(decode(source.genome).city) for source in sources]
        had = ", ".join(
            f"{source.name} {value:.4g}" for source, value in zip(sources, densities, strict=True)
        )
        assert told.startswith(f"no parent's own code keeps gsi ≥ 0.9: {had}; ")
        best = max(densities)
        (bound,) = re.findall(r"write min = ([\d.]+), which one keeps", told)
        assert 0.99 * best < float(bound) <= best
        assert next(iter(search)).feasible == 0


def test_what_a_parent_keeps_is_not_spoken_of(toy, tmp_path):
    path = guarded(toy, of_own("kin", "min = 0.3"))
    with Search(read_recipe(path), workers=0) as search:
        search.prepare()
        assert not [note for note in search.notes if "keeps" in note]


def test_a_guard_that_no_parent_keeps_is_refused(toy, tmp_path):
    path = guarded(toy, of_own("kin", "min = 0.5"))
    with (
        pytest.raises(RecipeError, match=r"code keeps kin ≥ 0\.5: left 0\.25, right") as told,
        Search(read_recipe(path), out=tmp_path / "run", workers=0) as search,
    ):
        list(search)
    assert told.value.remedy == "write min = 0.375 for kin"
    assert not (tmp_path / "run").exists()


def test_a_search_that_was_refused_may_be_asked_again(toy):
    path = guarded(toy, of_own("kin", "min = 0.5"))
    search = Search(read_recipe(path), workers=0)
    for _ in range(2):
        with pytest.raises(RecipeError, match="kin"):
            search.prepare()
    assert len(search.ask()) == 8  # who evaluates elsewhere knows what they ask for
    search.close()
    with pytest.raises(RunError, match="closed"):
        search.prepare()


def test_a_measure_that_fails_on_the_parents_is_not_judged(toy, tmp_path):
    path = guarded(toy, of_own("moody", "min = 0.5"), max_failures=1.0)
    with (
        pytest.raises(RunError, match="out of sorts"),
        Search(read_recipe(path), workers=0) as search,
    ):
        list(search)


def test_parents_that_keep_each_bound_but_none_of_them_all(toy):
    path = guarded(toy, of_own("kin", "min = 0.3"))
    recipe = read_recipe(path)
    prepared = prepare(recipe)
    values = [{"kin": 0.25, "spread": 1.0}, {"kin": 0.375, "spread": 1.0}]
    (kin,) = bounds_of(prepared, [Births(one) for one in values])
    assert (kin.keepers, kin.inherited, kin.bounds_text) == ({"right"}, True, "kin ≥ 0.3")
    other = ParentConstraint(Constraint(fitness.gsi, high=0.4), {"left": 0.3, "right": 0.5}, False)
    (told,) = describe_unkept([kin, other])
    assert told.endswith("all constraints at once. Kept are kin ≥ 0.3: right; gsi ≤ 0.4: left")
    (told,) = describe_unkept([other])
    assert "right breaks gsi ≤ 0.4 (0.5). Children" in told
    assert "left" not in told
    unknown = ParentConstraint(Constraint(fitness.gsi, high=0.4), {"a": 0.3, "b": math.nan}, False)
    assert describe_unkept([unknown]) == []


class Births:
    status = "ok"

    def __init__(self, values):
        self.values = values


@pytest.mark.parametrize(
    ("goal", "low", "high", "values", "hopeless", "nearest"),
    [
        ("max", 0.5, None, (0.2, 0.4), True, "min = 0.4"),
        ("max", 0.5, None, (0.2, math.nan), True, "min = 0.2"),
        ("max", 0.5, None, (math.nan, math.nan), True, ""),
        ("max", None, 0.5, (0.8, 0.9), False, "max = 0.8"),  # to be unlike one's parents
        ("max", 0.2, 0.5, (0.8, 0.9), False, "max = 0.8"),
        ("max", 0.4, 0.5, (0.1, 0.2), True, "min = 0.2"),
        ("min", None, 0.15, (0.2, 0.23456), True, "max = 0.2"),
        ("min", None, 0.15, (0.23456,), True, "max = 0.235"),
        ("min", 0.3, None, (0.1, 0.12345), False, "min = 0.123"),
        (None, 0.5, None, (0.1, 0.2), False, "min = 0.2"),
    ],
)
def test_which_bounds_are_hopeless_and_what_is_nearest(goal, low, high, values, hopeless, nearest):
    measure = Measure("m", lambda city: 0.0, goal, "", (0, 1), "", "", 0)
    had = {f"city-{k}": value for k, value in enumerate(values)}
    one = ParentConstraint(Constraint(measure, low, high), had, inherited=True)
    assert (one.hopeless, one.nearest, one.keepers) == (hopeless, nearest, set())
    assert not ParentConstraint(one.constraint, had, inherited=False).hopeless
    if nearest:
        key, bound = nearest.split(" = ")
        near = Constraint(measure, **{{"min": "low", "max": "high"}[key]: float(bound)})
        assert any(not near.violation(value) for value in values if not math.isnan(value))


@pytest.mark.parametrize("value", [1234.5, 0.0123456, -0.0123456, 3.0])
def test_bounds_are_rounded_so_that_the_value_keeps_them(value):
    down, up = round_bound(value, up=False), round_bound(value, up=True)
    assert down <= value <= up
    assert up - down <= 0.01 * abs(value)


def test_the_demonstration_has_a_guard_that_its_parents_keep():
    recipe = read_recipe("demo")
    guard = {one.name: (one.min, one.max) for one in recipe.fitness if not one.is_objective}
    assert guard == {
        "integrity": (0.5, None),
        "fabric_distance": (None, 0.15),
        "street_distance": (None, 0.1),
        "repetition": (None, 0.01),
        "smallest_share": (0.25, None),
        "slivers": (None, 0.254),
        "small_buildings": (None, 1.78),
        "gsi": (0.179, 0.668),
        "fsi": (0.682, 5.44),
    }
    weights = {name: entry.weight for name, entry in recipe.operators.items()}
    assert weights == {name: entry.weight for name, entry in plan_operators().items()}


# -- the guard of a new recipe -----------------------------------------------------------------


@given(
    st.sampled_from(OF_FABRIC),
    st.lists(st.tuples(st.floats(0, 50), st.floats(0, 50)), min_size=2, max_size=4),
    st.floats(0, 60),
)
def test_all_codes_keep_the_guard_and_a_heap_breaks_it_or_a_note_says_so(name, pairs, heap):
    values = {str(k): pair for k, pair in enumerate(pairs)}
    usual = calibrate_bound(fitness.get(name), values)
    bound, note = tighten_bound(usual, values, heap)
    assert all(code <= bound.max for _, code in pairs)
    assert bound.max <= usual.max
    assert (heap > bound.max) == (not note)
    assert (bound == usual) == (heap > usual.max or bool(note))
    assert "bounds nothing" in note or not note


def test_the_guard_of_coarse_pixels_is_tightened():
    """Values of Lyon and Montpellier at 4 m, and of a heap of both."""
    far = {"lyon": (-0.015, 0.375), "montpellier": (-0.038, -0.024)}
    usual = calibrate_bound(fitness.fabric_distance, far)
    assert usual.max == 0.75
    assert tighten_bound(usual, far, 0.72) == (replace(usual, max=0.548, tightened=True), "")
    few = {"lyon": (1.83, 10.8), "montpellier": (1.22, 1.53)}
    small = calibrate_bound(fitness.small_buildings, few)
    assert (small.max, small.relaxed) == (10.8, True)
    strips = {"lyon": (0.153, 0.469), "montpellier": (0.176, 0.198)}
    loose = calibrate_bound(fitness.slivers, strips)
    bound, note = tighten_bound(loose, strips, 0.417)
    assert bound == loose
    assert "smaller pixels" in note


def test_bounds_that_no_code_keeps_or_that_bound_nothing_are_noted():
    def goal(measure, **bounds):
        return Goal(measure, bounds=bounds, is_constraint=True)

    values = {"gsi": {"a": (0.5, 0.6), "b": (0.2, 0.25)}, "smallest_share": {"a": (0.0, 0.0)}}
    kept, unkept = goal(fitness.gsi, max=0.3), goal(fitness.gsi, min=0.45, max=0.55)
    assert _note_unkept([kept], [], values) == []
    (note,) = _note_unkept([unkept], [], values)
    assert "no parent's own code keeps min = 0.45 and max = 0.55" in note
    assert _note_unkept([goal(fitness.gsi, min=0.9)], [], values) == []  # as no map keeps it
    (note,) = _note_unkept([], [Bound(fitness.gsi, min=0.9)], values)
    assert "the codes have 0.6, 0.25" in note
    assert _note_unkept([], [Bound(fitness.smallest_share, min=0.2)], values) == []
    (note,) = _note_idle([goal(fitness.gsi, min=0.0, max=1.0), kept])
    assert note.startswith("gsi: its bounds bound nothing")


def test_notes_name_maps_without_heights_and_without_attribution(town):
    heights = town.heights
    whole = CityMap(heights, 2.0, height_rules={"height": 9}, attribution="© someone")
    bare = CityMap(heights, 2.0, name="bare", height_rules={"default": 5, "height": 4})
    notes = notes_on([], [], {}, [whole, bare])
    assert [note.partition(":")[0] for note in notes] == ["bare", "bare"]
    assert "get the default" in notes[0]
    assert "attribution under [[parents]]" in notes[1]
    assert notes_on([], [], {}, [whole, whole]) == []
    assert len(notes_on([], [], {}, [bare, bare])) == 1  # no parent has heights
