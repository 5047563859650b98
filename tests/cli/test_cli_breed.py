"""`evocity breed` and `evocity operators list`: any operator, by name, with its parameters."""

import json
import re
import shlex
import tomllib
from dataclasses import fields

import numpy as np
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_recipe, write_town
from hypothesis import given
from hypothesis import strategies as st

import evocity
from evocity.cli.breed import _note_fill, _note_street_blocks, breed, make_operator
from evocity.cli.shared.options import settings_of, value_of
from evocity.errors import EvocityError
from evocity.operators import OPERATORS, make, operators


@pytest.fixture
def towns(tmp_path):
    """Two genome files of 32 × 32 px."""
    paths = []
    for seed, name in enumerate(("left", "right"), 1):
        paths.append(tmp_path / f"{name}.parquet")
        town = write_town(tmp_path / f"{name}.npy", seed, side=32)
        call("encode", town, *AT_2_M, *PLAIN, "-o", paths[-1])
    return paths


def test_a_child_is_the_librarys(tmp_path, towns):
    settings = {"size_min": "2", "size_max": "3", "fill": "0.4", "domains": "2,3", "reach": "all"}
    options = [word for k, v in settings.items() for word in ("--set", f"{k}={v}")]
    path = tmp_path / "child.parquet"
    words = (*towns, "--seed", 5, *options, "-o", path, "--json")
    result = call("breed", "pavement_fusion", *words)
    fuse = make("pavement_fusion", size_min=2, size_max=3, fill=0.4, domains=[2, 3], reach=None)
    genomes = [evocity.read_genome(town) for town in towns]
    child = fuse(genomes, np.random.default_rng(5))
    written = evocity.read_genome(path)
    assert written == child
    assert np.array_equal(written.source, child.source)
    told = json.loads(result.stdout)
    assert told["lifs"] == 64
    assert told["cities"]["right"] == pytest.approx((child.parent == 1).mean())
    assert told["made"]["fill_reached"] == child.made["fill_reached"]
    assert (told["operator"], told["seed"]) == ("pavement_fusion", 5)


@pytest.mark.slow
def test_the_example_of_the_help_is_carried_out(tmp_path):
    (example,) = re.findall(r"evocity (breed .*--seed 7[\s\S]*?\.parquet)", breed.epilog)
    words = shlex.split(example.replace("\\\n", " "))
    call(*words[:-1], tmp_path / words[-1])
    assert (tmp_path / words[-1]).is_file()


def test_what_was_made_is_told_in_words(tmp_path, towns):
    result = call("breed", "pavement_fusion", *towns, "-o", tmp_path / "child.parquet")
    assert "pavement_fusion: 64 lifs, B = 4, 32 × 32 px at 2 m" in result.stdout
    assert "fill_reached: " in result.stdout
    assert "repaired: " in result.stdout
    assert result.stdout.endswith(f"wrote {tmp_path / 'child.parquet'}\n")


def test_street_blocks_that_stay_as_they_are_are_noted(tmp_path, towns):
    words = (*towns, "-o", tmp_path / "child.parquet", "--set", "density=100", "--set")
    told = call("breed", "quarter_fusion", *words, "area_min=10").stderr
    assert "Note: no street block was filled: a lower density= fills more" in told
    told = call("breed", "quarter_refill", *words, "street_blocks=7", "--json").stderr
    assert "Note: 0 of 7 street blocks filled: a lower density=" in told


@pytest.mark.parametrize(
    ("asked", "made", "says"),
    [
        (None, (0.6, 0.26, 9), "right has a share of 0.26, not 0.60: a lower density= "),
        (None, (0.6, 0.55, 9), ""),
        (None, (0.0, 0.0, 0), ""),
        (5, (0.6, 0.26, 5), ""),
        (5, (0.6, 0.26, 1), "1 of 5 street blocks filled: a lower density= "),
    ],
)
def test_much_less_than_was_asked_for_is_noted(capsys, asked, made, says):
    wanted, reached, filled = made
    made = {
        "fill": [1 - wanted, wanted],
        "fill_reached": [1 - reached, reached],
        "street_blocks": filled,
    }
    breeding = make("quarter_fusion", street_blocks=asked)
    _note_street_blocks(breeding, ["left", "right"], made)
    told = capsys.readouterr().err
    assert told.startswith(f"Note: {says}") if says else not told


def test_shares_that_are_missed_are_noted(tmp_path, towns):
    words = ("breed", "pavement_fusion", *towns, "-o", tmp_path / "child.parquet", "--set")
    missed = call(*words, "tolerance=0.001")
    assert (
        "Note: the child has nothing of parent 2: no group fits; a larger tolerance="
        in missed.stderr
    )
    assert "Note:" not in call(*words, "tolerance=1000").stderr


