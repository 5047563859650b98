"""Texts of strangers on the way to the terminal, to a spreadsheet, and into the log."""

import json
import os
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import evocity
from evocity.analysis.individual import Individual
from evocity.citymap import CityMap
from evocity.cli import main
from evocity.errors import LONGEST, MapError, RecipeError, cut_short, keyword, plain_text
from evocity.evaluation.output import Drain
from evocity.store import Birth, Header
from evocity.store.provenance import environment
from evocity.store.schema import LONGEST_ERROR, births_table

RED = "\x1b[31m"
#: A name that turns the text red, sets the window's title, and what follows around.
EVIL = f"{RED}Ly\x1b]0;owned\x07on\u202e\x9b2J\r\n"


def output(*words) -> str:
    result = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert result.exception is None or isinstance(result.exception, SystemExit), words
    return result.output


def is_plain(text: str) -> bool:
    return all(one.isprintable() or one == "\n" for one in text)


def written(path: Path, name: str) -> Path:
    """A genome whose city is called ``name``."""
    heights = np.zeros((32, 32))
    heights[8:20, 10:24] = 9
    city = CityMap(heights, 2.0, name=name, attribution=name)
    evocity.encode(city).genome.write(path)
    return path


def test_no_control_character_of_a_name_reaches_the_terminal(tmp_path):
    genome = written(tmp_path / "a.parquet", EVIL)
    named = shutil.copyfile(genome, tmp_path / f"{RED}.parquet")
    again = tmp_path / "b.parquet"
    for words in (
        ("score", genome),
        ("score", genome, named, "--csv"),
        ("decode", named, "-o", tmp_path / "a.tif"),
        ("encode", tmp_path / "a.tif", "-o", again),
        ("show", again, "-o", tmp_path / "a.png"),
        ("breed", "--operator", "mutation", again, "-o", tmp_path / "c.parquet"),
        ("score", tmp_path / f"no{RED}.geojson"),
        ("score", "lyon-1er", "--fitness", f"gsi{RED}"),
    ):
        said = output(*words)
        assert said
        assert is_plain(said), words


def test_a_map_that_begins_as_a_formula_is_no_formula(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("=cmd|' C calc'!A1.png", "+1.png", "@SUM(A1).png", "plain.png"):
        Image.fromarray(np.full((16, 16), 9, np.uint8)).save(tmp_path / name)
        flat = ["--height-scale", "1", "--terrain", "0"]
        words = ["score", name, "--csv", "--fitness", "gsi", "--metres-per-pixel", "2"]
        said = CliRunner().invoke(main, [*words, *flat], prog_name="evocity").stdout
        row = said.splitlines()[-1].strip('"')
        assert row.startswith(name[0] if name[0] == "p" else "'" + name[0])


def test_a_message_is_short_and_plain():
    for found in ("x" * 10_000, "é" * 5000, EVIL * 900, keyword("layer", EVIL)):
        for error in (MapError(found, found, found), MapError("here", found, "do it")):
            text = str(error)
            assert len(text.encode()) <= LONGEST
            assert text.count("\n") == 2
            assert is_plain(text)
            assert all(error.args)


def test_a_recipes_faults_are_told_as_far_as_there_is_room():
    faults = [f"run.key{k}: {k}; allowed: one of these, or another" for k in range(100)]
    error = RecipeError("it has 100 faults:\n  " + "\n  ".join(faults), "none", "correct them")
    text = str(error)
    assert len(text.encode()) <= LONGEST
    assert all(fault in error.found for fault in faults)
    told = sum(fault in text for fault in faults)
    assert told > 8
    assert f"and {100 - told} more" in text
    assert all(fault in error.list_faults(20_000) for fault in faults)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Bâtiments 建物 🏠", "Bâtiments 建物 🏠"),
        ("a\tb\nc", "a b c"),
        ("a\x00\x7f\x9bb", "a\ufffd\ufffd\ufffdb"),
        ("\u202eabc\u2066\ud800", "\ufffdabc\ufffd\ufffd"),
    ],
)
def test_plain_text(text, told):
    assert plain_text(text) == told


def test_texts_are_cut_between_letters():
    assert cut_short("é" * 10, 9) == "ééé…"
    assert cut_short("abc", 3) == "abc"


def births(error: str) -> str:
    header = Header(16, 16, 2.0, 0.9, ("a",), "", None, None, 7, 1, "hash", ("gsi",))
    birth = Birth(0, 0, (), "mutation", "error", error, 0.1, {}, None)
    return births_table([birth], header)["error"][0].as_py()


def test_the_log_keeps_a_kilobyte_of_an_error_and_no_folder():
    assert len(births("é" * 10**6).encode()) <= LONGEST_ERROR
    assert births(f"{RED}no") == "\ufffd[31mno"
    assert births("bad (/srv/secret place/x.py, line 3)").count("secret") <= 1
    assert births("bad (/srv/secret/deep/toys.py, line 3) raised") == "bad (toys.py, line 3) raised"
    assert births("KeyError: 3 (/srv/secret/toys.py:12)") == "KeyError: 3 (toys.py:12)"
    assert births(f"no file {Path.home()}/maps/a.tif") == "no file ~/maps/a.tif"
    assert births("1/2 of a/b.py and 3 / 4") == "1/2 of a/b.py and 3 / 4"


def test_the_command_is_kept_without_the_users_folders(monkeypatch, tmp_path):
    words = [str(tmp_path / "bin" / "evocity"), "run", str(tmp_path / "r.toml"), "--seed", "3"]
    words += [f"--out={tmp_path}/x", "maps/a.tif"]
    monkeypatch.setattr(sys, "argv", words)
    told = environment()["command"]
    assert told == ["evocity", "run", "r.toml", "--seed", "3", "--out=x", "maps/a.tif"]
    assert str(tmp_path) not in json.dumps(told)


def test_no_control_character_is_in_what_python_shows():
    heights = np.zeros((32, 32))
    heights[8:20, 10:24] = 9
    genome = evocity.encode(CityMap(heights, 2.0, name=EVIL)).genome
    run = SimpleNamespace(path=Path(EVIL))
    birth = SimpleNamespace(operator=EVIL, generation=1, status="ok", id=3, run=run)
    for shown in (repr(genome), Individual.__repr__(birth)):
        assert is_plain(shown)


def test_no_control_character_of_a_measure_reaches_the_terminal():
    read, write = os.pipe()
    os.write(write, f"a\tb{EVIL}\u202ec\n".encode(errors="replace"))
    os.close(write)
    drain = Drain(read)
    text = drain.text()
    drain.close()
    assert text.startswith("a\tb")
    assert is_plain(text.replace("\t", " "))
