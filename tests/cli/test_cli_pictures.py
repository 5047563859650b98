"""Pictures of codes, the filter and drawn towns on the command line."""

import json
import re

import numpy as np
import pytest
from cli_tools import AT_2_M, call, contents, refused, write_recipe, write_town
from PIL import Image

import evocity
from evocity.cli.shared.options import count_option
from evocity.coding import ancestry, high_pass, low_pass, usage
from evocity.coding.usage import COUNTS
from evocity.io import write_leaves
from evocity.operators.plans import plan_of
from evocity.pictures import Field, Leaves, Shares, render_leaves
from evocity.pictures.colours import scale_end
from evocity.pictures.picture import render, render_field, render_shares
from evocity.towns import PATTERNS


@pytest.fixture
def genome_file(tmp_path):
    path = tmp_path / "town.parquet"
    call("encode", write_town(tmp_path / "town.npy"), *AT_2_M, "-o", path)
    return path


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    call("run", write_recipe(folder), "--out", folder / "run")
    return folder / "run"


def pixels_of(path):
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")), dict(picture.text)


def decoded(genome, name):
    city = evocity.decode(genome).city
    return city.replace(city.heights, name=name)


# -- show --plan ------------------------------------------------------------------------------


def test_the_plan_of_a_map_or_of_a_genome_is_drawn(tmp_path, genome_file):
    path = tmp_path / "plan.png"
    result = call("show", genome_file, "--plan", "-o", path)
    city = decoded(evocity.read_genome(genome_file), "town, decoded")
    plan = plan_of(city)
    _, about = pixels_of(path)
    assert about["Title"] == f"town, decoded: {len(plan)} faces between streets"
    assert f"{len(plan)} faces between streets, {plan.open.sum()} of them open" in result.stdout


# -- show --leaves ----------------------------------------------------------------------------


def test_leaves_are_drawn_and_told(tmp_path, genome_file):
    path = tmp_path / "leaves.png"
    result = call("show", genome_file, "--leaves", "-o", path)
    genome = evocity.read_genome(genome_file)
    p = genome.pavement
    picture, about = pixels_of(path)
    assert about["Title"] == f"town, decoded: {len(p)} range blocks of 2…{p.coarsest} px"
    leaves = Leaves(decoded(genome, "town, decoded"), p)
    np.testing.assert_array_equal(picture, np.asarray(render_leaves(leaves, zoom=12)))
    each = ", ".join(f"{which.size} of {side}" for side, which in p.levels.items())
    assert f"{len(genome)} lifs, a range block each: {each} px" in result.stdout


@pytest.mark.parametrize("block", [4, (2, 16)])
def test_a_line_runs_along_the_north_and_west_of_each_range_block(town, block):
    genome = evocity.encode(town, block=block, fit=False).genome
    p, zoom = genome.pavement, 4
    city = evocity.decode(genome).city
    bare = np.asarray(render(city, highest=scale_end(city), legend=False, zoom=zoom), int)
    drawn = np.asarray(render_leaves(Leaves(city, p), legend=False, zoom=zoom), int)
    lines = np.zeros(bare.shape[:2], bool)
    for top, left, side in zip(*p.corners, p.side, strict=True):
        lines[top * zoom, left * zoom : (left + side) * zoom] = True
        lines[top * zoom : (top + side) * zoom, left * zoom] = True
    change = np.abs(drawn - bare).max(axis=2)
    assert not change[~lines].any()
    assert change[lines].min() > 20  # seen on pale ground and on dark roofs


@pytest.mark.slow
def test_leaves_of_a_large_map_stay_apart(tmp_path):
    path = tmp_path / "leaves.png"
    rows = np.zeros((1024, 1024), np.float32)
    write_leaves(
        Leaves(evocity.CityMap(rows, 2.0, name="wide"), evocity.Pavement(1024, 1024, 2)), path
    )
    picture, _ = pixels_of(path)
    assert min(picture.shape[:2]) > 4 * 1024


