"""Two small runs of the toy towns, made once: one that was resumed with islands, one plain."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from unittest.mock import patch

import pytest
from codes import uniformly
from toy_runs import forgotten, write_toy

import evocity
from evocity.analysis import Run
from evocity.citymap import CityMap
from evocity.fitness import registry
from evocity.store import Birth, Header, Member, RunWriter, Source

__all__ = ["forgotten"]

WANTED = """
[[fitness]]
name = "alignment"
[[fitness]]
name = "crumbs"
goal = "min"
max = 500
"""

ISLANDS = """
[[islands]]
name = "towers"
measures = ["spread", "roof"]
[[islands]]
name = "crowd"
measures = ["alignment"]
[migration]
every = 1
migrants = 2
"""


def bred(folder: Path, recipe: str, generations: Sequence[int], **run: str) -> Path:
    """A run that was stopped and resumed after each of these ``generations`` but the last; ``run``:
    more keys of ``[run]``."""
    path = write_toy(folder, recipe=recipe, generations=generations[0], workers=0)
    more = "".join(f"\n{key} = {value}" for key, value in run.items())
    path.write_text(path.read_text().replace("seed = 3", "seed = 3" + more))
    with patch.dict(registry._from_files):
        with evocity.Search(evocity.read_recipe(path), out=folder / "run") as search:
            list(search)
        for more in generations[1:]:
            with evocity.Search.resume(folder / "run", generations=more) as search:
                list(search)
    return folder / "run"


@pytest.fixture(scope="session")
def night(tmp_path_factory) -> Path:
    """Three goals and a constraint, fsi and gsi recorded besides."""
    return bred(tmp_path_factory.mktemp("night"), WANTED, (3,), record='["fsi", "gsi"]')


@pytest.fixture(scope="session")
def archipelago(tmp_path_factory) -> Path:
    """Two islands, resumed after the second generation."""
    return bred(tmp_path_factory.mktemp("islands"), WANTED + ISLANDS, (2, 4))


@pytest.fixture
def run(night) -> Run:
    return evocity.open_run(night)


def written(
    folder: Path,
    generations: Sequence[Sequence[Mapping]],
    members: Sequence[Sequence[int]],
    wanted: Sequence[Mapping] = ({"name": "gsi", "goal": "min"},),
) -> Path:
    """A log of births that nobody bred, as its ``generations`` tell each: `Birth`'s own fields;
    ``members`` are the ids of those who lived in each."""
    city = CityMap([[0.0, 8.0] * 4] * 8, 2.0, name="left")
    names = tuple(one["name"] for one in wanted)
    header = Header(8, 8, 2.0, 0.9, ("left",), "", None, None, 7, 4, "hash", names)
    code = header.chromosome.adopt(uniformly(city).genome, header, None)
    about = {"fitness": list(wanted)}
    writer = RunWriter.create(folder, "[run]\n", about, header, [Source(city, code)])
    usual = {"parents": (), "operator": "mutation", "status": "ok", "error": None, "seconds": 0.5}
    usual |= {"genome": code, "values": dict.fromkeys(names, 1.0)}
    for number, (births, lived) in enumerate(zip(generations, members, strict=True)):
        rows = [Birth(**{"generation": number} | usual | dict(one)) for one in births]
        alive = [Member(slot, one, 0, {"crowding": 0.0}) for slot, one in enumerate(lived)]
        writer.write_generation(number, rows, alive, {"births": 0, "failures": 0})
    writer.close()
    return folder
