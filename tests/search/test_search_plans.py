"""What a generation's plans are made of: cheap, and the same as made the obvious way."""

from dataclasses import dataclass

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import Recipe, operators
from evocity.operators import OPERATORS
from evocity.recipe.mixture import operator_of
from evocity.search.breeding.birth_plans import Guidance, birth_generator, child_plans
from evocity.selection.algorithms.algorithm import tournament


class Anybody:
    """Chooses the first, and draws nothing."""

    def parents(self, living, count, rng):
        return list(range(count))


@dataclass
class Someone:
    id: int
    genome: object = None


def test_operators_are_those_that_numpy_chooses_by_weight():
    cities = ["lyon-1er", "montpellier-pas-du-loup"]
    recipe = Recipe(parents=cities, fitness=["alignment"], run={"population": 48})
    living = [Someone(k) for k in range(4)]
    weights = {"relocation": 0.0, "height_scaling": 3.5}
    mixture = {name: one.weight for name, one in recipe.operators.items()} | weights
    names = [name for name, weight in mixture.items() if weight > 0]
    shares = np.array([mixture[name] for name in names]) / sum(mixture[name] for name in names)
    guidance = Guidance(weights={None: weights})
    for generation in range(1, 30):
        plans = child_plans(recipe, Anybody(), generation, living, (), guidance)
        for slot, plan in enumerate(plans):
            rng = birth_generator(recipe.run.seed, generation, slot)
            assert plan.operator.name == names[rng.choice(len(names), p=shares)]
            recipe.operator_drawn(plan.operator.name, rng)  # what it draws besides
            assert plan.rng.bit_generator.state == rng.bit_generator.state


@given(st.integers(0, 2**32), st.integers(1, 9), st.integers(0, 20), st.integers(1, 7))
@settings(deadline=None)
def test_a_tournament_draws_some_of_those_left_in_turn(seed, size, count, drawn):
    worth = np.random.default_rng(seed).integers(0, 3, size).tolist()
    rngs = np.random.default_rng(seed), np.random.default_rng(seed)

    def key(one):
        return worth[one], one

    chosen = tournament(size, key, count, rngs[0], drawn)
    assert chosen == naive.tournament(size, key, count, rngs[1], drawn)
    assert rngs[0].bit_generator.state == rngs[1].bit_generator.state


def test_births_share_an_operator_that_cannot_change():
    one = operator_of("mutation", {"move": 1}, None)
    assert operator_of("mutation", {"move": 1}, None) is one
    assert operator_of("mutation", {"move": 2}, None) != one
    assert operator_of("mutation", {"move": 1}, {"domains": (2, 4), "reach": 8}).domains == (2, 4)
    # 1 and 1.0 are equal, and are not told alike in a child's `made`
    kinds = [type(operator_of("mutation", {"beta_step": k}, None).beta_step) for k in (1, 1.0, 1)]
    assert kinds == [int, float, int]


@pytest.mark.parametrize("frozen", [True, False])
def test_one_that_may_change_is_made_anew(monkeypatch, frozen):
    @dataclass(frozen=frozen)
    class Splice:
        name = "splice"
        parents = (1, 1)
        step: float = 1.0

    monkeypatch.setitem(OPERATORS, "splice", Splice)
    one, other = (operator_of("splice", {"step": 0.5}, None) for _ in range(2))
    assert (one is other) is frozen
    assert one == other == operators.make("splice", step=0.5)
