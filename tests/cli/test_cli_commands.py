"""Maps and genomes on the command line: what is printed, what is written."""

import json
import math
import re

import click
import numpy as np
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_town
from codes import uniformly
from PIL import Image

import evocity
from evocity.cli import main
from evocity.cli.shared.inputs import warn_unconverged


@pytest.fixture
def town_file(tmp_path):
    return write_town(tmp_path / "town.npy")


@pytest.fixture
def genome_file(tmp_path, town_file):
    path = tmp_path / "town.parquet"
    call("encode", town_file, *AT_2_M, "-o", path)
    return path


def commands(group: click.Group = main, words: tuple[str, ...] = ()):
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from commands(command, (*words, name))
        else:
            yield (*words, name), command


def test_the_commands_are_these():
    assert [" ".join(words) for words, _ in commands()] == [
        "run",
        "recipe new",
        "resume",
        "pick",
        "reweight",
        "stop",
        "refine",
        "replay",
        "status",
        "report",
        "keep",
        "studio",
        "encode",
        "decode",
        "breed",
        "grow",
        "score",
        "autosimilarity",
        "show",
        "scene",
        "library new",
        "pattern",
        "cities",
        "fitness new",
        "fitness check",
        "fitness bench",
        "fitness list",
        "operators list",
        "readers list",
        "shape show",
        "shape dimension",
        "shape count",
        "shape morph",
        "curve trace",
        "curve fit",
        "curve lay",
        "curve detail",
        "curve transfer",
        "curve amplify",
        "surface fit",
        "surface make",
        "surface detail",
        "surface transfer",
        "surface amplify",
    ]


@pytest.mark.parametrize(("words", "command"), list(commands()))
def test_every_command_has_a_help_with_an_example(words, command):
    text = call(*words, "--help").stdout
    assert f"evocity {' '.join(words)}" in text
    assert "Example" in command.epilog
    options = [p for p in command.params if isinstance(p, click.Option)]
    assert all(option.help for option in options)
    # what is neither a switch nor required says what it is otherwise
    silent = [o.name for o in options if not (o.is_flag or o.required or o.show_default)]
    assert silent == []
    texts = [text for one in options for text in (one.help, str(one.show_default))]
    assert [text for text in texts if re.search(r"\{\w+\}", text)] == []


def test_version_and_usage():
    assert evocity.__version__ in call("--version").stdout
    assert "Usage" in call("encode", code=2).stderr
    assert "No such command" in call("hatch", code=2).stderr


def test_encode_tells_and_writes_what_the_library_makes(tmp_path, town_file):
    path = tmp_path / "g.parquet"
    options = (*PLAIN, "--block", 8, "--domains", "2,3", "--reach", "all", "--sigma-max", 0.7)
    result = call("encode", town_file, *AT_2_M, *options, "-o", path, "--json")
    told = json.loads(result.stdout)
    city = evocity.read_map(town_file, metres_per_pixel=2)
    made = uniformly(city, block=8, domains=(2, 3), reach=None, sigma_max=0.7)
    assert evocity.read_genome(path) == made.genome
    assert told.pop("seconds") > 0
    assert told == {
        "psnr": pytest.approx(made.psnr),
        "collage_rmse": pytest.approx(made.collage_rmse),
        "lifs": 64,
        "uniform": made.uniform,
        "pairs": made.pairs,
    }


