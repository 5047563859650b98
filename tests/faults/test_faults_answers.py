"""Messages from workers: every outcome arrives as it was, and other bytes are refused."""

import os
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from codes import uniformly

from evocity.condensation import Condensation
from evocity.evaluation.answers import (
    Answer,
    Checked,
    Ready,
    read_answer,
    write_answer,
    write_checked,
    write_ready,
)
from evocity.evaluation.array_frames import write_message
from evocity.evaluation.canary import _make_fabric, _make_genome
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.frames import LENGTH
from evocity.kinds import KINDS

MADE = {"operator": "x", "nested": [1, {"é": None}], "bits": 0.1, "endless": float("inf")}


def received(framed: bytes):
    (length,) = LENGTH.unpack_from(framed)
    assert length == len(framed) - LENGTH.size
    return read_answer(framed[LENGTH.size :])


@pytest.fixture(scope="session")
def fabric(town):
    return uniformly(town).genome


def genomes(fabric):
    height, width = fabric.pavement.height, fabric.pavement.width
    kept = np.zeros((height, width), bool)
    kept[3:9, 5:11] = True
    locked = Condensation(np.full((height, width), 7.25), kept)
    yield fabric.replace(condensation=locked, origin=(1.5, 2), crs="EPSG:2154", made=MADE)
    for sides in (4, (2, 16), 16):
        for kind in KINDS.values():
            yield _make_genome(kind, _make_fabric(sides)).replace(made=MADE)


def outcome_with(genome) -> Outcome:
    look = np.arange(9, dtype=np.uint16)
    values = {"a": -0.0, "b": 5e-324, "c": 0.1, "ü": float("inf")}
    return Outcome("ok", "a text\ud800", 0.25, values, genome, look, b"\x00\xff")


def test_outcomes_arrive_bit_for_bit(fabric):
    for genome in genomes(fabric):
        sent = outcome_with(genome)
        message = received(write_answer(Answer(7, sent, True, "digest")))
        assert (message.number, message.leaves, message.canary) == (7, True, "digest")
        outcome = message.outcome
        assert outcome == sent
        assert list(map(repr, outcome.values.values())) == list(map(repr, sent.values.values()))
        assert (outcome.look.tobytes(), outcome.thumbnail) == (sent.look.tobytes(), b"\x00\xff")
        assert type(outcome.genome) is type(genome)
        assert outcome.genome.digest == genome.digest
        assert dict(outcome.genome.made) == MADE
        for name in ("origin", "crs", "attribution", "metres_per_pixel"):
            assert getattr(outcome.genome, name) == getattr(genome, name)
    empty = received(write_answer(Answer(0, Outcome("died"), False, ""))).outcome
    assert empty == Outcome("died")
    assert received(write_ready(Ready(5, "x", 0.5))) == Ready(5, "x", 0.5)
    assert received(write_checked(Checked("x"))) == Checked("x")


class Executed:
    def __reduce__(self):
        return os.mkdir, ("executed",)


def test_bytes_of_another_layout_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    good = {"number": 1, "leaves": False, "canary": "", "status": "ok", "error": None}
    good |= {"what": "answer", "seconds": 0.5, "values": {"a": 1.0}}
    arrays = [np.zeros(3, np.int16)]
    read_answer(write_message(good, arrays))
    others = [
        pickle.dumps(Executed()),
        b"",
        b"EVO1",
        write_message(good, arrays)[:-1],
        write_message(good, arrays) + b"\x00",
        b"EVO1" + (1 << 60).to_bytes(8, "little") + b"{}",
        b"EVO1" + (10**5).to_bytes(8, "little") + b"[" * 10**5,
        write_message(good, [np.zeros(3, "O")]) if False else b"[]",
    ]
    faults = [
        {"what": "other"},
        {"number": True},
        {"number": 1.0},
        {"leaves": 0},
        {"status": "fine"},
        {"error": 5},
        {"values": [1.0]},
        {"values": {"a": "1"}},
        {"values": {"a": True}},
        {"seconds": None},
        {"look": 7},
        {"look": -1},
        {"look": 0},  # not of whole numbers without a sign
        {"thumbnail": "0"},
        {"genome": None},
        {"genome": {"kind": "fabric"}},
        {"genome": {"kind": "castle"}},
    ]
    others += [write_message(good | fault, arrays) for fault in faults]
    for message in others:
        with pytest.raises(ValueError):
            read_answer(message)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "count", [60, pytest.param(3000, marks=pytest.mark.long)], ids=["few", "many"]
)
def test_changed_bytes_give_a_refusal_or_an_outcome(fabric, count):
    draws = np.random.default_rng(1)
    messages = [
        write_answer(Answer(1, outcome_with(genome), False, ""))[LENGTH.size :]
        for genome in genomes(fabric)
    ]
    refused = 0
    for number in range(count):
        message = bytearray(messages[number % len(messages)])
        start = int.from_bytes(message[4:12], "little") + 12
        most = start if number % 3 else len(message)  # mostly in the document
        for at in draws.integers(0, most, 1 + number % 4):
            message[at] = draws.integers(256)
        try:
            answer = read_answer(message)
        except ValueError:
            refused += 1
        else:
            assert isinstance(answer, Answer)
    assert refused > count / 3


def test_a_genome_of_other_types_is_an_error_of_its_birth(fabric):
    strange = Outcome("ok", genome=SimpleNamespace(digest="x"))
    with pytest.raises((TypeError, AttributeError)):
        write_answer(Answer(1, strange, False, ""))
