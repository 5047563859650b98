"""Logs of births that nobody bred."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from codes import uniformly

import evocity
from evocity.analysis import Run
from evocity.citymap import CityMap
from evocity.store import Birth, Header, Member, RunWriter, Source

CITY = CityMap([[0.0, 8.0] * 4] * 8, 2.0, name="left", attribution="© left")


def written(
    folder: Path,
    generations: Sequence[Sequence[Mapping]],
    members: Sequence[Sequence[int]] | None = None,
    wanted: Sequence[Mapping] = ({"name": "gsi", "goal": "min"},),
) -> Run:
    """A log of births that nobody bred, as its ``generations`` tell each: `Birth`'s own fields;
    ``members`` are the ids of those who lived in each. Unless told, all that are ok live to the
    end."""
    names = tuple(one["name"] for one in wanted)
    header = Header(8, 8, 2.0, 0.9, ("left",), "© left", None, None, 7, 4, "hash", names)
    code = header.chromosome.adopt(uniformly(CITY).genome, header, None)
    about = {"fitness": list(wanted)}
    writer = RunWriter.create(folder, "[run]\n", about, header, [Source(CITY, code)])
    usual = {"parents": (), "operator": "mutation", "status": "ok", "error": None, "seconds": 0.5}
    usual |= {"genome": code, "values": dict.fromkeys(names, 1.0)}
    ever: list[int] = []
    for number, births in enumerate(generations):
        rows = [Birth(**{"generation": number} | usual | dict(one)) for one in births]
        ever += [one.id for one in rows if one.status == "ok"]
        lived = ever if members is None else members[number]
        alive = [Member(slot, one, 0, {"crowding": 0.0}) for slot, one in enumerate(lived)]
        writer.write_generation(number, rows, alive, {"births": 0, "failures": 0})
    writer.close()
    return evocity.open_run(folder)