def test_encode_tells_psnr_before_and_after_roofs_are_settled(tmp_path, town_file):
    result = call("encode", town_file, *AT_2_M, "--settle", "-o", tmp_path / "g.parquet")
    made = evocity.encode(evocity.read_map(town_file, metres_per_pixel=2))
    before, after = f"{made.psnr_unsettled:.1f} dB", f"{made.psnr:.1f} dB"
    assert f"decoded PSNR {after} ({before} with fractal roofs, " in result.stdout
    raw = evocity.decode(made.genome, settle=False).city
    assert made.psnr_unsettled == evocity.coding.psnr(made.city, raw)
    result = call("encode", town_file, *AT_2_M, "--no-settle", "-o", tmp_path / "h.parquet")
    assert "before each" not in result.stdout
    roofs = evocity.encode(made.city, settle="roofs")
    for words in (("--settle", "roofs"), ("--settle=roofs",)):
        result = call("encode", town_file, *AT_2_M, *words, "-o", tmp_path / "g.parquet")
        assert f"decoded PSNR {roofs.psnr:.1f} dB ({before} with fractal roofs, " in result.stdout
        assert "before each roof got one height" in result.stdout
        assert evocity.read_genome(tmp_path / "g.parquet") == roofs.genome


def test_settle_without_a_word_stands_anywhere(tmp_path, town_file):
    path = tmp_path / "g.parquet"
    ways = {(): True, ("--settle",): True, ("--settle", "buildings"): True}
    ways |= {("--settle", "roofs"): "roofs", ("--no-settle",): False}
    for words, way in ways.items():
        call("encode", *words, town_file, *AT_2_M, *PLAIN[:3], "-o", path)
        assert evocity.read_genome(path).settle == way
        call("encode", town_file, *AT_2_M, *PLAIN[:3], "-o", path, *words)
        assert evocity.read_genome(path).settle == way


def test_decode_settles_as_it_is_asked(tmp_path, town_file):
    code, path = tmp_path / "g.parquet", tmp_path / "m.npy"
    call("encode", town_file, *AT_2_M, "--settle", "roofs", "-o", code)
    genome = evocity.read_genome(code)
    ways = {(): "roofs", ("--settle",): True, ("--settle", "buildings"): True}
    ways |= {("--settle", "roofs"): "roofs", ("--no-settle",): False}
    for words, way in ways.items():
        call("decode", code, "-o", path, *words)
        heights = evocity.decode(genome, settle=way).city.heights
        assert np.array_equal(np.load(path), heights)
        call("decode", *words, code, "-o", path)
        assert np.array_equal(np.load(path), heights)
    assert evocity.read_genome(code) == genome


def test_a_map_that_is_coded_without_loss_is_said_to_be_exact(tmp_path):
    np.save(tmp_path / "bare.npy", np.zeros((64, 64), np.float32))
    result = call("encode", tmp_path / "bare.npy", *AT_2_M, "-o", tmp_path / "g.parquet")
    assert "decoded exactly, collage error 0.00 m" in result.stdout
    assert "inf" not in result.stdout


def test_a_bred_genome_is_titled_by_its_operator(tmp_path, town_file):
    call("encode", town_file, *AT_2_M, "-o", tmp_path / "g.parquet")
    call("breed", "height_scaling", tmp_path / "g.parquet", "-o", tmp_path / "child.parquet")
    for name, title in (("g", "town, decoded"), ("child", "town, height_scaling, decoded")):
        call("show", tmp_path / f"{name}.parquet", "-o", tmp_path / "p.png")
        with Image.open(tmp_path / "p.png") as picture:
            assert picture.info["Title"] == title


def test_encode_fits_the_attractor(tmp_path, town_file):
    path = tmp_path / "g.parquet"
    result = call("encode", town_file, *AT_2_M, *PLAIN, "--fit", "-o", path)
    assert "attractor fitted" in result.stdout
    made = uniformly(evocity.read_map(town_file, metres_per_pixel=2), fit=True)
    assert evocity.read_genome(path) == made.genome
    assert evocity.read_genome(path).made == made.genome.made


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ((), {}),
        (("--no-settle",), {"settle": False}),
        (("--settle", "roofs"), {"settle": "roofs"}),
        (("--block", "2-8", "--lifs", 300), {"block": (2, 8), "lifs": 300}),
        (("--max-error", 0.5, "--no-fit"), {"max_error": 0.5, "fit": False}),
        (("--block", "4"), {"block": 4}),
    ],
)
def test_encode_lays_leaves_as_the_library(tmp_path, options, given):
    path = tmp_path / "g.parquet"
    town = write_town(tmp_path / "town.npy", side=48)
    told = json.loads(call("encode", town, *AT_2_M, *options, "-o", path, "--json").stdout)
    made = evocity.encode(evocity.read_map(town, metres_per_pixel=2), **given)
    genome = evocity.read_genome(path)
    assert genome == made.genome
    assert genome.settle == made.genome.settle == given.get("settle", True)
    assert told["lifs"] == len(genome)
    assert told["psnr"] == pytest.approx(made.psnr)


