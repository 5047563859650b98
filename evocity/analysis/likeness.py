"""Distances between births: by looks, by scores, by stones."""

import numpy as np

from evocity.analysis.births import NEVER_BRED, Births
from evocity.analysis.individual import fabric_of
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError, check_word
from evocity.genome import Genome
from evocity.genome.nucleotides import packed, unpacked
from evocity.selection.fronts import Scale
from evocity.selection.thumbprints import SIDE, STOREY, look_of

#: Ways to compare births: the share of the map's cells that differ by more than a storey; the
#: losses of all goals, in units of their ranges; the share of cells with stones of other places.
WAYS = ("looks", "scores", "kin")
#: Births compared with each other, at most.
MOST = 3000

# Births that are read at a time.
_AT_A_TIME = 64
# Looks are in decimetres.
_STOREY = np.uint16(round(STOREY * 10))


class Likeness:
    """Distances between the ``births`` of a run; keeps the maps that it decodes."""

    def __init__(self, births: Births):
        self._births = births
        self._kept: dict[str, dict[int, np.ndarray]] = {"looks": {}, "kin": {}}

    def note(self, identifier: int, city: CityMap) -> None:
        """Keep the map of a birth that is decoded already."""
        self._kept["looks"][identifier] = look_of(city)

    def points(self, ids: np.ndarray, by: str) -> np.ndarray:
        """Return the values by which births ``ids`` are compared, a row each."""
        check_word("by", by, WAYS)
        if by == "scores":
            rows = self._births.rows(ids)
            if not self._births.ok[rows].all():
                raise self._lacks(ids[~self._births.ok[rows]][0], "it was not measured")
            return self._births.losses[rows]
        kept = self._kept[by]
        missing = [one for one in dict.fromkeys(ids.tolist()) if one not in kept]
        self._births.rows(missing)
        for start in range(0, len(missing), _AT_A_TIME):
            some = missing[start : start + _AT_A_TIME]
            for birth in self._births.run.individuals(some, stones=by == "kin"):
                kept[birth.id] = self._look(birth) if by == "looks" else self._places(birth)
        return np.array([kept[one] for one in ids.tolist()])

    def _look(self, birth) -> np.ndarray:
        expressed = self._births.expressed(birth)
        if expressed.city is None:
            raise self._lacks(birth.id, expressed.problem)
        return look_of(expressed.city)

    def _places(self, birth) -> np.ndarray:
        if birth.genome is None:
            raise self._lacks(birth.id, NEVER_BRED)
        return _stones(fabric_of(self._births.run.header, birth.genome, "the search for kin"))

    def _lacks(self, identifier: int, why: str) -> RunError:
        return RunError(
            f"{self._births.run.path}: individual {identifier} cannot be compared: {why}",
            "births that have the status 'ok'",
            "leave this individual out of the comparison",
        )

    def matrix(self, ids: np.ndarray, by: str) -> np.ndarray:
        """Return all distances between the births ``ids``, float64 ``(n, n)``; at most `MOST`."""
        if len(ids) > MOST:
            raise EvocityError(
                f"{len(ids)} births are too many to compare each birth with all others",
                f"at most {MOST} births",
                'choose fewer births, for example of=run.archive.ids or of=run.where("alive")',
            )
        points = self._scaled(self.points(ids, by), by)
        distances = np.zeros((len(points), len(points)))
        for row in range(len(points) - 1):
            distances[row, row + 1 :] = _distances(points[row], points[row + 1 :], by)
        return distances + distances.T

    def from_one(self, one: int, ids: np.ndarray, by: str) -> np.ndarray:
        """Return the distances of the births ``ids`` from ``one``, float64 ``(n,)``."""
        points = self._scaled(self.points(np.append(ids, one), by), by)
        return _distances(points[-1], points[:-1], by)

    def _scaled(self, points: np.ndarray, by: str) -> np.ndarray:
        """Losses in units of the ranges of the births that keep the constraints."""
        if by != "scores" or not len(points):
            return points
        ok = self._births.ok & self._births.feasible
        return Scale(self._births.losses[ok if ok.any() else self._births.ok])(points)


def _distances(point: np.ndarray, others: np.ndarray, by: str) -> np.ndarray:
    if by == "scores":
        return np.sqrt(np.square(others - point).mean(axis=1))
    if by == "kin":
        differ = others != point
    else:  # of unsigned numbers
        differ = np.maximum(others, point) - np.minimum(others, point) > _STOREY
    return np.count_nonzero(differ, axis=1) / max(1, point.size)


def _stones(genome: Genome) -> np.ndarray:
    """The source of each cell, at most `SIDE` along each axis, int64: city, turn and pixel."""
    pavement = genome.pavement
    down, right = (slice(None, None, -(-n // SIDE)) for n in (pavement.height, pavement.width))
    block = pavement.index[down, right]
    rows, columns = np.mgrid[: pavement.height, : pavement.width][:, down, right]
    top, left = (corner[block] for corner in pavement.corners)
    row, column = (place[block] for place in unpacked(genome.source))
    place = packed(row + rows - top, column + columns - left).astype(np.int64)
    kind = genome.parent.astype(np.int64) * 8 + genome.turn
    return ((kind[block] << 32) | place).ravel()
