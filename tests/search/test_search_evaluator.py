"""What a worker says of what a measure does."""

from types import SimpleNamespace

import numpy as np
import pytest
from codes import uniformly

from evocity import fitness
from evocity.evaluation.evaluator import MOST_LETTERS, Evaluator, Setup
from evocity.kinds import KINDS

MEASURE = """
import evocity

@evocity.fitness(goal="max")
def moody(city):
    {body}
"""


@pytest.fixture
def evaluator(tmp_path):
    def make(body: str) -> Evaluator:
        path = tmp_path / "moody.py"
        path.write_text(MEASURE.format(body=body))
        fitness.load_file(path)
        header = SimpleNamespace(chromosome=KINDS["fabric"], measures=("moody",), recorded=())
        return Evaluator(Setup(header, (("moody", str(path)),)))

    return make


def test_an_error_of_many_lines_is_told_in_one(evaluator, town):
    outcome = evaluator('raise ValueError("first\\n   second\\r\\nthird")').evaluate(
        uniformly(town).genome
    )
    assert outcome.status == "error"
    assert "first second third" in outcome.error
    assert len(outcome.error.splitlines()) == 1


def test_an_error_that_cannot_be_written_down_or_never_ends(evaluator, town):
    body = 'raise ValueError(chr(0xD800) + "x" * 10_000)'
    told = evaluator(body).evaluate(uniformly(town).genome).error
    assert told.encode()
    assert len(told) == MOST_LETTERS


def test_nan_is_invalid_and_not_an_error(evaluator, town):
    assert evaluator("return float('nan')").evaluate(uniformly(town).genome).status == "invalid"


def test_the_users_own_interrupt_is_no_failed_birth(evaluator, town):
    interrupted = evaluator("raise KeyboardInterrupt")
    genome = uniformly(town).genome
    with pytest.raises(KeyboardInterrupt):
        interrupted.evaluate(genome)

    def operator(parents, rng):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted.breed(operator, [genome], np.random.default_rng(0))