def test_encode_tells_how_many_leaves_there_are_of_each_side(tmp_path, town_file):
    path = tmp_path / "g.parquet"
    told = call("encode", town_file, *AT_2_M, "--max-error", 0.0, "--no-fit", "-o", path).stdout
    levels = evocity.read_genome(path).pavement.levels
    assert len(levels) > 1
    assert ", ".join(f"{which.size} of {side}" for side, which in levels.items()) in told
    assert "leaves of the finest side stay above 0 m" in told


def test_encode_by_surroundings(tmp_path, town_file):
    path = tmp_path / "g.parquet"
    call("encode", town_file, *AT_2_M, *PLAIN, "--topological", 0, "-o", path)
    made = uniformly(evocity.read_map(town_file, metres_per_pixel=2), topological=0)
    assert evocity.read_genome(path) == made.genome


def test_encode_in_words(tmp_path, town_file):
    result = call("encode", town_file, *AT_2_M, *PLAIN, "-o", tmp_path / "g.parquet")
    assert "64 × 64 px at 2 m" in result.stdout
    assert "256 lifs" in result.stdout
    assert "dB" in result.stdout


def test_the_options_of_reading_arrive(tmp_path):
    levels = np.zeros((40, 40), np.uint8)
    levels[8:20, 8:20] = 5
    Image.fromarray(levels).save(tmp_path / "grey.png")
    reading = ("--height-scale", 3, "--metres-per-pixel", 2, "--pixels", 32)
    told = call("score", tmp_path / "grey.png", *reading, "--fitness", "mean_height", "--json")
    assert json.loads(told.stdout) == {"mean_height": pytest.approx(15)}
    # a window in the west: negative longitudes are no options
    window = ("--center", -74.006, 40.735, "--pixels", 64)
    told = call("score", "new-york-west-village", *window, "--fitness", "gsi")
    assert "64 × 64 px" in told.stdout


def test_a_flat_map_has_no_psnr_and_its_json_is_json(tmp_path):
    np.save(tmp_path / "flat.npy", np.zeros((32, 32)))
    result = call(
        "encode", tmp_path / "flat.npy", *AT_2_M, *PLAIN, "-o", tmp_path / "flat.parquet", "--json"
    )
    told = json.loads(result.stdout, parse_constant=lambda word: pytest.fail(word))
    assert told["psnr"] is None
    assert told["uniform"] == told["lifs"] == 64


@pytest.mark.parametrize("suffix", [".tif", ".npy", ".png"])
def test_decode_writes_the_attractor(tmp_path, genome_file, suffix):
    path = tmp_path / f"decoded{suffix}"
    result = call("decode", genome_file, "-o", path, "--zoom", 2)
    assert "128 × 128 px at 1 m" in result.stdout
    expected = evocity.decode(evocity.read_genome(genome_file), zoom=2).city
    if suffix == ".png":
        with Image.open(path) as picture:
            assert picture.format == "PNG"
    else:
        options = {} if suffix == ".tif" else {"metres_per_pixel": 1}
        assert (evocity.read_map(path, **options).heights == expected.heights).all()


def test_an_output_file_is_written_over(tmp_path, genome_file):
    path = tmp_path / "decoded.npy"
    path.write_text("of yesterday")
    call("decode", genome_file, "-o", path)
    assert np.load(path).shape == (64, 64)


