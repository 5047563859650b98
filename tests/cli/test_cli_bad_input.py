"""Input at fault: one message, exit code 2, no traceback, every file as it was."""

import json
import os
import re
import shutil
from pathlib import Path

import click
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_town
from PIL import Image

from evocity.cli.run import run
from evocity.cli.shared.commands import message_of
from evocity.errors import EvocityError, RecipeError, keyword, none_setting, setting
from evocity.genome import read_genome

OLD = Path(__file__).parent.parent / "old"


@pytest.fixture
def genome_file(tmp_path):
    path = tmp_path / "town.parquet"
    call("encode", write_town(tmp_path / "town.npy", side=32), *AT_2_M, "-o", path)
    return path


def geojson(path, *rings):
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [r]}}
        for r in rings
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def of_no_file(folder):
    return folder / "missing.geojson", "no file"


def of_no_city(folder):
    return "lyon-2e", "no bundled city"


def of_a_folder(folder):
    return folder, "is a folder"


def of_an_empty_file(folder):
    (folder / "a.tif").touch()
    return folder / "a.tif", "is empty"


def of_a_cut_file(folder):
    Image.fromarray(np.zeros((64, 64), np.uint8)).save(folder / "whole.tif")
    (folder / "cut.tif").write_bytes((folder / "whole.tif").read_bytes()[:64])
    return folder / "cut.tif", "cut.tif"


def of_a_wrong_name(folder):
    Image.fromarray(np.zeros((8, 8), np.uint8)).save(folder / "a.png")
    return (folder / "a.png").rename(folder / "a.tif"), "holds PNG"


def of_an_unknown_suffix(folder):
    (folder / "a.doc").write_text("a letter")
    return folder / "a.doc", "no reader for .doc"


def of_no_polygons(folder):
    return geojson(folder / "a.geojson"), "polygon"


def of_two_points(folder):
    return geojson(folder / "a.geojson", [[4.8, 45.7], [4.9, 45.7]]), "degenerate outline"


def of_the_moon(folder):
    ring = [[1e6, 1e6], [1e6 + 9, 1e6], [1e6 + 9, 1e6 + 9], [1e6, 1e6]]
    return geojson(folder / "a.geojson", ring), "out of range"


def of_no_pixel_size(folder):
    return write_town(folder / "a.npy"), "--metres-per-pixel"


def of_a_missing_genome(folder):
    return folder / "missing.parquet", "no genome file"


def of_an_empty_genome(folder):
    (folder / "a.parquet").touch()
    return folder / "a.parquet", "not a genome file"


BAD_MAPS = [
    of_no_file,
    of_no_city,
    of_a_folder,
    of_an_empty_file,
    of_a_cut_file,
    of_a_wrong_name,
    of_an_unknown_suffix,
    of_no_polygons,
    of_two_points,
    of_the_moon,
    of_no_pixel_size,
]


@pytest.mark.parametrize("bad", BAD_MAPS)
def test_a_bad_map_is_refused_by_encode_and_score(tmp_path, bad):
    source, says = bad(tmp_path)
    refused(tmp_path, "encode", source, "-o", tmp_path / "g.parquet", says=says)
    refused(tmp_path, "score", source, "--json", says=says)


# in the order of the list: a set's differs from process to process
@pytest.mark.parametrize("bad", [bad for bad in BAD_MAPS if bad is not of_a_folder])
def test_a_bad_map_is_refused_by_show(tmp_path, bad):
    source, says = bad(tmp_path)
    refused(tmp_path, "show", source, "-o", tmp_path / "p.png", says=says)


@pytest.mark.parametrize("bad", [of_a_missing_genome, of_an_empty_genome])
def test_a_bad_genome_is_refused(tmp_path, bad):
    source, says = bad(tmp_path)
    refused(tmp_path, "decode", source, "-o", tmp_path / "m.tif", says=says)
    refused(tmp_path, "score", source, says=says)
    refused(tmp_path, "show", source, "-o", tmp_path / "p.png", says=says)


