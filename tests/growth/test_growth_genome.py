"""A piece of a fabric as a genome: lifs in their groups, their domain blocks carried along."""

import numpy as np
import pytest
from codes import uniformly
from towns import draw_town

import evocity
from evocity import isometries
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import NUCLEOTIDES, unpacked
from evocity.growth import grow
from evocity.growth.fabric import lay_lifs

RNG = np.random.default_rng


def test_a_fabric_of_the_original_size_is_the_original(code):
    same = grow(code, 96, 96, RNG(0))
    assert same.genome() == code


@pytest.mark.parametrize("cell", [4, 8])
@pytest.mark.parametrize("iso", range(8))
def test_domain_blocks_are_carried_along_and_turned(iso, cell):
    rng = RNG(iso)
    town = draw_town(6, side=96, buildings=90)
    code = uniformly(town.replace(town.heights[:64]), domains=(2, 3)).genome
    # oblong domain blocks too
    wider = np.where(code.uniform | (code.x > 40), code.dx, code.dx + 4 * rng.integers(0, 3))
    code = code.replace(dx=wider)
    rows, columns = (isometries.apply(iso, k) for k in np.indices((64 // cell, 96 // cell)))
    child = lay_lifs([code], cell, 0 * rows, rows, columns, 0 * rows + iso)
    image = isometries.apply(iso, decode(code).city.heights)
    assert decode(child).city.heights == pytest.approx(image, abs=0.05)


def test_lifs_name_the_stone_they_come_from(code):
    child = grow(code, 160, 160, RNG(2), turned=False).genome(repair=None)
    lifs = code.pavement.index[unpacked(child.source)]
    for name in ("sigma", "beta", "iso", "dx", "dy"):
        assert np.array_equal(getattr(child, name), getattr(code, name)[lifs])
    assert child.cities == code.cities
    y, x = child.pavement.corners
    own_y, own_x = (corner[lifs] for corner in code.pavement.corners)
    moved = (child.x - x != code.x[lifs] - own_x) | (child.y - y != code.y[lifs] - own_y)
    inside = (child.x > 0) & (child.y > 0) & (child.x + child.dx < 160) & (child.y + child.dy < 160)
    assert not (moved & inside & ~child.uniform).any()


def test_provenance_of_a_child_is_carried_on(code):
    other = uniformly(draw_town(2, side=96, buildings=90)).genome
    child = evocity.operators.make("pavement_fusion", tolerance=50)([code, other], RNG(0))
    fabric = grow(child, 160, 160, RNG(0))
    grown = fabric.genome(-80, 40, 120, 96)
    told = fabric.sources(-80, 40, 120, 96)
    lifs = (24 * told["row"] + told["column"]).ravel()
    assert np.array_equal(grown.parent, child.parent[lifs])
    assert np.array_equal(grown.source, child.source[lifs])
    assert grown.cities == child.cities
    assert grown.attribution == child.attribution


def test_repair_brings_the_genome_to_the_fabric(code, fabric):
    heights = fabric.city().heights
    errors = [
        np.sqrt(np.mean((decode(fabric.genome(repair=repair)).city.heights - heights) ** 2))
        for repair in (None, 0.5)
    ]
    coding = decode(code).city.heights - draw_town(1, side=96, buildings=90).heights
    assert errors[1] < 0.5 * errors[0]
    assert errors[1] < 1.5 * np.sqrt(np.mean(coding**2))
    made = fabric.genome().made
    assert made["corner"] == [13, 21]
    assert made["operator"] == "growth"
    assert made["repaired"] > 0


def test_what_is_condensed_stays_in_its_place_alone(code):
    mask = np.zeros((96, 96), bool)
    mask[30:41, 20:60] = True
    layer = Condensation(np.full((96, 96), 33.0), mask)
    fabric = grow(code.replace(condensation=layer), 160, 160, RNG(0), corner=(8, 8))
    child = fabric.genome()
    assert len(child.condensation) == mask.sum()
    kept = decode(child).city.heights[32 : 32 + 96, 32 : 32 + 96]
    assert (kept[mask] == 33).all()
    assert (fabric.window(32, 32, 96, 96)[mask] == 33).all()
    part = fabric.genome(72, 8, 80, 80, repair=None)
    assert np.array_equal(part.condensation.mask[:, :40], np.pad(mask, 80)[120:200, 56:96][:80])
    assert fabric.genome(-400, 0, 80, 80, repair=None).condensation is None


def test_genomes_of_a_fabric_have_legal_nucleotides(fabric):
    child = fabric.genome(-320, 40, 200, 264, repair=None)  # its bounds are checked by Genome
    assert len(child) == 50 * 66
    assert {getattr(child, name).dtype for name in NUCLEOTIDES} == {
        nucleotide.dtype for nucleotide in NUCLEOTIDES.values()
    }


def test_range_blocks_may_be_parts_of_cells():
    town = draw_town(1, side=96, buildings=90)
    fabric = grow(uniformly(town, block=2).genome, 120, 160, RNG(0), cell=8)
    child = fabric.genome()
    assert (fabric.cell, child.pavement.block) == (8, 2)
    error = decode(child).city.heights - fabric.city().heights
    assert np.sqrt(np.mean(error**2)) < 0.5


@pytest.mark.parametrize(
    ("options", "box", "says"),
    [
        ({}, (1, 0, 40, 40), "row 0 + n · 4 and the column 0 + n · 4"),
        ({}, (0, 0, 40, 42), "multiples of 4 px"),
        ({"cell": 3}, (0, 0, 60, 60), "growth in cells of 3 px: "),
        ({}, (40, 40, 4, 40), "height and width of at least 8 px"),
    ],
)
def test_what_is_no_genome_is_refused(code, options, box, says):
    fabric = grow(code, 200, 264, RNG(5), corner=(0, 0), **options)
    with pytest.raises(OperatorError) as error:
        fabric.genome(*box)
    assert says in str(error.value)


def test_leaves_grow_as_blocks_do(town):
    code = evocity.encode(town, fit=False, settle=False).genome
    fabric = grow(code, 160, 160, RNG(3))
    child = fabric.genome()
    assert not child.pavement.uniform
    assert child.pavement.coarsest <= code.pavement.coarsest
    error = decode(child).city.heights - fabric.city().heights
    assert np.sqrt(np.mean(error**2)) < 0.5
    untouched = fabric.genome(repair=None)
    shown = code.pavement.index[unpacked(untouched.source)]
    assert np.array_equal(untouched.beta, code.beta[shown])
