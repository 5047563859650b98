"""A run of four small generations, for tests that damage it."""

import math
import shutil

import numpy as np
import pytest
from codes import uniformly

from evocity.citymap import CityMap
from evocity.store import Birth, Header, Member, RunWriter, Source


@pytest.fixture
def whole_run(written_once, tmp_path):
    """Path of a closed run: generations 0…8 of two births each, one source city."""
    return shutil.copytree(written_once, tmp_path / "kept" / "run")


@pytest.fixture(scope="session")
def written_once(tmp_path_factory):
    city = CityMap(np.kron(np.eye(4), np.full((4, 4), 6.0)), 2.0, name="town")
    genome = uniformly(city, block=4).genome
    header = Header(16, 16, 2.0, 0.9, ("town",), "", None, None, 7, 2, "hash", ("gsi",))
    path = tmp_path_factory.mktemp("kept") / "run"
    writer = RunWriter.create(
        path, "[run]\n", {}, header, [Source(city, genome)], references=[city]
    )
    writer.event("start")
    for number in range(9):
        births = [
            Birth(number, 2 * number + s, (), "source", "ok", None, 0.1, {"gsi": 0.5}, genome)
            for s in (0, 1)
        ]
        members = [Member(s, one.id, 0, {"crowding": math.inf}) for s, one in enumerate(births)]
        best = {"gsi": 0.5}
        told = {"births": 2 * number + 2, "failures": 0, "hypervolume": 1.0, "best": best}
        writer.write_generation(number, births, members, told)
    writer.close()
    return path
