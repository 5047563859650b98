"""Likeness of pictures: scikit-image as oracle, laws, cities that differ."""

import math

import numpy as np
import pytest
from naive import naive_local_patterns
from skimage.feature import hog

import evocity
from evocity.citymap import CityMap
from evocity.fitness import get, picture_likeness
from evocity.fitness.likeness import local_patterns, oriented_gradients, patches

floor = get("picture_likeness.floor")


@pytest.fixture(scope="module")
def cities():
    return {name: evocity.read_map(name) for name in ("lyon-1er", "montpellier-pas-du-loup")}


@pytest.mark.parametrize("seed", range(3))
def test_gradients_as_scikit_image(seed):
    image = np.random.default_rng(seed).random((96, 128)) * 30
    if seed == 2:
        image = np.round(evocity.read_map("lyon-1er").heights[:96, :128]).astype(float)
    expected = hog(image, 8, (16, 16), (2, 2), feature_vector=False)
    np.testing.assert_allclose(oriented_gradients(image), expected, atol=1e-6)


@pytest.mark.parametrize("radius", [1, 2])
def test_patterns_are_those_of_brute_force(cities, radius):
    for city in cities.values():
        heights = np.round(city.heights[:40, :50]).astype(float)
        for image in (heights, (heights > 1.5).astype(float)):
            naive = naive_local_patterns(image, radius)
            assert np.array_equal(local_patterns(image, radius), naive)
    image = np.random.default_rng(radius).permutation(24 * 30).reshape(24, 30).astype(float)
    assert np.mean(local_patterns(image, radius) == naive_local_patterns(image, radius)) > 0.99


def test_a_city_beside_itself_its_halves_and_others(cities):
    lyon, other = cities.values()
    same, apart = picture_likeness(lyon, lyon), picture_likeness(other, lyon)
    assert abs(same) < 0.15
    west, east = (lyon.replace(lyon.heights[:, half]) for half in (np.s_[:128], np.s_[128:]))
    assert same < picture_likeness(west, east) < apart
    assert 0 < floor(lyon, lyon) < apart
    assert floor(other, lyon) == floor(lyon, lyon)


def test_noise_is_not_like_a_city(cities):
    lyon = cities["lyon-1er"]
    mixed = np.random.default_rng(0).permutation(lyon.heights.ravel()).reshape(lyon.shape)
    assert picture_likeness(lyon.replace(mixed), lyon) > picture_likeness(
        cities["montpellier-pas-du-loup"], lyon
    )


def test_weights_of_several_cities(cities):
    lyon, other = cities.values()
    near, both, far = (
        picture_likeness(lyon, reference=[(lyon, weight), (other, 1 - weight)])
        for weight in (0.9, 0.5, 0.1)
    )
    assert near < both < far


def test_too_few_patches_and_other_pixels(cities):
    lyon = cities["lyon-1er"]
    bare = lyon.replace(np.zeros(lyon.shape, np.float32))
    assert "0 patches with buildings" in picture_likeness(bare, lyon).reason
    small = CityMap(np.full((32, 32), 9.0), 2.0)
    assert patches(small)[0].shape[0] == 0
    assert math.isnan(picture_likeness(small, lyon))
    coarse = CityMap(lyon.heights, 4.0, name="coarse")
    assert "different sizes" in picture_likeness(coarse, lyon).reason
