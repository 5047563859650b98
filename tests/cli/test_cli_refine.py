"""`evocity refine`."""

import json

import numpy as np
import pytest
from cli_tools import call, contents, refused

import evocity
from evocity.store import RunLog


@pytest.fixture(scope="module")
def ended(finished_runs, tmp_path_factory):
    """A run that is finished."""
    return finished_runs.copy("commanded", tmp_path_factory.mktemp("refined"))


@pytest.mark.parametrize("way", ["lambda_field", "heights", "parameters"])
def test_a_genome_is_written_and_the_run_stays_as_it_is(ended, tmp_path, way):
    before, path = contents(ended), tmp_path / "better.parquet"
    words = ("refine", ended, "--id", 9, "--way", way, "--budget", 8, "-o", path)
    told = json.loads(call(*words, "--json").stdout)
    assert contents(ended) == before
    assert (told["id"], told["way"], told["failures"]) == (9, way, 0)
    assert told["evaluations"] <= 8
    assert set(told["values"]["before"]) == {"alignment", "gsi"}
    assert (told["score"]["after"] < told["score"]["before"]) == told["better"]
    genome = evocity.read_genome(path)
    assert genome.made["refined"]["id"] == 9
    text = call(*words).output
    assert f"individual 9: {way}" in text
    assert "sum of losses" in text
    assert evocity.read_genome(path) == genome


def test_nothing_better_is_told_and_the_individual_written(ended, tmp_path):
    path = tmp_path / "same.parquet"
    words = ("--way", "fit", "--towards", tmp_path / "own.npy", "--metres-per-pixel", 2)
    genome = RunLog(ended).individuals([9])[0].genome
    np.save(tmp_path / "own.npy", evocity.decode(genome).city.heights)  # as near as can be
    result = call("refine", ended, "--id", 9, *words, "--budget", 1, "-o", path)
    assert "no better individual found" in result.stderr
    assert evocity.read_genome(path) == genome


@pytest.mark.slow
def test_why_an_optimiser_stopped_early_is_told(ended, tmp_path):
    path = tmp_path / "tuned.parquet"
    words = ("refine", ended, "--id", 9, "--budget", 500, "--side", 1, "-o", path)
    result = call(*words, "--way", "heights", "--json")
    told = json.loads(result.stdout)
    assert told["evaluations"] <= told["bred"]
    assert told["evaluations"] < 500
    assert f"{told['evaluations']} of 500 evaluations: the optimiser settled" in result.stderr
    assert "finer field with --side" in result.stderr


def test_nothing_is_written_into_the_run(ended):
    before = contents(ended)
    words = ("refine", ended, "--id", 9, "-o", ended / "recipe.toml")
    refused(ended, *words, says="in the folder of the run")
    assert contents(ended) == before


def test_a_map_is_come_closer_to(ended, tmp_path):
    path, target = tmp_path / "near.parquet", ended.parent / "left.npy"
    words = ("refine", ended, "--id", 9, "--way", "fit", "--budget", 5, "-o", path)
    call(*words, "--towards", target, "--metres-per-pixel", 2)
    fit = evocity.read_genome(path).made["fit"]
    assert fit["psnr_after"] > fit["psnr_before"]
    assert np.isfinite(evocity.decode(evocity.read_genome(path)).city.heights).all()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--id", 99), "no individual 99"),
        (("--id", 9, "--with", 99), "no individual 99"),
        (("--id", 0, "--way", "parameters"), "no operator bred individual 0"),
        (("--id", 9, "--way", "heights", "--with", 3), "--with cannot be used with --way heights"),
        (("--id", 9, "--tune", "fill"), "--tune cannot be used with --way lambda_field"),
        (("--id", 9, "--way", "parameters", "--tune", "trees"), "no number 'trees' to tune"),
        (("--id", 9, "--way", "fit"), "--way fit is given without --towards"),
        (("--id", 9, "--way", "fit", "--towards", "nowhere.tif"), "nowhere.tif"),
        (("--id", 9, "--pixels", 32), "without --towards"),
    ],
)
def test_what_cannot_be_refined_is_refused(ended, tmp_path, words, says):
    before = contents(ended)
    refused(tmp_path, "refine", ended, *words, "-o", tmp_path / "x.parquet", says=says)
    assert contents(ended) == before


def test_no_run_is_told_as_such(tmp_path):
    words = ("refine", tmp_path / "none", "--id", 1, "-o", tmp_path / "x.parquet")
    refused(tmp_path, *words, says="no run at")
