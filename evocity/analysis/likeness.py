"""Distances between births: by looks, by structure, by shifted looks, by scores, by stones."""

import math

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
#: losses of all goals, in units of their ranges; the share of cells with stones of other places;
#: structural similarity (SSIM) of the cells; the highest peak of their phase correlation.
WAYS = ("looks", "scores", "kin", "structure", "shift")
#: Ways that take longer for each pair.
SLOW = ("structure", "shift")
#: Births compared with each other, at most; and by a slow way.
MOST, MOST_SLOWLY = 3000, 500

# Births that are read at a time.
_AT_A_TIME = 64
# Looks are in decimetres.
_STOREY = np.uint16(round(STOREY * 10))
# The range of heights of structural similarity, and the side of its windows, cells.
_RANGE, _SIDE = 30.0, 7


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
        by = "looks" if by in SLOW else by
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
        most = MOST_SLOWLY if by in SLOW else MOST
        if len(ids) > most:
            raise EvocityError(
                f"{len(ids)} births are too many to compare each birth with all others by {by!r}",
                f"at most {most} births",
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
        """Losses in units of the ranges of the births that keep the constraints; cells in metres,
        ``(n, h, w)``, or their phases."""
        if by in SLOW:
            side = math.isqrt(points.shape[-1]) if len(points) else 1
            cells = points.reshape(-1, side, points.shape[-1] // side) / 10
            return cells if by == "structure" else phases(cells)
        if by != "scores" or not len(points):
            return points
        ok = self._births.ok & self._births.feasible
        return Scale(self._births.losses[ok if ok.any() else self._births.ok])(points)


def structure_distances(cells: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Compute (1 − SSIM) / 2 of heights ``cells`` (h, w) and of each of ``others`` (n, h, w), 0 for
    equal maps: Wang et al. 2004, IEEE TIP 13(4), with uniform windows of 7 × 7 cells."""
    from skimage.metrics import structural_similarity

    side = min(_SIDE, *cells.shape)
    side -= side % 2 == 0
    if side < 3:  # a map of two cells has no windows
        return (abs(others - cells) > STOREY).mean(axis=(1, 2))
    how = {"data_range": _RANGE, "win_size": side}
    return np.array([(1 - structural_similarity(cells, one, **how)) / 2 for one in others])


def phases(cells: np.ndarray) -> np.ndarray:
    """Compute the phases of the Fourier transforms of heights ``cells`` (n, s, s); those of level
    ground are 0."""
    transforms = np.fft.rfft2(cells - cells.mean(axis=(1, 2), keepdims=True))
    transforms[np.ptp(cells, axis=(1, 2)) == 0] = 0  # and no errors of rounding
    return transforms / np.maximum(abs(transforms), 1e-9)


def shift_distances(phase: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Compute one minus the highest peak of phase correlation, over all shifts, of `phases` and of
    each of ``others``, 0 for two maps of level ground: Kuglin & Hines 1975."""
    side = phase.shape[-2]  # the columns have the positive frequencies only
    peaks = np.fft.irfft2(others * phase.conj(), (side, side)).max(axis=(1, 2))
    both_level = ~(others.any(axis=(1, 2)) | phase.any())
    return np.where(both_level, 0.0, np.clip(1 - peaks, 0, 1))


def _distances(point: np.ndarray, others: np.ndarray, by: str) -> np.ndarray:
    if by == "structure":
        return structure_distances(point, others)
    if by == "shift":
        return shift_distances(point, others)
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