def test_a_genome_of_another_schema_version_is_refused(tmp_path, genome_file):
    table = pq.read_table(genome_file)
    about = json.loads(table.schema.metadata[b"evocity.genome"]) | {"schema_version": 99}
    table = table.replace_schema_metadata({"evocity.genome": json.dumps(about)})
    pq.write_table(table, tmp_path / "later.parquet")
    words = ("decode", tmp_path / "later.parquet", "-o", tmp_path / "m.tif")
    refused(tmp_path, *words, says="schema version 99")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--block", 1), "block"),
        (("--block", 5), "multiples of 5"),
        (("--domains", "1"), "domains"),
        (("--reach", -3), "--reach -3\n  expected: a whole number of pixels, or all"),
        (("--sigma-max", 0), "--sigma-max 0"),
        (("--sigma-max", "nan"), "--sigma-max nan"),
        (("--topological", -1), "--topological -1"),
        (("--topological", "nan"), "--topological nan"),
        (("--pixels", 0), "pixels"),
        (("--pixels", 10**9), "pixels"),
        (("--metres-per-pixel", -2), "--metres-per-pixel -2"),
        (("--default-height", -1), "--default-height -1"),
        (("--height-scale", 2), "leave --height-scale out"),
        (("--layer", "roofs"), "leave --layer out"),
        (("--center", 4.8, 98), "--center 4.8 98.0"),
        (("--center", 99.0, 0.0), "for example --center 4.83"),
        (
            ("--center", 45.7685, 4.8344),
            "give longitude first: --center 4.8344 45.7685",
        ),
    ],
)
def test_an_option_out_of_bounds_is_refused(tmp_path, options, says):
    small = () if "--pixels" in options else ("--pixels", 32)
    words = ("encode", "lyon-1er", *small, *options, "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says=says)


@pytest.mark.parametrize(
    ("pixels", "says"),
    [(34, "--pixels 32 or --block 2"), (41, "give --pixels 40\n"), (14, "--block 2")],
)
def test_options_that_suit_the_block_are_named(tmp_path, pixels, says):
    words = ("encode", "lyon-1er", *PLAIN, "--pixels", pixels, "-o", tmp_path / "g.parquet")
    message = refused(tmp_path, *words, says=says)
    option, value = message.split("give ")[1].split(" or ")[-1].split()
    call(*words, option, value)  # what is named does


@pytest.mark.parametrize(("pixels", "says"), [(410, "--pixels 408 or --block 5"), (6, "--block 3")])
def test_a_side_of_blocks_that_divides_the_map_is_named(tmp_path, pixels, says):
    words = ("encode", "lyon-1er", *PLAIN, "--pixels", pixels, "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says=says)


@pytest.mark.parametrize(
    ("pixels", "says"),
    [(44, "--pixels 32 or --block 2-4\n"), (50, "give --pixels 48\n"), (41, "give --pixels 32\n")],
)
def test_options_that_suit_the_largest_of_the_leaves_are_named(tmp_path, pixels, says):
    words = ("encode", "lyon-1er", "--no-fit", "--block", "2-16", "--pixels", pixels)
    words = (*words, "-o", tmp_path / "g.parquet")
    message = refused(tmp_path, *words, says="multiples of 16")
    assert says in message
    option, value = message.split("give ")[1].split(" or ")[-1].split()
    call(*words, option, value)


def test_leaves_need_an_even_map_and_one_of_two_choices(tmp_path):
    words = ("encode", "lyon-1er", "--no-fit", "-o", tmp_path / "g.parquet", "--pixels")
    refused(tmp_path, *words, 41, says="an even height")
    both = ("--lifs", 900, "--max-error", 0.5)
    refused(tmp_path, *words, 32, *both, says="a budget of lifs or a largest error, not both")
    refused(tmp_path, *words, 32, "--lifs", 3, says="lifs")
    refused(tmp_path, *words, 32, "--max-error", -1, says="--max-error -1")
    refused(tmp_path, *words, 32, "--block", 4, "--lifs", 90, says="lifs")
    for sides in ("3-16", "16-2", "2-4-8", "two", "1-8", "-4"):
        told = call(*words, 32, "--block", sides, code=2).stderr
        assert "block" in told
        assert "Traceback" not in told


@click.command()
@click.option("--layer", help="a name")
@click.option("--center", nargs=2)
@click.option("--metres-per-pixel")
@click.option("--reach")
@click.option("--accept-changes", is_flag=True)
def _command():
    """Has options."""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"name the layer with {keyword('layer')}", "name the layer with --layer"),
        (f"for example {keyword('center', (4.83, 45.7))}", "for example --center 4.83 45.7"),
        (setting("center", (4.8, 98.0)), "--center 4.8 98.0"),
        (
            f"leave {keyword('center')} out: {keyword('pixels')} cuts",
            "leave --center out: pixels= cuts",
        ),
        (f"a: {setting('metres_per_pixel', 2.0)}", "a: --metres-per-pixel 2.0"),
        (f"{keyword('metres_per_pixel')}, metres", "--metres-per-pixel, metres"),
        (f"64, or {none_setting('reach')} for the whole map", "64, or all for the whole map"),
        (f"with {keyword('accept_changes', True)}: go", "with --accept-changes: go"),
        ("layer=a, None for all", "layer=a, None for all"),
        ("raised ValueError: one\n  two", "raised ValueError: one two"),
        ("genome.reach = 4", "genome.reach = 4"),
    ],
)
def test_messages_name_options_for_keywords(text, expected):
    assert message_of(EvocityError("found", "right", text), _command).endswith(f"to do: {expected}")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"name the layer with {keyword('layer')}", "name the layer with layer in [[parents]]"),
        (
            f"for example {keyword('center', (4.83, 45.7))}",
            "for example center = [4.83, 45.7] in [[parents]]",
        ),
        (f"the same {keyword('pixels')} and x", "the same pixels in [map] and x"),
        ("layer=a, None for all", "layer=a, None for all"),
    ],
)
def test_messages_of_a_run_name_keys_of_its_recipe(text, expected):
    assert message_of(EvocityError("found", "right", text), run).endswith(f"to do: {expected}")