@pytest.mark.parametrize(
    ("reached", "says"),
    [
        ((0.9, 0.1), "a share misses fill by 0.40, margin 0.1"),
        ((1.0, 0.0), "the child has nothing of parent 2: no group fits"),
        ((0.5, 0.45), ""),
    ],
)
def test_how_shares_are_missed_is_told(capsys, reached, says):
    _note_fill({"fill": [0.5, 0.5], "fill_reached": list(reached), "margin": 0.1})
    told = capsys.readouterr().err
    assert told.startswith(f"Note: {says}") if says else not told


def test_the_seed_decides(tmp_path, towns):
    children = []
    for seed in (1, 1, 2):
        path = tmp_path / f"{len(children)}.parquet"
        call("breed", "mutation", towns[0], "--seed", seed, "--set", "beta=1", "-o", path)
        children.append(evocity.read_genome(path))
    assert children[0] == children[1] != children[2]


def test_maps_and_names_are_coded_first(tmp_path):
    town = write_town(tmp_path / "town.npy", side=32)
    path = tmp_path / "child.parquet"
    reading = ("--pixels", 32, *AT_2_M)
    coding = ("--block", 8, "--reach", "all", "--domains", "2,3")
    call("breed", "lambda_crossover", "lyon-1er", town, *reading, *coding, "-o", path)
    child = evocity.read_genome(path)
    assert child.pavement == evocity.Pavement(32, 32, 8)
    cities = [evocity.read_map(m, pixels=32, metres_per_pixel=2) for m in ("lyon-1er", town)]
    genomes = [evocity.encode(c, block=8, reach=None, domains=(2, 3)).genome for c in cities]
    assert child == make("lambda_crossover")(genomes, np.random.default_rng(0))
    assert "IGN" in child.attribution


def test_a_map_beside_a_genome_takes_its_block(tmp_path):
    town = write_town(tmp_path / "town.npy", side=32)
    call("encode", town, *AT_2_M, "--block", 8, "-o", tmp_path / "town.parquet")
    other = write_town(tmp_path / "other.npy", 2, side=32)
    words = (other, tmp_path / "town.parquet", *AT_2_M, "-o", tmp_path / "child.parquet")
    call("breed", "lambda_crossover", *words)
    child = evocity.read_genome(tmp_path / "child.parquet")
    assert child.pavement.block == 8
    assert child.cities == ("other", "town")


def test_individuals_of_runs_breed(tmp_path):
    call("run", write_recipe(tmp_path), "--generations", 1, "--out", tmp_path / "run")
    run = evocity.open_run(tmp_path / "run")
    path = tmp_path / "child.parquet"
    words = ("breed", "lambda_crossover", tmp_path / "run", tmp_path / "run", "-o", path)
    call(*words, "--id", 7, "--id", 3)
    genomes = [run.genome(7), run.genome(3)]
    assert evocity.read_genome(path) == make("lambda_crossover")(genomes, np.random.default_rng(0))
    refused(tmp_path, *words, "--id", 7, says="one --id N for each run folder")
    refused(tmp_path, *words, says="is a run folder, which contains many genomes")


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_every_operator_breeds_by_name(tmp_path, towns, name):
    count = OPERATORS[name].parents[0]
    path = tmp_path / "child.parquet"
    call("breed", name, *[*towns, *towns][:count], "--set", "repair=none", "-o", path)
    assert evocity.read_genome(path).made["operator"] == name


# -- what cannot be -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("pavement_fuson",), "did you mean pavement_fusion?"),
        (("pavement_fuson",), "lambda_crossover"),
        (("pavement_fusion", "--set", "size_max=0"), "size_max: 0"),
        (("pavement_fusion", "--set", "size=8"), "size is unknown, did you mean size_"),
        (("pavement_fusion", "--set", "reach=-3"), "with --set reach: -3"),
        (("pavement_fusion", "--set", "tolerance=high"), "tolerance: 'high'"),
        (("pavement_fusion", "--set", "tolerance"), "KEY=VALUE"),
        (("pavement_fusion", "--set", "=3"), "KEY=VALUE"),
        (("pavement_fusion", "--set", "margin=1", "--set", "margin=0"), "the second of margin"),
        (("pavement_fusion", "--set", "fill=0.2,0.3"), "fill"),
        (("mutation",), "mutation cannot breed from 2 parents"),
        (("pavement_fusion", "--block", 8), "--block cannot be used with only genomes"),
        (("pavement_fusion", "--reach", "all"), "--reach cannot be used with only genomes"),
        (("pavement_fusion", "--pixels", 8), "--pixels cannot be used with only genomes"),
        (("pavement_fusion", "--id", 8), "run folders is 0"),
    ],
)
def test_what_cannot_be_bred_is_refused(tmp_path, towns, words, says):
    operator, *options = words
    child = ("-o", tmp_path / "child.parquet")
    refused(tmp_path, "breed", operator, *towns, *options, *child, says=says)


