"""Plan fusion: the first parent's streets stay, and faces take buildings of source cities."""

import json

import numpy as np
import pytest
from codes import uniformly
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import VOID, Genome, unpacked
from evocity.operators import PlanFusion, make
from evocity.operators.crossover import raw_heights
from evocity.operators.plans import FaceGene, lay, plan_key, plan_of
from evocity.operators.plans.laying import Lot, places_of
from evocity.recipe.mixture import operator_of


@pytest.fixture(scope="module")
def sources() -> list[Genome]:
    """New York and Lyon, in windows of 320 m."""
    names = ("new-york-west-village", "lyon-1er")
    return [
        evocity.encode(evocity.read_map(name, pixels=160), reach=16, fit=False).genome
        for name in names
    ]


@pytest.fixture(scope="module")
def whole(sources):
    """A draft and a child in which all faces of New York took part that Lyon can fill."""
    operator, parents = PlanFusion(faces=None), [sources[0], sources[1]]
    draft = operator.draft(parents, np.random.default_rng(1))
    return draft, operator(parents, np.random.default_rng(1))


def genes_of(made) -> list[FaceGene]:
    return [FaceGene(**gene) for gene in json.loads(json.dumps(made["genes"]))]


def test_genes_replay_the_intended_map(sources, whole):
    draft, child = whole
    host, lyon = (decoded(one).city for one in sources)
    genes = genes_of(child.made)
    plan = plan_of(host)
    assert len({gene.face for gene in genes}) == child.made["faces"] >= 3
    assert len(genes) == child.made["faces"] + sum(gene.part == 2 for gene in genes)
    heights = lay(plan, genes, {"lyon-1er": lyon})
    changed = np.isin(plan.lots, [gene.face for gene in genes])
    assert np.array_equal(draft.intended[changed], heights[changed])
    assert np.array_equal(draft.intended[~changed], raw_heights(sources[0])[~changed])


def test_a_genome_file_keeps_the_genes(whole, tmp_path):
    _, child = whole
    child.write(tmp_path / "child.parquet")
    again = evocity.read_genome(tmp_path / "child.parquet")
    assert genes_of(again.made) == genes_of(child.made)


def test_stones_are_those_of_the_place(sources, whole):
    """Each built pixel of a filled face names its city, and its place there within a few pixels."""
    draft, _ = whole
    child, host = draft.genome, decoded(sources[0]).city
    city, row, column = stones_of_pixels(child)
    names = np.array(child.cities)
    for gene in [gene for gene in genes_of(draft.made) if not gene.part]:
        lot = Lot(plan_of(host), gene.face)
        built = draft.intended[lot.window][lot.mask] > 1.5
        here = lot.rows[built] + lot.window[0].start, lot.columns[built] + lot.window[1].start
        assert set(names[city[here]]) == {"lyon-1er"}
        rows, columns = places_of(lot, gene, host)
        assert np.abs(rows[built] - row[here]).max() <= 4
        assert np.abs(columns[built] - column[here]).max() <= 4


def stones_of_pixels(genome: Genome):
    """City, row and column of the stone of each pixel, without parts of lifs that were turned."""
    from evocity.isometries import AFFINE

    p, index = genome.pavement, genome.pavement.index
    y, x = unpacked(genome.source)
    affine = AFFINE[genome.turn][index]
    down, along = (np.indices(index.shape)[axis] - p.corners[axis][index] for axis in range(2))
    last = (p.side - 1)[index]
    row = y[index] + affine[..., 0] * last + affine[..., 2] * down + affine[..., 4] * along
    column = x[index] + affine[..., 1] * last + affine[..., 3] * down + affine[..., 5] * along
    return genome.parent[index], row, column


