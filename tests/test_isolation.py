"""No test finds what another left behind: tests pass in any order, in any number of processes."""

import pytest

import evocity
from evocity.fitness import registry

OWN = {measure.name for measure in registry.measures() if measure.origin == "evocity"}


@pytest.mark.parametrize("time", ["first", "second"])
def test_a_measure_is_forgotten_after_its_test(time, tmp_path):
    assert {measure.name for measure in registry.measures()} == OWN

    @evocity.fitness(goal="max")
    def left_behind(city):
        return 0.0

    (tmp_path / "own.py").write_text(
        "import evocity\n@evocity.fitness()\ndef loaded(city):\n    return 0.0\n"
    )
    registry.load_file(tmp_path / "own.py")
    assert {measure.name for measure in registry.measures()} == OWN | {"left_behind", "loaded"}