def test_the_faults_of_a_recipe_keep_their_lines():
    assert "\n  run.seed" in message_of(
        RecipeError("1 fault:\n  run.seed", "right", "do"), _command
    )


def test_what_is_no_genome_is_called_what_it_is(tmp_path):
    table = pa.table({"geometry": [b""]}).replace_schema_metadata({"geo": "{}"})
    pq.write_table(table, tmp_path / "buildings.parquet")
    pq.write_table(pa.table({"a": [1]}), tmp_path / "plain.parquet")
    output = ("-o", tmp_path / "m.tif")
    for words in (("decode", *output), ("score",)):
        named = (words[0], tmp_path / "buildings.parquet", *words[1:])
        message = refused(tmp_path, *named, says="buildings.parquet is GeoParquet")
        assert "evocity encode MAP" in message
    words = ("decode", tmp_path / "plain.parquet", *output)
    refused(tmp_path, *words, says="plain.parquet is Parquet, but not a genome")
    words = ("encode", tmp_path / "buildings.parquet", "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says="buildings.parquet has no metadata of GeoParquet")
    message = refused(tmp_path, "decode", "lyon-1er", *output, says="lyon-1er is a map")
    assert "evocity encode lyon-1er" in message
    refused(tmp_path, "decode", write_town(tmp_path / "a.npy"), *output, says="a.npy is a map")
    refused(tmp_path, "decode", tmp_path, *output, says="a folder, but not the folder of a run")


@pytest.mark.parametrize("command", ["decode", "refine", "scene", "show --usage"])
def test_an_id_given_twice_is_refused(tmp_path, command):
    output = tmp_path / ("x.png" if "show" in command else "x.parquet")
    words = (*command.split(), tmp_path, "--id", 1, "--id", 2, "-o", output)
    message = refused(tmp_path, *words, says="--id 1 --id 2")
    assert "--id once" in message


def test_an_id_means_nothing_without_a_run(tmp_path, genome_file):
    refused(tmp_path, "score", genome_file, "--id", 3, says="not a run folder")
    refused(tmp_path, "show", "lyon-1er", "--id", 3, "-o", tmp_path / "p.png", says="not a run")
    refused(tmp_path, "decode", tmp_path, "--id", 3, "-o", tmp_path / "m.tif", says="no run at")
    missing = ("decode", tmp_path / "missing", "--id", 3, "-o", tmp_path / "m.tif")
    refused(tmp_path, *missing, says="nothing is at")
    refused(tmp_path, "show", "nothing", "--id", 3, "-o", "m.png", says="which does not exist")


@pytest.mark.parametrize("words", ["show {} -o x.png", "decode {} --id 3 -o x.tif", "score {}"])
def test_a_run_that_is_not_there_is_told_with_one_that_is(tmp_path, words, monkeypatch):
    shutil.copytree(OLD / "run-5", tmp_path / "night")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    for name, meant in (("nigth", "night"), ("runs/../nite", "runs/../night")):
        message = refused(tmp_path, *words.format(name).split(), says=f"nothing is at '{name}'")
        assert "the folder of a run" in message
        assert f"did you mean {meant}?" in message
    shutil.copytree(OLD / "run-5", tmp_path / "lyon-1er-night")
    if "--id" not in words:
        call(*words.format("lyon-1er").split())
    message = refused(tmp_path, *words.format("rns/night").split(), says="there is no folder")
    assert "check the path" in message


@pytest.mark.parametrize(
    "options",
    [
        ("--domains", "two"),
        ("--reach", "far"),
        ("--block", "4.5"),
        ("--center", "4.8"),
        ("--depth",),
    ],
)
def test_an_option_that_cannot_be_parsed_is_refused(tmp_path, options):
    result = call("encode", "lyon-1er", "-o", tmp_path / "g.parquet", *options, code=2)
    assert options[0] in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("zoom", ["0", "-1", "0.01", "nan", "inf", "5000"])
def test_a_bad_zoom_is_refused(tmp_path, genome_file, zoom):
    words = ("decode", genome_file, "--zoom", zoom, "-o", tmp_path / "m.tif")
    refused(tmp_path, *words, says="zoom")


def test_a_diverging_code_is_refused_before_it_is_written(tmp_path, genome_file):
    genome = read_genome(genome_file)
    sigma = np.where(genome.uniform, 0, 9).astype(np.float32)
    genome.replace(sigma=sigma, sigma_max=9.0).write(tmp_path / "wild.parquet")
    words = ("decode", tmp_path / "wild.parquet", "-o", tmp_path / "m.tif")
    refused(tmp_path, *words, says="diverges")


def test_options_of_reading_mean_nothing_for_a_genome(tmp_path, genome_file):
    refused(tmp_path, "score", genome_file, "--metres-per-pixel", 1, says="--metres-per-pixel")
    words = ("show", genome_file, "-o", tmp_path / "p.png", "--pixels", 9)
    refused(tmp_path, *words, says="--pixels")


# -- measures ------------------------------------------------------------------------------


def test_an_unknown_measure_is_refused_with_the_one_that_may_be_meant(tmp_path):
    message = refused(tmp_path, "score", "lyon-1er", "--fitness", "alignmemt", says="alignmemt")
    assert "what to do: did you mean alignment? `evocity fitness list` shows all " in message
    assert "autosimilarity" not in message


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no table at"),
        ("[[type]", "no TOML"),
        ("[[type]]\nname = 'a'\nheight = { below = 9 }", "no type includes a building of area"),
        (
            "[[type]]\nname = 'a'\n[[type]]\nname = 'b'",
            "the limits of a and of b both include a building of area",
        ),
        ("[shares]\nrow = 0.5", "sum to 0.5"),
    ],
)
def test_faulty_tables_of_types_are_refused(tmp_path, text, says):
    path = tmp_path / "dwellings.toml"
    if text is not None:
        path.write_text(text)
    for words in (("score", "lyon-1er", "--fitness"), ("fitness", "bench")):
        assert "dwellings.toml" in refused(tmp_path, *words, path, says=says)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no Python file"),
        ("def f(:", "line 1"),
        ("import nowhere_to_be_found", "nowhere_to_be_found"),
        ("x = 1", "no measure"),
        ("import evocity\n@evocity.fitness(goal='most')\ndef f(city): return 1", "goal"),
        ("import evocity\n@evocity.fitness(goal='max')\ndef gsi(city): return 1", "gsi"),
        ("import evocity\n@evocity.fitness(goal='max')\ndef f_raises(city): 1 / 0", "ZeroDivision"),
        (
            "import evocity\n@evocity.fitness(goal='max')\ndef f_none(city): pass",
            "returned None",
        ),
        (
            "import evocity\n@evocity.fitness(goal='max')\n"
            "def f_told(city): raise ValueError('one\\n\\n  two')",
            "ValueError: one two on lyon-1er",
        ),
    ],
)
def test_a_bad_file_of_measures_is_refused(tmp_path, text, says):
    own = tmp_path / "own.py"
    if text is not None:
        own.write_text(text)
    refused(tmp_path, "score", "lyon-1er", "--pixels", 32, "--fitness", own, says=says)


