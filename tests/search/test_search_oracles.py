"""What selection borrows, beside another project's: pymoo's ranks, crowding and hypervolume; and
the same selections on problems whose fronts are known."""

import numpy as np
import pytest

from evocity.selection.algorithms import algorithms
from evocity.selection.backends.deap import crowding_distances
from evocity.selection.backends.moocore import contributions, hypervolume
from evocity.selection.fronts import ranks_of
from evocity.selection.individual import Individual

FRONTS = [(seed, n, goals) for seed, n in enumerate((1, 2, 3, 20, 90)) for goals in (2, 3, 4, 5)]


def losses_of(seed, n, goals):
    return np.random.default_rng([seed, goals]).random((n, goals))


@pytest.mark.parametrize(("seed", "n", "goals"), FRONTS)
def test_ranks_agree(seed, n, goals):
    from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

    losses = losses_of(seed, n, goals)
    fronts = NonDominatedSorting().do(losses)
    expected = np.empty(n, int)
    for rank, front in enumerate(fronts):
        expected[front] = rank
    assert ranks_of(losses).tolist() == expected.tolist()


@pytest.mark.parametrize(("seed", "n", "goals"), FRONTS)
def test_crowding_agrees(seed, n, goals):
    """pymoo sums over goals what DEAP averages."""
    from pymoo.operators.survival.rank_and_crowding.metrics import calc_crowding_distance

    losses = losses_of(seed, n, goals)
    expected = calc_crowding_distance(losses)
    found = crowding_distances(losses)
    if n > 2:
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    else:
        assert np.isinf(found).all()


@pytest.mark.parametrize(("seed", "n", "goals"), FRONTS)
def test_hypervolume_and_contributions_agree(seed, n, goals):
    from pymoo.indicators.hv import HV

    losses = losses_of(seed, n, goals)
    losses = losses[ranks_of(losses) == 0]
    reference = np.full(goals, 1.1)
    whole = HV(ref_point=reference)
    assert hypervolume(losses, reference) == pytest.approx(whole(losses), rel=1e-12)
    without = [
        whole(np.delete(losses, k, axis=0)) if len(losses) > 1 else 0.0 for k in range(len(losses))
    ]
    expected = [whole(losses) - one for one in without]
    np.testing.assert_allclose(contributions(losses, reference), expected, rtol=1e-9, atol=1e-12)


# -- known fronts ---------------------------------------------------------------------------------


_LONG = pytest.param("hypervolume", marks=pytest.mark.long)


class _Vector:
    def __init__(self, values):
        self.values, self.digest = values, values.tobytes()


def zdt1(x):
    g = 1 + 9 * x[:, 1:].mean(axis=1)
    return np.stack([x[:, 0], g * (1 - np.sqrt(x[:, 0] / g))], axis=1)


def dtlz2(x):
    g = ((x[:, 2:] - 0.5) ** 2).sum(axis=1)
    one, two = np.cos(x[:, :2] * np.pi / 2).T
    sine = np.sin(x[:, :2] * np.pi / 2).T
    return (1 + g)[:, None] * np.stack([one * two, one * sine[1], sine[0]], axis=1)


def crossed(one, other, rng, eta=15.0):
    """Simulated binary crossover within 0…1 (Deb & Agrawal 1995), each value in half of cases."""
    u = rng.random(one.shape)
    low, high = np.minimum(one, other), np.maximum(one, other)
    apart = np.maximum(high - low, 1e-14)
    children = []
    for room in (low, 1 - high):
        alpha = 2 - (1 + 2 * room / apart) ** -(eta + 1)
        inner, outer = (u * alpha) ** (1 / (eta + 1)), (1 / (2 - u * alpha)) ** (1 / (eta + 1))
        spread = np.where(u <= 1 / alpha, inner, outer)
        middle = (low + high) / 2
        children.append(middle - spread * apart / 2 if room is low else middle + spread * apart / 2)
    swap = rng.random(one.shape) < 0.5
    first, second = (
        np.where(swap, children[1], children[0]),
        np.where(swap, children[0], children[1]),
    )
    keep = (rng.random(one.shape) < 0.5) | (rng.random((len(one), 1)) > 0.9) | (high - low < 1e-14)
    return np.clip(np.where(keep, one, first), 0, 1), np.clip(np.where(keep, other, second), 0, 1)


def mutated(x, rng, eta=20.0):
    """Polynomial mutation within 0…1 (Deb & Deb 2014), of one value on average."""
    u, power = rng.random(x.shape), 1 / (eta + 1)
    down = (2 * u + (1 - 2 * u) * (1 - x) ** (eta + 1)) ** power - 1
    up = 1 - (2 * (1 - u) + 2 * (u - 0.5) * x ** (eta + 1)) ** power
    moved = np.where(u <= 0.5, down, up)
    return np.clip(np.where(rng.random(x.shape) < 1 / x.shape[1], x + moved, x), 0, 1)


def front_found(name, problem, variables, evaluations=25_000, size=100):
    kind = algorithms()[name]
    algorithm = kind(size, kind.Keys(distinct=0))
    rng = np.random.default_rng(7)
    living, number = [], 0
    while number < evaluations:
        if living:
            pairs = [algorithm.parents(living, 2, rng) for _ in range(size // 2)]
            x = np.array([[living[k].genome.values for k in pair] for pair in pairs])
            x = mutated(np.vstack(crossed(x[:, 0], x[:, 1], rng)), rng)
        else:
            x = rng.random((size, variables))
        born = [
            Individual(number + k, _Vector(row), {}, tuple(losses))
            for k, (row, losses) in enumerate(zip(x, problem(x).tolist(), strict=True))
        ]
        number += size
        living = algorithm.survivors([*living, *born], None, rng)
    return np.array([one.losses for one in living])


def igd(front, found):
    """Inverted generational distance: how far points of the true front are from those found."""
    return np.linalg.norm(front[:, None] - found[None], axis=2).min(axis=1).mean()


@pytest.mark.parametrize("name", [_LONG, pytest.param("nsga2", marks=pytest.mark.slow)])
def test_zdt1_is_reached(name):
    first = np.linspace(0, 1, 500)
    front = np.stack([first, 1 - np.sqrt(first)], axis=1)
    assert igd(front, front_found(name, zdt1, 30)) <= 0.01


@pytest.mark.slow_cases("nsga3")
@pytest.mark.parametrize("name", [_LONG, "nsga2", "nsga3"])
def test_dtlz2_of_three_goals_is_reached(name):
    from pymoo.util.ref_dirs import get_reference_directions

    front = get_reference_directions("uniform", 3, n_partitions=40)
    front = front / np.linalg.norm(front, axis=1, keepdims=True)
    assert igd(front, front_found(name, dtlz2, 12)) <= 0.08