# -- show --usage -----------------------------------------------------------------------------


@pytest.mark.parametrize("count", COUNTS)
def test_usage_is_drawn_and_told(tmp_path, genome_file, count):
    path = tmp_path / "calls.png"
    result = call("show", genome_file, "--usage", "--count", count, "-o", path)
    genome = evocity.read_genome(genome_file)
    found = usage(genome)
    picture, about = pixels_of(path)
    title = about["Title"].removeprefix("town, decoded: ")
    values = getattr(found, count).astype(np.float32)
    field = Field(decoded(genome, "town, decoded"), values, title, "calls")
    np.testing.assert_array_equal(picture, np.asarray(render_field(field, zoom=12)))
    served, blocks = np.count_nonzero(~genome.uniform), len(found.domain_calls)
    assert f"{blocks} domain blocks serve {served} of {len(genome)} lifs" in result.stdout
    assert f"a pixel has up to {found.pixels.max()} calls" in result.stdout


def test_pixels_are_counted_unless_told_otherwise(tmp_path, genome_file):
    pictures = []
    for number, options in enumerate(((), ("--count", "pixels"), ("--count", "ranges"))):
        path = tmp_path / f"{number}.png"
        call("show", genome_file, "--usage", *options, "-o", path)
        pictures.append(path.read_bytes())
    assert pictures[0] == pictures[1] != pictures[2]


def test_every_count_of_the_library_can_be_asked_for():
    def command(**_):
        pass

    (option,) = count_option(command).__click_params__
    assert tuple(option.type.choices) == COUNTS


# -- show --ancestry --------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [None, 0, 1])
def test_ancestry_of_an_individual_is_drawn(tmp_path, run_folder, depth):
    path = tmp_path / "whose.png"
    options = () if depth is None else ("--depth", depth)
    result = call("show", run_folder, "--id", 8, "--ancestry", *options, "-o", path)
    genome = evocity.open_run(run_folder).genome(8)
    weights = ancestry(genome, depth=depth)
    picture, about = pixels_of(path)
    name, title = about["Title"].split(": ")
    assert name == "run, individual 8"
    assert title == ("ancestry" if depth is None else f"ancestry to depth {depth}")
    shares = Shares(decoded(genome, name), weights, genome.cities, title)
    np.testing.assert_array_equal(picture, np.asarray(render_shares(shares, zoom=24)))
    for city, share in zip(genome.cities, weights.mean(axis=(0, 1)), strict=True):
        assert (f"{city} {100 * share:.1f} %" in result.stdout) == (share > 0)


def test_a_genome_of_one_city_is_all_its(tmp_path, genome_file):
    result = call("show", genome_file, "--ancestry", "-o", tmp_path / "whose.png")
    assert "town 100.0 %" in result.stdout


def test_pictures_of_codes_carry_the_attribution(tmp_path):
    path = tmp_path / "lyon.parquet"
    call("encode", "lyon-1er", "--pixels", 32, "-o", path)
    for option in ("--leaves", "--usage", "--ancestry"):
        call("show", path, option, "-o", tmp_path / "picture.png")
        _, about = pixels_of(tmp_path / "picture.png")
        assert about["Copyright"] == evocity.io.attribution_of("lyon-1er")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--ancestry", "--depth", -1),
            "--depth -1 is invalid\n  expected: a whole number of iterations",
        ),
        (("--depth", 2), "--depth is given without --ancestry"),
        (("--count", "ranges"), "--count is given without --usage"),
        (("--usage", "--ancestry"), "one of these options"),
        (("--leaves", "--ancestry"), "--leaves and --ancestry\n  expected: one of these options"),
        (("--leaves", "--usage"), "one of these options"),
        (("--leaves", "--count", "ranges"), "--count is given without --usage"),
        (("--leaves", "--pixels", 32), "--pixels cannot be used with --leaves"),
        (("--usage", "--depth", 2), "--depth is given without --ancestry"),
        (("--usage", "--pixels", 32), "--pixels cannot be used with --usage"),
        (("--usage", "--id", 3), "not a run folder"),
    ],
)
def test_options_that_do_not_go_together_are_refused(tmp_path, genome_file, options, says):
    refused(tmp_path, "show", genome_file, *options, "-o", tmp_path / "p.png", says=says)