# -- outputs -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("encode", "lyon-1er"), "g.parquet"),
        (("show", "lyon-1er"), "p.png"),
        (("decode", "town.parquet"), "m.tif"),
    ],
)
def test_an_output_that_cannot_be_is_refused_before_any_work(
    tmp_path, genome_file, monkeypatch, words, name
):
    monkeypatch.chdir(tmp_path)

    def work(*_, **__):
        raise AssertionError("work began")

    for name_of_work in ("encode", "decode", "read_map", "read_genome"):
        monkeypatch.setattr(f"evocity.{name_of_work}", work, raising=False)
    refused(tmp_path, *words, "-o", tmp_path / "nowhere" / name, says="there is no folder")
    (tmp_path / f"folder-{name}").mkdir()
    refused(tmp_path, *words, "-o", tmp_path / f"folder-{name}", says="is a folder")
    monkeypatch.setattr(os, "access", lambda *_: False)
    refused(tmp_path, *words, "-o", tmp_path / name, says="may not write in the folder")


def test_an_output_of_a_wrong_kind_is_refused(tmp_path, genome_file):
    refused(tmp_path, "encode", "lyon-1er", "-o", tmp_path / "g.tif", says="name of a map")
    refused(tmp_path, "decode", genome_file, "-o", tmp_path / "m.docx", says=".docx")
    refused(tmp_path, "show", "lyon-1er", "-o", tmp_path / "p.jpg", says=".jpg")


