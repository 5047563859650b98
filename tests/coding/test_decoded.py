"""Decodings kept by genome: the same bits, the same object, and no more than there is room for."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from codes import uniformly

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.decoding_cache import AT_LEAST, Decodings, decoded
from evocity.errors import GenomeError


def code(seed, side=32, name="a"):
    lots = np.random.default_rng(seed).integers(0, 4, (side // 4, side // 4)) * 6.0
    heights = np.roll(lots.repeat(4, 0).repeat(4, 1), (1, 2), (0, 1))
    return uniformly(CityMap(heights, 2.0, name=name), reach=8).genome


@pytest.fixture(scope="module")
def codes():
    return [code(seed) for seed in range(5)]


def test_it_is_what_decode_gives(codes):
    for genome in codes:
        kept, fresh = decoded(genome), decode(genome)
        assert kept.city.heights.tobytes() == fresh.city.heights.tobytes()
        assert kept.attractor.tobytes() == fresh.attractor.tobytes()
        assert (kept.iterations, kept.change) == (fresh.iterations, fresh.change)
        assert kept.city.name == fresh.city.name


def test_an_equal_genome_gets_the_same_map_and_its_views(codes):
    one = decoded(codes[0])
    labels = one.city.labels
    other = decoded(codes[0].replace(made={"operator": "told anew"}))
    assert other is one
    assert other.city.labels is labels


def test_maps_called_otherwise_are_kept_apart(codes):
    twin = codes[0].replace(cities=("elsewhere",), attribution="somebody", origin=(1.0, 2.0))
    assert twin.digest == codes[0].digest
    city, other = decoded(codes[0]).city, decoded(twin).city
    assert (city.name, other.name) == ("a", "elsewhere")
    assert (other.attribution, other.origin) == ("somebody", (1.0, 2.0))


def test_nobody_can_change_what_is_kept(codes):
    kept = decoded(codes[0])
    for array in (kept.attractor, kept.city.heights, kept.city.labels, kept.blamed):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_the_longest_unasked_goes_first(codes):
    keep = Decodings(maps=3)
    first, second, third = (keep(genome) for genome in codes[:3])
    assert keep(codes[0]) is first
    keep(codes[3])
    assert len(keep) == 3
    assert keep(codes[0]) is first
    assert keep(codes[2]) is third
    assert keep(codes[1]) is not second


def test_pixels_bound_it_too_but_a_pair_always_stays(codes):
    keep = Decodings(pixels=3 * 32 * 32)
    for genome in codes:
        keep(genome)
    assert len(keep) == 3
    large = [code(seed, side=64) for seed in (7, 8)]
    pair = [keep(genome) for genome in large]  # each alone is larger than all the room
    assert len(keep) == AT_LEAST == 2
    assert [keep(genome) for genome in large] == pair
    keep.clear()
    assert len(keep) == 0


def test_a_code_that_diverges_is_told_each_time(codes):
    keep = Decodings()
    wild = codes[0].replace(
        sigma=np.where(codes[0].uniform, 0, 3).astype(np.float32), sigma_max=4.0
    )
    for _ in range(2):
        with pytest.raises(GenomeError, match="diverges"):
            keep(wild)
    assert len(keep) == 0


def test_threads_share_it(codes):
    keep = Decodings(maps=2)
    asked = [codes[number % 5] for number in range(60)]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(keep, asked))
    for genome, one in zip(asked, found, strict=True):
        assert one.city.heights.tobytes() == decode(genome).city.heights.tobytes()
    assert len(keep) == 2