@pytest.mark.parametrize("option", ["--leaves", "--usage", "--ancestry"])
def test_what_has_no_code_is_refused(tmp_path, run_folder, option):
    output = ("-o", tmp_path / "p.png")
    message = refused(tmp_path, "show", "lyon-1er", option, *output, says="lyon-1er is a map")
    assert "evocity encode lyon-1er" in message
    town = write_town(tmp_path / "town.npy")
    refused(tmp_path, "show", town, option, *output, says="town.npy is a map")
    refused(tmp_path, "show", tmp_path / "no.parquet", option, *output, says="no genome file")
    before = contents(run_folder)
    refused(tmp_path, "show", run_folder, option, *output, says="--id N")
    refused(tmp_path, "show", run_folder, option, "--id", 999, *output, says="no individual 999")
    refused(tmp_path, "show", town, option, "-o", tmp_path / "p.tif", says=".tif cannot be")
    assert contents(run_folder) == before


# -- decode --low-pass, --high-pass -----------------------------------------------------------


@pytest.mark.parametrize("name", ["low-pass", "high-pass"])
@pytest.mark.parametrize("options", [(), ("--count", "ranges"), ("--zoom", 2)])
def test_a_filter_writes_the_filtered_map(tmp_path, genome_file, options, name):
    path = tmp_path / "simpler.npy"
    result = call("decode", genome_file, f"--{name}", 2, *options, "-o", path)
    genome = evocity.read_genome(genome_file)
    filtering = low_pass if name == "low-pass" else high_pass
    filtered = filtering(genome, 2, count="ranges" if "ranges" in options else "pixels")
    expected = evocity.decode(filtered, zoom=2 if "--zoom" in options else 1).city
    np.testing.assert_array_equal(np.load(path), expected.heights)
    share = filtered.condensation.mask.mean()
    assert 0 < share < 1
    assert f"{name} at 2 calls: ground on {100 * share:.0f} % of the pixels" in result.stdout
    assert f"town, decoded, {name} at 2" in result.stdout


def test_two_filters_write_a_band(tmp_path, genome_file):
    path = tmp_path / "band.npy"
    options = ("--low-pass", 4, "--high-pass", 2)
    result = call("decode", genome_file, *options, "-o", path)
    band = high_pass(low_pass(evocity.read_genome(genome_file), 4), 2)
    np.testing.assert_array_equal(np.load(path), evocity.decode(band).city.heights)
    assert "town, decoded, low-pass at 4, high-pass at 2" in result.stdout
    shares = [float(share) for share in re.findall(r"(\d+) % of the pixels", result.stdout)]
    assert sum(shares) == pytest.approx(100 * band.condensation.mask.mean(), abs=1)


@pytest.mark.parametrize(
    ("part", "says"),
    [
        ("blocks", r"flat range blocks on \d+ % of the pixels"),
        ("buildings", r"\d+ of \d+ built components became ground"),
    ],
)
def test_a_filter_of_whole_parts_writes_their_map(tmp_path, genome_file, part, says):
    path = tmp_path / "simpler.npy"
    result = call("decode", genome_file, "--low-pass", 2, "--part", part, "-o", path)
    expected = evocity.decode(low_pass(evocity.read_genome(genome_file), 2, part=part)).city
    np.testing.assert_array_equal(np.load(path), expected.heights)
    assert re.search(says, result.stdout)