def test_parents_that_cannot_be_are_refused(tmp_path, towns):
    child = ("-o", tmp_path / "child.parquet")
    fuse = ("breed", "pavement_fusion", towns[0])
    refused(tmp_path, *fuse, *child, says="1 parent\n")
    refused(tmp_path, *fuse, tmp_path / "none.parquet", *child, says="no genome file")
    refused(tmp_path, *fuse, tmp_path, *child, says="is a folder")
    refused(tmp_path, *fuse, "lyon-2e", *child, says="no bundled city")
    small = write_town(tmp_path / "small.npy", side=24)
    refused(
        tmp_path,
        *fuse,
        small,
        *AT_2_M,
        *child,
        says="parents with the same number and size of pixels",
    )
    odd = write_town(tmp_path / "odd.npy", side=30)
    refused(tmp_path, *fuse, odd, *AT_2_M, *child, says="range blocks of 4 px")
    refused(tmp_path, *fuse, small, *child, says="--metres-per-pixel")


def test_a_child_is_no_map_and_no_parent(tmp_path, towns):
    words = ("breed", "pavement_fusion", *towns, "-o")
    refused(tmp_path, *words, tmp_path / "child.tif", says="name of a map")
    refused(tmp_path, *words, towns[1], says="both the input and the output")
    refused(tmp_path, *words, tmp_path / "no" / "child.parquet", says="no folder")


# -- values ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("8", 8),
        ("0.3", 0.3),
        (".3", 0.3),
        ("true", True),
        ("False", False),
        ("none", None),
        ("None", None),
        ("2,3", [2, 3]),
        ("[2, 3]", [2, 3]),
        (".3,.7", [0.3, 0.7]),
        ("[1,2],[3,4]", [[1, 2], [3, 4]]),
        ("move", "move"),
        ('"move"', "move"),
        ("both ways", "both ways"),
        ("left,right", ["left", "right"]),
        ("1\nx = 2", "1\nx = 2"),
        ("{ a = 1 }", {"a": 1}),
        ("__import__('os')", "__import__('os')"),
        ("[" * 2000, "[" * 2000),
        ("9" * 5000, float("inf")),
    ],
)
def test_values_are_read_as_toml_or_are_words(text, value):
    found = value_of(text)
    assert found == value
    assert type(found) is type(value)


@given(
    st.recursive(
        st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False, width=32),
        lambda inner: st.lists(inner, min_size=1, max_size=3),
        max_leaves=6,
    )
)
def test_what_toml_writes_is_read(value):
    text = json.dumps(value).replace("Infinity", "inf")
    assert value_of(text) == tomllib.loads(f"v = {text}")["v"]


def test_settings_are_told_by_name():
    assert settings_of(("fill = 0.3 ", "mode=copy")) == {"fill": 0.3, "mode": "copy"}
    assert settings_of(()) == {}
    for bad in (("fill",), ("fill=",), ("=1",), ("a=1", "a=1")):
        with pytest.raises(EvocityError):
            settings_of(bad)


# -- the list -------------------------------------------------------------------------------


def test_the_list_tells_every_operator_and_parameter():
    told = json.loads(call("operators", "list", "--json").stdout)
    assert list(told) == sorted(operators())
    for name, kind in OPERATORS.items():
        about = told[name]
        assert tuple(about["parents"]) == kind.parents
        assert about["doc"] == " ".join(kind.__doc__.partition("\n\n")[0].split())
        defaults = {f.name: f.default for f in fields(kind)}
        assert encode(about["parameters"]) == defaults
        # what the list shows can be typed
        settings = settings_of(tuple(f"{k}={typed(v)}" for k, v in defaults.items()))
        assert encode(vars(make_operator(name, settings))) == encode(vars(kind()))


def encode(values: dict) -> dict:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}


def typed(value) -> str:
    shown = call("operators", "list").stdout
    text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
    text = {"None": "none", "True": "true", "False": "false"}.get(text, text)
    assert f"={text}" in shown
    return text


def test_the_list_is_a_table():
    lines = call("operators", "list").stdout.splitlines()
    assert lines[0].split() == ["name", "parents", "from", "what", "it", "does"]
    for name, kind in OPERATORS.items():
        (line,) = [line for line in lines if line.split()[:1] == [name]]
        fewest, most = kind.parents
        assert line.split()[1] == (str(fewest) if fewest == most else f"{fewest}…{most or ''}")
        assert any(line.startswith(f"{name}: ") for line in lines)
