"""Logs of births that nobody bred."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from codes import uniformly

from evocity.citymap import CityMap
from evocity.store import Birth, Header, Member, RunWriter, Source


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
