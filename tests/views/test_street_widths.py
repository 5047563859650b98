"""Widths of streets from façade to façade: rays beside their twin, drawn streets, real walls."""

import sys
from pathlib import Path

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import CityMap
from evocity.views.streets.facades._kernels import distances_along

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

SIDE, WIDE = 160, 16


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), reach=st.sampled_from([0.0, 3.0, 40.0]))
def test_rays_end_where_their_twins_do(seed, reach):
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 20, 2)
    ground = rng.choice([0, 0, 0, 0, 1, 2], shape).astype(np.uint8)
    lines = rng.choice([0, 0, 0, 0, 1, 2], shape).astype(np.int32)
    own = rng.integers(1, 3, 30).astype(np.int32)
    turn = rng.uniform(0, 2 * np.pi, 30)
    ways = np.column_stack([np.sin(turn), np.cos(turn)])
    ways[:4] = [[1, 0], [-1, 0], [0, 1], [0, -1]]
    starts = rng.uniform(-0.5, shape - 0.5, (30, 2))
    found = np.empty(30)
    distances_along(ground, lines, starts, ways, own, reach, found)
    expected = naive.distances_along(ground, lines, starts, ways, own, reach)
    assert found == pytest.approx(expected, abs=1e-9)


# -- drawn streets: 1 m per pixel ------------------------------------------------------------------


def around(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Places along a street through the middle of the map, and across it, metres."""
    y, x = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    return x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)


def widths(open_ground: np.ndarray):
    """The graph of a map with this open ground, and its longest edge."""
    graph = CityMap(np.where(open_ground, 0.0, 12.0), 1.0).street_graph
    return graph, int(np.argmax(graph.length))


@pytest.mark.parametrize("degrees", [0, 10, 27, 45, 63, 90, 121])
def test_a_street_has_its_width_in_all_directions(degrees):
    _, across = around(np.radians(degrees))
    graph, edge = widths(abs(across) < WIDE / 2)
    assert len(graph) == 1
    assert graph.measured[edge] > 100
    assert graph.width[edge] == pytest.approx(WIDE, abs=0.75)
    assert graph.high[edge] - graph.low[edge] < 2.5


@pytest.mark.parametrize("degrees", [0, 20, 45])
@pytest.mark.parametrize("gap", [6, 12, 20])
def test_a_gap_in_one_front_does_not_widen_a_street(degrees, gap):
    along, across = around(np.radians(degrees))
    court = (abs(along) < gap / 2) & (across > 0) & (across < 45)
    graph, edge = widths((abs(across) < WIDE / 2) | court)
    assert graph.width[edge] == pytest.approx(WIDE, abs=0.75)
    assert graph.high[edge] < 1.5 * (WIDE + gap / 2) + 1


@pytest.mark.parametrize("degrees", [0, 20])
def test_gaps_between_villas_do_not_widen_a_street(degrees):
    along, across = around(np.radians(degrees))
    gardens = (along % 22 < 7) & (abs(across) < 55)
    graph, edge = widths((abs(across) < WIDE / 2) | gardens)
    assert graph.length[edge] > 100
    assert graph.width[edge] == pytest.approx(WIDE, abs=1)
    assert graph.high[edge] < 2 * WIDE


def test_no_width_reaches_over_another_street():
    along, across = around(0.0)
    behind = abs(abs(across) - 40) < WIDE / 2  # streets in parallel, with lanes to them
    lanes = (abs(along % 40 - 20) < 5) & (abs(across) < 45)
    graph, _ = widths((abs(across) < WIDE / 2) | behind | lanes)
    assert (graph.measured > 0).sum() > 10
    assert graph.high.max() < 40


def test_a_street_that_widens_has_both_widths():
    along, across = around(0.0)
    graph, edge = widths(abs(across) < np.where(along < 20, 7, 16))
    assert graph.low[edge] == pytest.approx(14, abs=1)
    assert graph.width[edge] == pytest.approx(14, abs=1)
    assert graph.high[edge] == pytest.approx(32, abs=1)


@pytest.mark.parametrize("degrees", [0, 30])
def test_a_place_stays_a_place_and_does_not_widen_its_streets(degrees):
    along, across = around(np.radians(degrees))
    square = (abs(along) < 32) & (abs(across) < 32)
    graph, _ = widths((abs(across) < WIDE / 2) | (abs(along) < WIDE / 2) | square)
    assert len(graph.places) == 1
    streets = graph.kind != "place"
    assert (graph.kind == "place").sum() >= 4
    assert streets.sum() == 4
    assert graph.width[streets] == pytest.approx(WIDE, abs=1)
    assert (graph.width[~streets] > 2 * WIDE).all()


# -- real walls ------------------------------------------------------------------------------------


@pytest.mark.slow_cases("new-york-west-village")
@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "prague-bubenec"])
def test_widths_are_those_between_walls_of_the_source(name):
    street_widths = pytest.importorskip("_street_widths")
    bundled = name != "prague-bubenec"
    if not bundled and not street_widths.SHARED.is_dir():
        pytest.skip("the shared folder with Prague is not there")
    made = street_widths.bundled(name, 1.0) if bundled else street_widths.prague(1.0)
    found = street_widths.errors(*made)
    outside, every, across = (
        found[rule] for rule in ("outside crossings", "every chord", "across the street")
    )
    assert every["streets"] >= across["streets"] >= (30 if bundled else 15)
    assert outside["streets"] >= (30 if bundled else 15)
    assert outside["mean"] <= 3.0
    assert outside["median"] <= 0.5
    assert every["mean"] <= 3.0
    assert across["mean"] <= 1.0
    assert across["median"] <= 0.5