def test_a_place_stands_once(sources, whole):
    draft, _ = whole
    child = draft.genome
    city, row, column = stones_of_pixels(child)
    built = (draft.intended > 1.5) & (np.array(child.cities) != VOID)[city]
    places = np.stack([city[built], row[built], column[built]]).astype(int)
    _, counts = np.unique(places // [[1], [2], [2]], axis=1, return_counts=True)
    # a cell of 2 px has 4 pixels; turned and scaled cells share some with their neighbours
    assert counts[counts > 12].sum() <= 0.02 * built.sum()


def test_streets_and_density_stay(sources, whole):
    draft, child = whole
    host, bred = decoded(sources[0]).city, decode(child).city
    plan = plan_of(host)
    assert bred.built[plan.labels == 0].mean() <= 0.01
    outside = plan.lots == 0
    assert (bred.built & outside).sum() <= (host.built & outside).sum() + 0.005 * outside.sum()
    assert abs(bred.built.mean() - host.built.mean()) <= 0.06
    assert abs(bred.built.mean() - (draft.intended > 1.5).mean()) <= 0.02


def test_repair_brings_the_child_to_the_intended_map(sources, whole):
    draft, child = whole
    error = raw_heights(child) - draft.intended
    unrepaired = PlanFusion(faces=None, repair=None)(sources, np.random.default_rng(1))
    far = raw_heights(unrepaired) - draft.intended
    assert np.sqrt(np.mean(error**2)) < 0.5 * np.sqrt(np.mean(far**2))


def test_buildings_come_from_the_other_parents_only(sources):
    """A child as first parent takes nothing from itself while sources stand beside it."""
    child = PlanFusion(faces=4)(sources, np.random.default_rng(5))
    again = PlanFusion(faces=4)([child, *sources], np.random.default_rng(6))
    assert {gene.source for gene in genes_of(again.made)} <= {"lyon-1er", "new-york-west-village"}


def test_the_number_of_faces_is_kept(sources):
    for faces in (1, 2):
        child = PlanFusion(faces=faces)(sources, np.random.default_rng(2))
        assert child.made["faces"] == faces
    few = PlanFusion(faces=None, draws=1)(sources, np.random.default_rng(2))
    many = PlanFusion(faces=None, draws=100)(sources, np.random.default_rng(2))
    assert few.made["faces"] < many.made["faces"]


def test_a_lone_parent_has_each_place_already(sources):
    child = PlanFusion(faces=None, repeats=0.0)(sources[:1], np.random.default_rng(0))
    assert child.made["faces"] == 0
    assert np.array_equal(child.digest, sources[0].digest)


def test_locked_faces_stay(sources):
    city = decoded(sources[0]).city
    mask = np.zeros(city.shape, bool)
    mask[:, : city.shape[1] // 2] = True
    locked = sources[0].replace(condensation=Condensation.cut(city, mask))
    child = PlanFusion(faces=None)([locked, sources[1]], np.random.default_rng(3))
    plan = plan_of(decoded(locked).city)
    faces = [gene.face for gene in genes_of(child.made)]
    assert not np.isin(plan.labels[mask], faces).any()
    whole = sources[0].replace(condensation=Condensation.cut(city, np.ones_like(mask)))
    child = PlanFusion(faces=None)([whole, sources[1]], np.random.default_rng(3))
    assert child.made["faces"] == 0


@pytest.mark.parametrize("height", [0.0, 9.0])
def test_a_map_without_streets_or_houses_keeps_what_it_has(height):
    bare = uniformly(CityMap(np.full((64, 64), height), 2.0, name="bare")).genome
    town = uniformly(draw_town(2)).genome
    child = PlanFusion(faces=None)([bare, town], np.random.default_rng(0))
    assert decode(child).converged
    if not height:
        assert child.made["faces"] == 0
        assert not decode(child).city.built.any()
    nothing = PlanFusion(faces=None)([town, bare], np.random.default_rng(0))
    assert decode(nothing).converged


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"faces": 0}, "faces = 0"),
        ({"draws": 0}, "draws = 0"),
        ({"slack": -0.1}, "slack = -0.1"),
        ({"loss": 2}, "loss = 2"),
        ({"repeats": 1.5}, "repeats = 1.5"),
        ({"area_min": -1}, "area_min = -1"),
        ({"reach": -1}, "reach = -1"),
    ],
)
def test_parameters_at_fault_are_named(parameters, word):
    with pytest.raises(OperatorError, match=word):
        make("plan_fusion", **parameters)


def test_its_reach_is_its_own_in_a_recipe():
    coding = {"reach": 24, "domains": (2, 4)}
    assert operator_of("plan_fusion", {}, coding).reach == 48
    assert operator_of("plan_fusion", {}, coding).domains == (2, 4)
    assert operator_of("plan_fusion", {"reach": "all"}, coding).reach is None
    assert operator_of("quarter_refill", {}, coding).reach == 24


RUN = """
[run]
seed = 5
population = 6
generations = 3
[map]
pixels = 80
[genome]
fit = false
reach = 8
[[parents]]
map = "new-york-west-village"
[[parents]]
map = "lyon-1er"
[operators]
plan_fusion = { weight = 3, area_min = 100.0, draws = 60 }
plan_crossing = { weight = 3, area_min = 100.0, draws = 60 }
plan_spread = 1
plan_storeys = { weight = 1, faces = { from = 1, to = 4 } }
[[fitness]]
name = "fsi"
goal = "max"
[[fitness]]
name = "gsi"
goal = "min"
[evaluation]
workers = 0
"""


@pytest.mark.slow
def test_a_search_breeds_by_it_and_is_replayed(tmp_path):
    (tmp_path / "plans.toml").write_text(RUN)
    recipe = evocity.read_recipe(tmp_path / "plans.toml")
    with evocity.Search(recipe, out=tmp_path / "run", workers=0) as search:
        for _ in search:
            pass
    run = evocity.open_run(tmp_path / "run")
    births = run.births().to_pylist()
    bred = [one["id"] for one in births if one["operator"] and "plan_" in one["operator"]]
    assert {one["operator"] for one in births} >= {"plan_fusion", "plan_crossing"}
    made = [run[id].genome.made for id in bred]
    sources = {gene.source for one in made for gene in genes_of(one)}
    assert sources
    assert sources <= {"lyon-1er", "new-york-west-village"}
    assert {plan_key(one) for one in made} <= {"lyon-1er", "new-york-west-village"}
    assert all(one.same for one in evocity.replay(tmp_path / "run", bred[-6:]))
