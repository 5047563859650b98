"""How far births are from each other: by how they look, by their scores, by their stones."""

import numpy as np

from evocity.analysis.births import NEVER_BRED, Told
from evocity.analysis.fabrics import fabric_of
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError, check_word
from evocity.genome import Genome
from evocity.genome.nucleotides import packed, unpacked
from evocity.search.fronts import Scale
from evocity.search.looks import SIDE, STOREY, look_of

#: What births are compared by: the share of the map's cells that differ by more than a storey; the
#: losses of all goals, in units of their ranges; the share whose stones are of different places.
WAYS = ("looks", "scores", "kin")
#: So many are compared with each other, at most.
MOST = 3000

# Births that are read at a time.
_AT_A_TIME = 64
# Looks are in decimetres.
_STOREY = np.uint16(round(STOREY * 10))


class Likeness:
    """How far the births that are ``told`` are from each other; what was decoded is kept."""

    def __init__(self, told: Told):
        self._told = told
        self._kept: dict[str, dict[int, np.ndarray]] = {"looks": {}, "kin": {}}

    def note(self, identifier: int, city: CityMap) -> None:
        """What a birth decodes to is known: it is not decoded again."""
        self._kept["looks"][identifier] = look_of(city)

    def points(self, ids: np.ndarray, by: str) -> np.ndarray:
        """What the births ``ids`` are compared by, a row each. Raises `EvocityError` for no way of
        `WAYS`, `RunError` for a birth without a map, or without scores."""
        check_word("by", by, WAYS)
        if by == "scores":
            rows = self._told.rows(ids)
            if not self._told.ok[rows].all():
                raise self._lacks(ids[~self._told.ok[rows]][0], "it was not measured")
            return self._told.losses[rows]
        kept = self._kept[by]
        missing = [one for one in dict.fromkeys(ids.tolist()) if one not in kept]
        self._told.rows(missing)
        for start in range(0, len(missing), _AT_A_TIME):
            some = missing[start : start + _AT_A_TIME]
            for birth in self._told.run.individuals(some, stones=by == "kin"):
                kept[birth.id] = self._look(birth) if by == "looks" else self._places(birth)
        return np.array([kept[one] for one in ids.tolist()])

    def _look(self, birth) -> np.ndarray:
        expressed = self._told.expressed(birth)
        if expressed.city is None:
            raise self._lacks(birth.id, expressed.problem)
        return look_of(expressed.city)

    def _places(self, birth) -> np.ndarray:
        if birth.genome is None:
            raise self._lacks(birth.id, NEVER_BRED)
        return _stones(fabric_of(self._told.run.header, birth.genome, "the kin"))

    def _lacks(self, identifier: int, why: str) -> RunError:
        return RunError(
            f"{self._told.run.path}: individual {identifier} is compared with others, but {why}",
            "births with status ok",
            "leave it out of those that are compared",
        )

    def matrix(self, ids: np.ndarray, by: str) -> np.ndarray:
        """Float64 ``(n, n)``: of all births ``ids`` from each other. Raises as `points`, and for
        more than `MOST`."""
        if len(ids) > MOST:
            raise EvocityError(
                f"{len(ids)} births, each compared with all others",
                f"at most {MOST}",
                'choose some: of=run.archive.ids, or of=run.where("alive")',
            )
        points = self._scaled(self.points(ids, by), by)
        found = np.zeros((len(points), len(points)))
        for row in range(len(points) - 1):
            found[row, row + 1 :] = _apart(points[row], points[row + 1 :], by)
        return found + found.T

    def from_one(self, one: int, ids: np.ndarray, by: str) -> np.ndarray:
        """Float64 ``(n,)``: how far the births ``ids`` are from ``one``."""
        points = self._scaled(self.points(np.append(ids, one), by), by)
        return _apart(points[-1], points[:-1], by)

    def _scaled(self, points: np.ndarray, by: str) -> np.ndarray:
        """Losses in units of the ranges of those that keep the constraints, or of all that were
        measured where nobody does."""
        if by != "scores" or not len(points):
            return points
        ok = self._told.ok & self._told.feasible
        return Scale(self._told.losses[ok if ok.any() else self._told.ok])(points)


def _apart(point: np.ndarray, others: np.ndarray, by: str) -> np.ndarray:
    if by == "scores":
        return np.sqrt(np.square(others - point).mean(axis=1))
    if by == "kin":
        differ = others != point
    else:  # of unsigned numbers
        differ = np.maximum(others, point) - np.minimum(others, point) > _STOREY
    return np.count_nonzero(differ, axis=1) / max(1, point.size)


def _stones(genome: Genome) -> np.ndarray:
    """Which stone lies in each cell, at most `SIDE` along each axis, int64: its city, how it is
    turned, and the pixel of that city from which its north-west corner is as far."""
    pavement = genome.pavement
    down, right = (slice(None, None, -(-n // SIDE)) for n in (pavement.height, pavement.width))
    block = pavement.index[down, right]
    rows, columns = np.mgrid[: pavement.height, : pavement.width][:, down, right]
    top, left = (corner[block] for corner in pavement.corners)
    row, column = (place[block] for place in unpacked(genome.source))
    place = packed(row + rows - top, column + columns - left).astype(np.int64)
    kind = genome.parent.astype(np.int64) * 8 + genome.turn
    return ((kind[block] << 32) | place).ravel()


__all__ = ["MOST", "WAYS", "Likeness"]
