"""Laws of changed plans: streets stay connected, no street ends, other faces stay as they are."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity.citymap import BUILT_ABOVE
from evocity.errors import MapError
from evocity.operators.plans import (
    CHANGE_KINDS,
    apply_changes,
    changes,
    draw_change,
    plan_of,
    renumbering,
)
from evocity.operators.plans.changed import axes_of, clip_buildings
from evocity.operators.plans.plan import LEAST_WIDTH, build_plan
from evocity.views.connected_components import pieces

NAMES = "lyon-1er", "new-york-west-village"
#: Arrays that a face keeps; windows, areas and centres are computed from its pixels.
KEPT = ("coverage", "front", "angle", "order", "open", "at_frame", "area", "lot_area", "windows")


@pytest.fixture(scope="module")
def plans():
    return {name: plan_of(evocity.read_map(name)) for name in NAMES}


def assert_lawful(plan):
    """A changed plan keeps the laws of plans."""
    numbers = np.unique(plan.labels)
    assert numbers[numbers > 0].tolist() == list(range(1, len(plan) + 1))
    assert (plan.labels[plan.lots > 0] == plan.lots[plan.lots > 0]).all()
    # no street ends within a face: an axis has a face on each side, but for bends of one pixel
    assert (axes_of(plan.labels) == (plan.labels == 0)).all()
    assert (np.diff(plan.area) <= 0).all()
    for face in range(1, len(plan) + 1):
        here = plan.labels == face
        assert pieces(here, corners=True)[1] == 1
        assert (plan.labels[plan.window(face)] == face).sum() == here.sum()
        assert plan.area[face - 1] == here.sum() * plan.metres_per_pixel**2
        assert plan.lot_area[face - 1] == (plan.lots == face).sum() * plan.metres_per_pixel**2
    assert (plan.coverage >= 0).all()
    assert (plan.coverage <= 1).all()
    assert not (plan.heights[plan.lots == 0] > BUILT_ABOVE).any()
    assert plan.summary()["faces"]


def assert_unchanged_elsewhere(old, new):
    kept = renumbering(old, new)
    for face, number in kept.items():
        assert np.array_equal(old.labels == face, new.labels == number)
        assert np.array_equal(old.lots == face, new.lots == number)
        for name in KEPT:
            assert np.array_equal(getattr(old, name)[face - 1], getattr(new, name)[number - 1])
        assert old.centre[face - 1] == pytest.approx(new.centre[number - 1])
    assert len(set(kept.values())) == len(kept)
    return kept


def streets(plan):
    return pieces(axes_of(plan.labels), corners=True)[1]


def draw_all(plan, kinds, seed, plans=None):
    """Draw changes one after another, each for the plan that the others made."""
    rng, drawn = np.random.default_rng(seed), []
    for kind in kinds:
        change = draw_change(kind, plan, rng, plans)
        if change is not None:
            drawn.append(change)
            new = apply_changes(plan, [change], plans)
            assert_lawful(new)
            kept = assert_unchanged_elsewhere(plan, new)
            assert len(kept) < max(len(plan), len(new))
            if kind != "seam":
                assert streets(new) <= streets(plan)
                assert len(plan) - len(kept) <= 2
            plan = new
    return drawn, plan


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    buildings=st.integers(5, 60),
    kinds=st.lists(st.sampled_from(CHANGE_KINDS), min_size=1, max_size=4),
)
def test_changes_of_towns_keep_the_laws(seed, buildings, kinds):
    first, second = (plan_of(draw_town(seed + k, side=96, buildings=buildings)) for k in (0, 1))
    drawn, plan = draw_all(first, kinds, seed, {"other": second})
    changes._cache.clear()
    again = apply_changes(first, json.loads(json.dumps(drawn)), {"other": second})
    for name in ("labels", "lots", "heights", "coverage", "centre", "neighbours"):
        assert np.array_equal(getattr(plan, name), getattr(again, name)), name


@pytest.mark.parametrize("name", NAMES)
def test_twelve_changes_of_a_real_city_keep_the_laws(plans, name):
    kinds = ["alley", "closing", "width"] * 4
    drawn, plan = draw_all(plans[name], kinds, 5)
    assert len(drawn) >= 10
    assert [*plan.changes] == drawn
    assert plan.version == plans[name].version
    assert not plans[name].changes


def test_an_alley_divides_a_face_between_two_streets(plans):
    plan = plans[NAMES[0]]
    change = draw_change("alley", plan, np.random.default_rng(2))
    new = apply_changes(plan, [change])
    face = plan.labels == change["face"]
    halves = np.unique(new.labels[face & (new.labels > 0)])
    assert halves.size == 2
    assert len(new) == len(plan) + 1
    alley = face & (new.labels == 0)
    # both ends of the alley touch a street, or leave the map
    before = np.pad(plan.labels == 0, 1, constant_values=True)
    height, width = plan.labels.shape
    touched = np.zeros(plan.labels.shape, bool)
    for i in range(3):
        for j in range(3):
            touched |= before[i : i + height, j : j + width]
    assert pieces(alley & touched, corners=True)[1] == 2
    gap = face & (plan.lots > 0) & (new.lots == 0)
    across = gap.sum() * plan.metres_per_pixel / alley.sum()
    assert 0.5 * change["width"] < across < 1.6 * change["width"]


def test_a_closing_joins_two_faces_and_their_lots(plans):
    plan = plans[NAMES[0]]
    change = draw_change("closing", plan, np.random.default_rng(0))
    new = apply_changes(plan, [change])
    first, second = change["faces"]
    joined = np.unique(new.labels[np.isin(plan.labels, (first, second))])
    assert joined.size == 1
    assert len(new) == len(plan) - 1
    lot = new.lots == joined[0]
    assert lot[np.isin(plan.lots, (first, second))].all()
    assert lot.sum() > np.isin(plan.lots, (first, second)).sum()


@pytest.mark.parametrize("metres", [4.0, 2.0, -4.0])
def test_a_width_moves_one_outline(plans, metres):
    plan = plans[NAMES[1]]
    face = int(np.argmax(plan.lot_area * ~plan.at_frame)) + 1
    change = {"kind": "width", "faces": [face], "metres": metres}
    new = apply_changes(plan, [change])
    assert np.array_equal(plan.labels > 0, new.labels > 0)
    old, moved = plan.lots == face, (new.lots > 0) & (plan.labels == face)
    assert (moved <= old).all() if metres > 0 else (moved >= old).all()
    assert (moved != old).any()
    assert not ((new.lots > 0) != (plan.lots > 0))[plan.labels != face].any()


@pytest.mark.parametrize(("first", "second"), [NAMES, NAMES[::-1]])
def test_seams_lead_from_frame_to_frame(plans, first, second):
    plan, other = plans[first], plans[second]
    for seed in range(20):
        change = draw_change("seam", plan, np.random.default_rng(seed), {second: other})
        assert change is not None
        new = apply_changes(plan, [change], {second: other})
        share = plan.area[np.array(change["faces"]) - 1].sum() / plan.area.sum()
        assert 0.25 <= share <= 0.5
        if seed > 4:
            continue
        assert_lawful(new)
        assert streets(new) <= streets(plan) + streets(other)
        kept = assert_unchanged_elsewhere(plan, new)
        assert set(kept) == set(range(1, len(plan) + 1)) - set(change["faces"])
        beyond = np.isin(plan.labels, change["faces"])
        cut = beyond & (new.labels == 0)
        assert (other.labels[cut] == 0).mean() > 0.95
        assert len(renumbering(other, new)) > 0.05 * len(other)


def test_a_seam_takes_changes_of_the_second_plan(plans):
    plan, other = (plans[name] for name in NAMES)
    alley = draw_change("alley", other, np.random.default_rng(3))
    pool = {NAMES[1]: other}
    seam = draw_change("seam", plan, np.random.default_rng(3), pool)
    changed = apply_changes(other, [alley])
    nested = apply_changes(plan, [{**seam, "changes": [alley]}], pool)
    direct = apply_changes(plan, [seam], {NAMES[1]: changed})
    assert np.array_equal(nested.labels, direct.labels)
    assert np.array_equal(nested.lots, direct.lots)


@pytest.mark.parametrize("iso", range(8))
def test_changes_turn_with_the_plan(iso):
    city = evocity.read_map(NAMES[0])
    plan = plan_of(city)
    lines = city.street_graph_of(least_width=LEAST_WIDTH).lines
    turned = build_plan(
        city.replace(np.ascontiguousarray(turn(city.heights, iso))), turn(lines, iso)
    )
    rng = np.random.default_rng(0)
    face = int(np.argmax(plan.lot_area)) + 1
    for change in (
        draw_change("closing", plan, rng),
        {"kind": "width", "faces": [face], "metres": 4.0},
    ):
        first, second = apply_changes(plan, [change]), apply_changes(turned, [change])
        assert np.array_equal(turn(first.labels, iso), second.labels)
        assert np.array_equal(turn(first.lots, iso), second.lots)


def turn(array, iso):
    return np.rot90(array.T if iso >= 4 else array, iso % 4)


def test_clipped_buildings_have_whole_parts():
    heights = np.full((20, 30), 9.0, np.float32)
    buildings = np.ones((20, 30), np.int32)
    buildings[:, 20:] = 2
    lots = np.ones((20, 30), bool)
    lots[:, 18:27] = False
    clipped = clip_buildings(heights, buildings, lots, np.ones_like(lots), 2.0)
    assert clipped[:, :18].all()
    assert not clipped[:, 18:].any()  # less than half of the second building remains
    whole = clip_buildings(heights, buildings, np.ones_like(lots), np.ones_like(lots), 2.0)
    assert whole is heights


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"kind": "bridge"}, "kind 'bridge'"),
        ({}, "kind None"),
        ("alley", "a change is 'alley'"),
        ({"kind": "alley", "face": 999}, "names face 999"),
        ({"kind": "alley", "face": 1, "row": "x", "column": 0, "angle": 0, "width": 4}, "alley is"),
        ({"kind": "alley", "face": 1}, "alley is"),
        (
            {"kind": "alley", "face": 1, "row": 0, "column": 0, "angle": 0, "width": 40},
            "width = 40",
        ),
        ({"kind": "closing", "faces": [1]}, "names the faces"),
        ({"kind": "closing", "faces": [1, 1]}, "names the faces"),
        ({"kind": "closing", "faces": [0, 1]}, "names face 0"),
        ({"kind": "width", "faces": [1], "metres": 0.5}, "metres = 0.5"),
        ({"kind": "seam", "city": "atlantis", "faces": [1]}, "'atlantis'"),
        ({"kind": "seam", "city": NAMES[1], "faces": []}, "names the faces"),
        ({"kind": "seam", "city": NAMES[1], "faces": "12"}, "names face '1'"),
        ({"kind": "seam", "city": "coarse", "faces": [1]}, "pixel"),
    ],
)
def test_wrong_changes_are_refused(plans, change, text):
    pool = {NAMES[1]: plans[NAMES[1]], "coarse": plan_of(draw_town(1, side=256, pixel=4.0))}
    with pytest.raises(MapError) as caught:
        apply_changes(plans[NAMES[0]], [change], pool)
    assert text in str(caught.value)


def test_a_seam_of_faces_without_a_street_is_refused(plans):
    plan = plans[NAMES[0]]
    inner = int(np.flatnonzero(~plan.at_frame)[0]) + 1
    for faces in ([inner], list(range(1, len(plan) + 1))):
        change = {"kind": "seam", "city": NAMES[1], "faces": faces}
        with pytest.raises(MapError, match="seam"):
            apply_changes(plan, [change], plans)


def test_plans_without_streets_have_no_changes():
    plan = plan_of(evocity.CityMap(np.full((64, 64), 9.0), 2.0))
    for kind in CHANGE_KINDS:
        assert draw_change(kind, plan, np.random.default_rng(0), {"a": plan}) is None
    with pytest.raises(MapError, match="kind"):
        draw_change("bridge", plan, np.random.default_rng(0))
