"""Films: the frames of a metamorphosis, and of children from one parent to the other."""

import numpy as np
import pytest
from cli_tools import call, refused
from codes import uniformly
from PIL import Image, ImageSequence
from towns import draw_town

import evocity
from evocity.cli.shared.frames import strip
from evocity.errors import EvocityError
from evocity.operators import Interpolation
from evocity.pictures import render
from evocity.shapes import known, metamorphosis, picture_of


def frames_of(path) -> list[np.ndarray]:
    with Image.open(path) as film:
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]


@pytest.fixture(scope="module")
def parents(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parents")
    paths = [folder / f"town-{seed}.parquet" for seed in (1, 2)]
    for seed, path in enumerate(paths, 1):
        uniformly(draw_town(seed, side=32, buildings=9)).genome.write(path)
    return paths


def test_a_film_of_shapes_begins_and_ends_with_the_shapes(tmp_path):
    path = tmp_path / "film.webp"
    result = call("shape", "morph", "koch", "levy", "--frames", 5, "--side", 64, "-o", path)
    assert "5 frames" in result.stdout
    assert "4 maps and 2: paired" in result.stderr
    found = frames_of(path)
    assert len(found) == 5
    between = metamorphosis(known("koch"), known("levy"))
    boxes = np.stack([between(t).box for t in (0, 0.25, 0.5, 0.75, 1)])
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    for t, frame in zip((0, 0.25, 0.5, 0.75, 1), found, strict=True):
        expected = np.asarray(picture_of(between(t), 64, None, box))
        np.testing.assert_array_equal(frame, expected)


def test_a_strip_has_all_frames_beside_each_other(tmp_path):
    path = tmp_path / "strip.png"
    call("shape", "morph", "koch", "levy", "--frames", 9, "--side", 32, "-o", path)
    with Image.open(path) as picture:
        assert picture.size == (8 * 32 + 7 * 6, 2 * 32 + 6)
    parts = [Image.new("RGB", (5, 4), (k, 0, 0)) for k in range(10)]
    pixels = np.asarray(strip(parts))
    for k in range(10):
        row, column = divmod(k, 8)
        part = pixels[10 * row : 10 * row + 4, 11 * column : 11 * column + 5]
        assert (part == (k, 0, 0)).all()
    with pytest.raises(EvocityError, match="at most 16384 px"):
        strip([Image.new("RGB", (8192, 8))] * 3)


def test_a_film_of_children_goes_from_parent_to_parent(tmp_path, parents):
    path = tmp_path / "film.webp"
    call("breed", "interpolation", *parents, "--frames", 3, "-o", path)
    found = frames_of(path)
    genomes = [evocity.read_genome(one) for one in parents]
    cities = [
        evocity.decode(Interpolation(share=share)(genomes, np.random.default_rng(0))).city
        for share in (1, 0.5, 0)
    ]
    highest = max(float(city.heights.max()) for city in cities)
    for frame, city in zip(found, cities, strict=True):
        np.testing.assert_array_equal(frame, np.asarray(render(city, highest=highest)))
    for end, genome in ((cities[0], genomes[0]), (cities[-1], genomes[1])):
        np.testing.assert_allclose(end.heights, evocity.decode(genome).city.heights, atol=0.5)


@pytest.mark.parametrize("frames", [0, 1, -3, 501, 10_000])
def test_a_number_of_frames_out_of_range_is_refused(tmp_path, parents, frames):
    path = tmp_path / "film.webp"
    says = f"--frames {frames}"
    refused(tmp_path, "shape", "morph", "koch", "levy", "--frames", frames, "-o", path, says=says)
    refused(tmp_path, "breed", "interpolation", *parents, "--frames", frames, "-o", path, says=says)
    assert not path.exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("shape", "morph", "koch", "levy"), "neither -t nor --frames"),
        (("shape", "morph", "koch", "levy", "-t", 0.5, "--frames", 3), "-t and --frames are both"),
        (("breed", "mutation", "PARENTS", "--frames", 3), "the operator mutation"),
        (
            ("breed", "interpolation", "PARENTS", "--frames", 3, "--set", "share=0.3"),
            "each frame has its own",
        ),
    ],
)
def test_films_without_a_course_are_refused(tmp_path, parents, options, says):
    given = [one for item in options for one in (parents if item == "PARENTS" else [item])]
    refused(tmp_path, *given, "-o", tmp_path / "film.webp", says=says)


def test_a_film_is_no_vector_graphic(tmp_path):
    path = tmp_path / "film.svg"
    says = "a name that ends in .webp"
    refused(tmp_path, "shape", "morph", "koch", "levy", "--frames", 3, "-o", path, says=says)