def test_score_of_a_map_and_of_its_genome(town_file, genome_file):
    told = json.loads(call("score", town_file, *AT_2_M, "--json").stdout)
    assert list(told) == [measure.name for measure in evocity.fitness.measures()]
    city = evocity.read_map(town_file, metres_per_pixel=2)
    value = evocity.fitness.get("gsi")(city)
    assert told["gsi"] == pytest.approx(value)
    decoded = evocity.decode(evocity.read_genome(genome_file)).city
    told = json.loads(call("score", genome_file, "--fitness", "gsi", "--json").stdout)
    assert told == {"gsi": pytest.approx(evocity.fitness.get("gsi")(decoded))}


def test_a_genome_is_known_by_its_content_too(tmp_path, genome_file):
    bare = genome_file.rename(tmp_path / "genome")
    assert json.loads(call("score", bare, "--fitness", "gsi", "--json").stdout)["gsi"] > 0


def test_undefined_is_null_and_its_reason_is_told(town_file):
    words = ("score", town_file, *AT_2_M, "--fitness", "salingaros")
    city = evocity.read_map(town_file, metres_per_pixel=2)
    value = evocity.fitness.get("salingaros")(city)
    assert math.isnan(value)
    assert json.loads(call(*words, "--json").stdout) == {"salingaros": None}
    assert value.reason in call(*words).stdout


def test_measures_of_the_users_own_cannot_spoil_the_json(tmp_path, town_file):
    own = tmp_path / "own_for_score.py"
    own.write_text(
        "import evocity\n"
        "print('loading')\n"
        "@evocity.fitness(goal='max', unit='m')\n"
        "def highest_for_score(city):\n"
        "    print('measuring')\n"
        "    return city.heights.max()\n"
    )
    result = call(
        "score",
        town_file,
        *AT_2_M,
        "--fitness",
        own,
        "--fitness",
        "gsi",
        "--fitness",
        "gsi",
        "--json",
    )
    assert list(json.loads(result.stdout)) == ["highest_for_score", "gsi"]
    assert "measuring" in result.stderr


def test_show_draws_maps_and_genomes(tmp_path, town_file, genome_file):
    for what in ((town_file, *AT_2_M), (genome_file,), ("lyon-1er", "--pixels", 64)):
        path = tmp_path / "picture.png"
        call("show", *what, "-o", path)
        with Image.open(path) as picture:
            assert picture.format == "PNG"
            assert min(picture.size) > 64
        path.unlink()


def test_cities_tells_every_name_and_attribution():
    lines = call("cities").stdout.splitlines()[1:]
    assert [line.split()[0] for line in lines] == evocity.cities()
    assert all("©" in line or "Source:" in line for line in lines)


def test_cities_tell_which_have_no_heights():
    told = json.loads(call("cities", "--json").stdout)
    assert list(told) == evocity.cities()
    lines = {line.split()[0]: line for line in call("cities").stdout.splitlines()}
    for name, about in told.items():
        rules = evocity.read_map(name).height_rules
        assert about == {
            "attribution": evocity.io.attribution_of(name),
            "buildings": sum(rules.values()),
            "without_height": rules.get("default", 0),
        }
        assert f" {about['buildings']} " in lines[name]
    assert " all " in lines["villeurbanne-gratte-ciel"]
    assert " none " in lines["lyon-1er"]


def test_fitness_list_loads_files_of_the_users_own(tmp_path):
    own = tmp_path / "own_for_list.py"
    own.write_text(
        "import evocity\n"
        "print('loading')\n"
        "@evocity.fitness(goal='min', unit='m')\n"
        "def lowest_for_list(city):\n"
        "    'How low it is.'\n"
        "    return city.heights.min()\n"
    )
    result = call("fitness", "list", own)
    assert "loading" not in result.stdout
    (line,) = [s for s in result.stdout.splitlines() if s.startswith("lowest_for_list")]
    assert line.split()[1:3] == ["min", "m"]
    assert line.split()[4] == str(own)
    assert line.endswith("How low it is.")
    refused(tmp_path, "fitness", "list", tmp_path / "missing.py", says="no Python file")