def test_settled_roofs_are_named_once_and_by_a_known_word(tmp_path, genome_file):
    for words in (("encode", "lyon-1er"), ("decode", genome_file)):
        words += ("-o", tmp_path / ("g.parquet" if words[0] == "encode" else "m.tif"))
        both = (*words, "--settle", "roofs", "--no-settle")
        refused(tmp_path, *both, says="--settle roofs together with --no-settle")
        told = call(*words, "--settle=tiles", code=2).stderr
        assert "'tiles' is not one of 'buildings', 'roofs'" in told


def test_the_input_is_never_the_output(tmp_path, genome_file):
    picture = tmp_path / "map.png"
    Image.fromarray(np.zeros((8, 8), np.uint8)).save(picture)
    refused(tmp_path, "show", picture, "-o", picture, says="both the input and the output")
    bare = genome_file.rename(tmp_path / "genome.npy")
    refused(tmp_path, "decode", bare, "-o", bare, says="both the input and the output")


def test_a_full_disk_is_told(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    words = ("encode", "lyon-1er", "--pixels", 32, "-o", tmp_path / "g.parquet")
    refused(tmp_path, *words, says="No space left")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("layer=roofs.geojson", "no file 'layer=roofs.geojson'"),
        ("block = 3, reach=4.tif", "no file 'block = 3, reach=4.tif'"),
        ("None for all.png", "no file 'None for all.png'"),
        ("pixels=(1, 2).xyz", "pixels=(1, 2).xyz"),
        ("\ufdd0layer\ufdd1=\ufdd1x.tif", "no file '"),
    ],
)
def test_names_of_files_are_told_as_they_are(tmp_path, monkeypatch, name, says):
    monkeypatch.chdir(tmp_path)
    message = refused(tmp_path, "encode", name, "-o", "g.parquet", says=says)
    assert "--layer" not in message
    assert not re.search("[\ufdd0-\ufdd2]", message)
    (tmp_path / "none for.py").write_text("x = 1")
    words = ("fitness", "check", "layer=mine.py")
    assert "layer=mine.py" in refused(tmp_path, *words, says="no Python file at layer=mine.py")


def test_parameters_become_options_with_their_values(tmp_path):
    np.save(tmp_path / "layer=a.npy", np.zeros((16, 16)))
    words = ("encode", tmp_path / "layer=a.npy", "--layer", "b", "-o", tmp_path / "g.parquet")
    message = refused(tmp_path, *words, says="layer=a.npy: --layer does not apply to .npy")
    assert "leave --layer out" in message
    words = ("encode", "lyon-1er", "-o", tmp_path / "g.parquet")
    message = refused(tmp_path, *words, "--center", 200, 1, says="--center 200.0 1.0")
    assert "for example --center 4.8344 45.7685" in message
    message = refused(tmp_path, *words, "--reach", -1, "--domains", "1,2", says="--reach -1")
    assert "--domains 1,2" in message
    assert "or all for the whole map" in message
