"""Kernels are compiled once, before a search, in two processes; later ones find them."""

import os
import subprocess
import sys
from unittest.mock import patch

import numpy as np
import pytest

from evocity import accelerate, fitness
from evocity.evaluation import compilation, kernel_warmup
from evocity.operators import OPERATORS
from evocity.search import Search, read_recipe


@pytest.fixture
def notes(tmp_path, monkeypatch):
    """The folder of notes: an empty one, though the cache has what the tests before compiled."""
    folder = tmp_path / "notes"
    folder.mkdir()
    monkeypatch.setattr(accelerate, "cache_folder", lambda: folder)
    return folder


def test_a_recipe_names_the_parts_that_it_calls(toy):
    parts = compilation.kernel_parts(read_recipe("demo"))
    assert parts[0] == kernel_warmup.SEARCH
    assert {"fit", "decode", "operator:plan_fusion", "measure:crumbs"} <= set(parts)
    assert not {"views", "operator:gene_copy", "measure:street_width", "search everywhere"} & {
        *parts
    }
    assert set(parts) - {"buildings"} <= set(kernel_warmup.every_part())
    own = toy(recipe='[[fitness]]\nname = "gsi"\ntarget = 0.3\n', genome='block = 4\nreach = "all"')
    parts = compilation.kernel_parts(
        read_recipe(own)
    )  # a measure of one's own may ask for any view
    assert {"views", "search everywhere", "measure:gsi"} <= set(parts)
    assert not [one for one in parts if "spread" in one]


def test_every_part_does_what_it_is_for():
    for part in kernel_warmup.every_part():
        kind, _, name = part.partition(":")
        if kind == "operator":
            parents = kernel_warmup._genomes(8)[: OPERATORS[name].parents[0]]
            assert OPERATORS[name]()(parents, np.random.default_rng(0)).pavement.block == 8
        elif kind == "measure":
            genome = kernel_warmup._genomes(8)[0]
            toys = [kernel_warmup._toy(1, 8), kernel_warmup._toy(2, 8)]
            given = {"genome": genome, "parents": (genome,), "sources": toys, "reference": toys}
            measure = fitness.get(name)
            measure(toys[0], **{key: one for key, one in given.items() if key in measure.takes})
    for view in kernel_warmup._VIEWS:
        assert getattr(kernel_warmup._toy(1, 8), view) is not None


@pytest.mark.slow
def test_what_was_compiled_is_noted_and_not_done_again(notes):
    told = []
    parts = [kernel_warmup.SEARCH, kernel_warmup.DECODE, "operator:mutation", "measure:gsi"]
    compilation.compile_once(4, parts, told.append)
    assert len(list(notes.iterdir())) == 4
    with patch.object(compilation, "_start", side_effect=AssertionError):
        compilation.compile_once(4, parts, pytest.fail)
    with patch.object(accelerate, "stamp", lambda: ("another processor",)):
        compilation.compile_once(4, ["measure:gsi"], told.append)
    assert len(list(notes.iterdir())) == 5


@pytest.mark.parametrize("line", ["kernel", ""])
def test_only_what_is_compiled_is_told(notes, monkeypatch, line):
    script = (
        "import sys, time\n"
        "for part in sys.stdin:\n"
        f"    print({line!r} and 'kernel\\n' + 'done' or 'done', flush=True)\n"
        "time.sleep(2)"
    )

    def started(sides):
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        return subprocess.Popen([sys.executable, "-c", script], **pipes)

    monkeypatch.setattr(compilation, "_start", started)
    told = []
    compilation.compile_once(4, ["measure:gsi", "measure:fsi"], told.append)
    assert len(list(notes.iterdir())) == 2
    if line:
        assert told[-1] == "compiling, once on this machine: 2 of 2 parts, 2 kernels"
    else:
        assert told == []


def test_parts_on_codes_wait_for_the_search_that_makes_them(notes):
    crew = compilation._Crew(4, [kernel_warmup.SEARCH, "operator:mutation", "measure:gsi"], {})
    assert crew._next(from_front=False) == "measure:gsi"
    assert crew._next(from_front=False) == kernel_warmup.SEARCH
    waits = patch.object(crew._lock, "wait", side_effect=InterruptedError)
    with waits, pytest.raises(InterruptedError):
        crew._next(from_front=False)
    crew._notes[kernel_warmup.SEARCH] = notes / "search"
    crew._note_part(kernel_warmup.SEARCH)
    assert crew._next(from_front=False) == "operator:mutation"
    assert crew._next(from_front=True) is None


@pytest.mark.slow
def test_helpers_that_die_stop_nothing(notes, monkeypatch):
    started, count = compilation._start, []

    def first_ends(block):
        count.append(block)
        if len(count) % 2 == 0:
            return started(block)
        words = [sys.executable, "-c", "input()"]
        return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    monkeypatch.setattr(compilation, "_PROCESSES", 2)
    monkeypatch.setattr(compilation, "available_cores", lambda: 2)
    monkeypatch.setattr(compilation, "_start", first_ends)
    compilation.compile_once(4, [kernel_warmup.SEARCH, "operator:mutation"], lambda text: None)
    assert len(list(notes.iterdir())) == 1  # the search was begun by the one that ended
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    compilation.compile_once(4, [kernel_warmup.SEARCH], lambda text: None)
    with patch.object(accelerate, "cache_folder", lambda: None):
        compilation.compile_once(4, [kernel_warmup.SEARCH], lambda text: None)


def test_a_search_says_what_it_waits_for(toy, tmp_path):
    told = []
    with Search(read_recipe(toy(generations=0)), tmp_path / "run", 1, told.append) as search:
        list(search)
    assert told[-1] == "starting 1 worker"
    assert any(text.startswith("reading") for text in told)
    told.clear()
    Search.resume(tmp_path / "run", generations=1, workers=1, progress=told.append).close()
    assert told[-1] == "starting 1 worker"
    assert kernel_warmup.VARIABLE not in os.environ