def test_invented_heights_are_told_in_one_line(tmp_path):
    small = ("villeurbanne-gratte-ciel", "--pixels", 64)
    for words in (
        ("score", *small, "--fitness", "gsi", "--json"),
        ("show", *small, "-o", tmp_path / "v.png"),
        ("encode", *small, "-o", tmp_path / "v.parquet"),
        ("autosimilarity", *small, "-o", tmp_path / "v.npy"),
    ):
        taken, line = call(*words).stderr.splitlines()
        assert "villeurbanne-gratte-ciel: a window of 128 × 128 m" in taken
        count = line.split(": ")[2].split()[0]
        assert f"{count} of {count} buildings have no height in the source and get 6 m" in line
        assert line.endswith("; --default-height changes it")
    _, line = call("score", *small, "--default-height", 9).stderr.splitlines()
    assert "and get 9 m" in line
    (line,) = call("score", "lyon-1er", "--pixels", 64, "--json").stderr.splitlines()
    assert "lyon-1er: a window of 128 × 128 m, with" in line
    assert line.endswith("names a window of 512 × 512 m; heights: 73 from height")


def test_a_window_that_is_mostly_empty_is_told():
    words = ("score", "lyon-1er", "--fitness", "gsi", "--metres-per-pixel", 4)
    taken, line = call(*words).stderr.splitlines()
    assert "a window of 1024 × 1024 m, with 889 of the file's 889 buildings" in taken
    assert "of 256 × 256 px" in line
    assert "--center" in line
    (taken,) = call(*words[:-1], 2).stderr.splitlines()
    assert "names a window" not in taken  # its own window


def test_a_bound_of_one_or_more_is_warned_of(tmp_path, town_file):
    words = ("encode", town_file, *AT_2_M, "-o", tmp_path / "g.parquet", "--sigma-max")
    assert "may diverge" in call(*words, 1.2).stderr
    assert "diverge" not in call(*words, 0.95).stderr


def test_decoded_pictures_say_so(tmp_path, genome_file):
    for words in (("show", genome_file), ("decode", genome_file)):
        call(*words, "-o", tmp_path / "p.png")
        with Image.open(tmp_path / "p.png") as picture:
            assert picture.info["Title"] == "town, decoded"


def test_fitness_list_tells_every_measure():
    text = call("fitness", "list").stdout
    for measure in evocity.fitness.measures():
        assert any(line.split()[0] == measure.name for line in text.splitlines())


def test_an_unconverged_decoding_is_told(capsys):
    genome = uniformly(evocity.read_map("lyon-1er", pixels=32)).genome
    warn_unconverged(evocity.decode(genome, max_iterations=1), "lyon")
    assert "lyon did not converge in 1 steps" in capsys.readouterr().err
    warn_unconverged(evocity.decode(genome), "lyon")
    assert capsys.readouterr() == ("", "")


def test_compiling_is_told_once_and_only_where_it_is_done():
    from click.testing import CliRunner

    from evocity.accelerate import kernel
    from evocity.cli.shared.terminal import note_compiling

    def double(value):
        return 2 * value

    double.__module__ = "evocity.double"
    compiled = kernel(double, cache=False)

    @click.command()
    @click.argument("values", type=float, nargs=-1)
    def run(values):
        note_compiling()
        for value in values:
            compiled(value)
            compiled(int(value))

    told = "Note: compiling kernels, once on this machine; that may take a minute\n"
    assert CliRunner().invoke(run, []).stderr == ""
    assert CliRunner().invoke(run, ["1", "2"]).stderr == told
    assert CliRunner().invoke(run, ["3"]).stderr == ""
    compiled(1j)  # nobody listens any more