def test_an_infinite_frequency_filters_nothing(tmp_path, genome_file):
    call("decode", genome_file, "-o", tmp_path / "plain.npy")
    result = call("decode", genome_file, "--low-pass", "inf", "-o", tmp_path / "same.npy")
    assert "0 % of the pixels" in result.stdout
    assert (tmp_path / "plain.npy").read_bytes() == (tmp_path / "same.npy").read_bytes()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--low-pass", -1), "--low-pass -1"),
        (("--low-pass", "nan"), "--low-pass nan"),
        (("--high-pass", -1), "--high-pass -1"),
        (("--high-pass", "nan"), "--high-pass nan"),
        (("--low-pass", 3, "--high-pass", -2), "--high-pass -2"),
        (("--count", "pixels"), "--count is given without --low-pass or --high-pass"),
        (("--part", "blocks"), "--part is given without --low-pass or --high-pass"),
    ],
)
def test_a_filter_that_is_none_is_refused(tmp_path, genome_file, options, says):
    refused(tmp_path, "decode", genome_file, *options, "-o", tmp_path / "m.npy", says=says)


# -- pattern ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PATTERNS)
def test_a_town_is_drawn_as_the_library_draws_it(tmp_path, name):
    path = tmp_path / "town.tif"
    size = ("--pixels", 100, "--metres-per-pixel", 1.5)
    result = call("pattern", name, *size, "--seed", 4, "--set", "street=15", "-o", path)
    expected = PATTERNS[name](100, 1.5, rng=np.random.default_rng(4), street=15)
    town = evocity.read_map(path)
    np.testing.assert_array_equal(town.heights, expected.heights)
    assert town.name == f"{name}-town"
    assert "100 × 100 px at 1.5 m" in result.stdout
    call("pattern", name, *size, "--set", "street=15", "-o", path)
    regular = PATTERNS[name](100, 1.5, street=15)
    np.testing.assert_array_equal(evocity.read_map(path).heights, regular.heights)


def test_settings_are_values_of_toml_and_plain_text(tmp_path):
    path = tmp_path / "town.npy"
    settings = ("turns=1230", "motif=AAB/C.B/CDD", "storeys=[3, 3]", "iterations=2", "least=6.5")
    words = [word for setting in settings for word in ("--set", setting)]
    call("pattern", "substitution", *words, "-o", path)
    expected = PATTERNS["substitution"](
        turns="1230", motif="AAB/C.B/CDD", storeys=(3, 3), iterations=2, least=6.5
    )
    np.testing.assert_array_equal(np.load(path), expected.heights)


def test_a_drawn_town_can_be_coded(tmp_path):
    call("pattern", "radial", "--pixels", 64, "-o", tmp_path / "town.tif")
    words = ("encode", tmp_path / "town.tif", "-o", tmp_path / "town.parquet", "--json")
    assert 64 < json.loads(call(*words).stdout)["lifs"] <= 64 * 64 // 8


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("radal",), "there is no pattern 'radal'"),
        (("radial", "--set", "raods=5"), "did you mean roads?"),
        (("radial", "--set", "roads"), "--set roads\n  expected: KEY=VALUE"),
        (("radial", "--set", "pixels=5"), "--set pixels\n"),
        (("radial", "--set", "roads=many"), "roads = 'many'"),
        (("radial", "--set", "storeys=[1]"), "storeys = [1]"),
        (("radial", "--pixels", 0), "--pixels 0"),
        (("radial", "--metres-per-pixel", "nan"), "--metres-per-pixel nan"),
        (("substitution", "--set", "motif=AB/BA"), "motif = 'AB/BA'"),
        (("substitution", "--pixels", 9), "too small"),
    ],
)
def test_a_town_that_cannot_be_drawn_is_refused(tmp_path, words, says):
    refused(tmp_path, "pattern", *words, "-o", tmp_path / "town.tif", says=says)


def test_a_town_that_cannot_be_written_is_refused(tmp_path):
    refused(tmp_path, "pattern", "radial", "-o", tmp_path / "town.jpg", says=".jpg cannot be")
    refused(tmp_path, "pattern", "radial", "-o", tmp_path / "no" / "t.tif", says="no folder")
