"""The shortlist: a few births worth keeping, and why: the compromise, the best by each goal, and
one of each kind of look."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.clusters import label_clusters, medoids
from evocity.analysis.individual import Individual, describe_scarce, share_text
from evocity.analysis.likeness import Likeness
from evocity.errors import EvocityError, is_number, near_miss, spell
from evocity.genome import VOID
from evocity.html_display import Displayed
from evocity.lazy_imports import library
from evocity.selection.fronts import Scale

if TYPE_CHECKING:
    import pandas as pd

#: Births of the archive compared by looks, at most: evenly of all times.
MOST_COMPARED = 320
#: The largest share of what is built that counts as no trace of a source city.
TRACE = 0.01
#: The largest share of the map in which two births differ that look alike.
APART = 0.05


@dataclass(frozen=True)
class ShortlistEntry:
    """A birth worth keeping. ``role``: "compromise", "best NAME" or "of another kind"; ``gave_up``:
    the goal in which it is farthest from the best."""

    individual: Individual
    role: str
    why: str
    gave_up: str

    @cached_property
    def built(self) -> dict[str, float]:
        """Source city -> share of what is built, the largest first."""
        if not self.individual.run.header.chromosome.ancestry_columns:
            return {}
        shares = self.individual.ancestry(built=True)
        return dict(sorted(shares.items(), key=lambda one: -one[1]))

    @property
    def stones(self) -> str:
        """`built` in a sentence; empty where `built` is empty, and for a single source city."""
        if sum(city != VOID for city in self.individual.run.header.cities) < 2:
            return ""
        shares = ", ".join(f"{city} {share_text(share)}" for city, share in self.built.items())
        return f"Its buildings come from {shares}." if shares else ""

    @property
    def scarce(self) -> str:
        """The source cities that have under 10 % of the buildings, in a sentence; empty if all have
        more, and for the code of a parent."""
        if not self.built or self.individual.operator == "source":
            return ""
        sources = self.individual.births.sources
        return describe_scarce(self.built, [one.name for one in sources if one.city.built.any()])

    @property
    def reasons(self) -> list[str]:
        return [text for text in (self.why, self.gave_up, self.stones, self.scarce) if text]

    def __str__(self) -> str:
        return f"{self.individual.id}, {self.role}. {' '.join(self.reasons)}"


class Shortlist(list[ShortlistEntry], Displayed):
    """A few births worth keeping; ``str()`` describes each in a line, and what they lack."""

    def __str__(self) -> str:
        return "\n".join([*map(str, self), *filter(None, [self.lacking])])

    @cached_property
    def untraced(self) -> list[str]:
        """The source cities without a trace in the buildings of all entries."""
        built = [one.built for one in self]
        if not any(built):
            return []
        cities = [one.name for one in self[0].individual.births.sources if one.city.built.any()]
        return [city for city in cities if all(one.get(city, 0.0) <= TRACE for one in built)]

    @property
    def lacking(self) -> str:
        """`untraced` in a sentence; empty where every source city has a trace."""
        if not self.untraced:
            return ""
        cities = " or ".join(self.untraced)
        return f"None of these has more than {100 * TRACE:.0f} % of its buildings from {cities}."

    @property
    def frame(self) -> "pd.DataFrame":
        """A row each, index ``id``: role, why, gave_up, and the measures."""
        pandas = library("pandas", "a table of births")
        rows = [
            {"role": one.role, "why": one.why, "gave_up": one.gave_up} | one.individual.scores
            for one in self
        ]
        return pandas.DataFrame(rows, pandas.Index([k.individual.id for k in self], name="id"))


def choose_shortlist(
    births: Births,
    ids: np.ndarray,
    likeness: Likeness,
    count: int,
    where: str | None = None,
    apart: float = APART,
) -> Shortlist:
    """Choose ``count`` of the births ``ids``, which are ``where``, or as many as differ: the best
    compromise, the best by each goal, then medoids of the largest groups of others. The best by a
    goal that looks like a birth chosen before comes last, and its place goes to another look.

    Without ``where``, the births are the archive. With a single goal, or early in a run, the
    archive is small: the living that keep the constraints then stand beside it.
    """
    if where is None:
        where = "in the archive"
        if len(ids) < count:
            ids = np.union1d(ids, births.ids[births.alive & births.feasible])
            where += " or alive"
    choice = _Choice(births, ids, where)
    choice.take(best_compromise(choice.losses, np.ones(len(births.goals))), "compromise")
    alike = []  # rows of the best by a goal, with the chosen row that each looks like
    for column, goal in enumerate(births.goals):
        if len(choice.roles) < count and choice.differ(column):
            row = choice.best(column)
            like = _find_alike(choice, likeness, row, apart)
            if like is None:
                choice.take(row, f"best {goal}")
            else:
                alike.append((row, column, like))
    most = min(count, len(ids))
    kinds = _kinds(choice, likeness, count, apart) if len(choice.roles) < most else ()
    for row, why in kinds:
        choice.take(row, "of another kind", why)
        if len(choice.roles) == most:  # the iterator has more
            break
    for row, column, like in alike:
        if row in choice.roles or len(choice.roles) < most:
            choice.take(row, f"best {births.goals[column]}")
        else:
            choice.alike.setdefault(like, {}).setdefault(row, []).append(column)
    return Shortlist(choice.entry(row) for row in choice.roles)


def _find_alike(choice: "_Choice", likeness: Likeness, row: int, apart: float) -> int | None:
    """The row of the entry that looks like another ``row``; None if none does."""
    if row in choice.roles:
        return None
    own = np.fromiter(choice.roles, np.intp)
    far = likeness.from_one(int(choice.ids[row]), choice.ids[own], "looks")
    return int(own[far.argmin()]) if far.min() <= apart else None


def _kinds(
    choice: "_Choice", likeness: Likeness, count: int, apart: float
) -> Iterator[tuple[int, str]]:
    """Rows of births of other kinds, with a reason: medoids of the largest groups, then the
    farthest."""
    own = np.fromiter(choice.roles, np.intp)
    rest = np.setdiff1d(np.arange(len(choice.ids)), own)
    room = min(max(0, MOST_COMPARED - len(own)), len(rest))
    rest = rest[np.linspace(0, len(rest) - 1, room).round().astype(np.intp)]
    rows = np.concatenate([own, rest])
    whole = len(rows) == len(choice.ids)
    where = f"of the {len(rows)} " + (choice.where if whole else "that were compared")
    matrix = likeness.matrix(choice.ids[rows], "looks")
    middle = medoids(matrix, min(count, len(rows)))
    labels = label_clusters(matrix, middle)
    sizes = np.bincount(labels, minlength=len(middle))
    taken = set(labels[: len(own)].tolist())

    def near() -> np.ndarray:
        """The distance of each from the nearest entry; an entry's own is -1."""
        chosen = np.isin(rows, list(choice.roles))
        return np.where(chosen, -1, matrix[:, chosen].min(axis=1))

    for group in np.argsort(-sizes, kind="stable").tolist():
        if group not in taken and near()[middle[group]] > apart:
            yield int(rows[middle[group]]), _stands_for(int(sizes[group]) - 1, where)
    while (far := near()).max() > apart:
        row = int(far.argmax())
        yield (
            int(rows[row]),
            f"It differs in {100 * far[row]:.0f} % of the map from all named before.",
        )


def _stands_for(others: int, where: str) -> str:
    """A sentence about the ``others`` of a group."""
    if not others:
        return f"It looks like no other {where}."
    many = f"{others} others {where} that look" if others > 1 else f"1 other {where} that looks"
    return f"It stands for {many} most like it."


class _Choice:
    """The entries so far, of the births ``ids``: row -> roles and reason. ``alike``: row of an
    entry -> rows that look like it -> columns of the goals in which these are the best."""

    def __init__(self, births: Births, ids: np.ndarray, where: str):
        self.births, self.ids, self.where = births, ids, where
        self.losses = births.losses[births.rows(ids)]
        self.scaled = Scale(self.losses)(self.losses)
        self.roles: dict[int, tuple[list[str], str]] = {}
        self.alike: dict[int, dict[int, list[int]]] = {}
        self._aims = {aim.name: aim for aim in births.aims}

    def differ(self, column: int) -> bool:
        """Whether some births are better than others by one goal."""
        return bool(self.scaled[:, column].any())

    def best(self, column: int) -> int:
        """The row that is best by one goal; of equal ones the best by the sum of all."""
        return int(np.lexsort((self.scaled.sum(axis=1), self.losses[:, column]))[0])

    def take(self, row: int, role: str, why: str = "") -> None:
        """Add a ``row`` in a ``role``, or a role to an entry."""
        self.roles.setdefault(row, ([], why))[0].append(role)

    def value(self, row: int, column: int) -> str:
        goal = self.births.goals[column]
        if goal in self._aims and self._aims[goal].total is None:
            value = self.births.value(goal)[self.births.rows(self.ids[row : row + 1])][0]
            return f"{value:.4g} {self._aims[goal].unit}".rstrip()
        return f"a loss of {self.losses[row, column]:.4g}"

    def entry(self, row: int) -> ShortlistEntry:
        roles, why = self.roles[row]
        one = Individual(self.births, int(self.ids[row]))
        goals, sentences = self.births.goals, []
        if "compromise" in roles:
            worst = int(self.scaled[row].argmax())
            behind = self.scaled[row, worst]
            sentences.append(
                f"It is nearest to the best of all goals at once, of the {len(self.ids)} "
                f"{self.where}. It is farthest from the best in {goals[worst]}, "
                f"by {100 * behind:.0f} % of the range."
                if behind > 0
                else f"It is the best in every goal, of the {len(self.ids)} {self.where}."
                if len(self.ids) > 1
                else f"It is the only one {self.where}."
            )
        best = [goal for goal in goals if f"best {goal}" in roles]
        if best and self.scaled[row].any():  # else it is the best in all
            values = ", ".join(self._best_value(row, goals.index(goal)) for goal in best)
            sentences.append(f"None of the {len(self.ids)} {self.where} is better by {values}.")
        sentences += [why] if why else []
        for other, columns in self.alike.get(row, {}).items():
            values = ", ".join(self._best_value(other, column) for column in columns)
            sentences.append(f"Birth {self.ids[other]} looks like it, and is the best by {values}.")
        if one.operator == "source":
            parent = self.births.run.header.cities[one.id]
            sentences.append(f"It is the code of the parent {parent}, not a child.")
        else:
            sentences += self._compared_with_parents(row)
        if not one.alive:
            sentences.append("It is no longer alive.")
        return ShortlistEntry(one, ", ".join(roles), " ".join(sentences), self._gave_up(row))

    def _best_value(self, row: int, column: int) -> str:
        """A goal in which no birth is better, the value, and how many births have the same."""
        others = int((self.losses[:, column] == self.losses[row, column]).sum()) - 1
        alike = f", as {others} {'others have' if others > 1 else 'other has'}" if others else ""
        return f"{self.births.goals[column]} ({self.value(row, column)}{alike})"

    def _compared_with_parents(self, row: int) -> list[str]:
        """The goals in which it beats every parent's code, and those in which one beats it."""
        of_parents = self.births.losses[self.births.rows(self.births.founders)]
        if not len(of_parents):
            return []
        best = of_parents.min(axis=0)
        goals, own = np.array(self.births.goals, object), self.losses[row]
        better, worse = ", ".join(goals[own < best]), ", ".join(goals[own > best])
        first = f"No parent is as good in {better}" if better else "It beats all parents in no goal"
        return [f"{first}; a parent is better in {worse}." if worse else f"{first}."]

    def _gave_up(self, row: int) -> str:
        worst = int(self.scaled[row].argmax())
        if self.scaled[row, worst] <= 0:
            return "It gave up nothing."
        goal, best = self.births.goals[worst], self.best(worst)
        aim = self._aims.get(goal)
        target = None if aim is None or aim.total is not None else aim.target
        meant = "" if target is None else f"for a target of {target:.4g}, "
        return (
            f"It gave up {goal}: {self.value(row, worst)}; {meant}the best has "
            f"{self.value(best, worst)}."
        )


def achievement(losses: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the achievement of ``(n, goals)`` losses, float64 ``(n,)``, lower is better: the
    largest distance above the best of each goal, in units of their ranges, times ``weights``."""
    return (np.asarray(weights) * Scale(losses)(losses)).max(axis=1)


def best_compromise(losses: np.ndarray, weights: np.ndarray) -> int:
    """Return the row of ``(n, goals)`` losses with the least `achievement`."""
    together = (np.asarray(weights) * Scale(losses)(losses)).sum(axis=1)
    return int(np.lexsort((np.arange(len(losses)), together, achievement(losses, weights)))[0])


def rank_compromises(births: Births, archive: np.ndarray) -> np.ndarray:
    """Return the rank of each birth as a compromise, float32 ``(n,)``: 1 for the best compromise of
    the ``archive``, by `achievement` in the ranges of the archive. NaN for a birth that breaks a
    bound or failed."""
    ranks = np.full(len(births), np.nan, np.float32)
    rows = np.flatnonzero(births.feasible)
    if len(rows) and len(archive):
        scaled = Scale(births.losses[births.rows(archive)])(births.losses[rows])
        order = np.lexsort((rows, scaled.sum(axis=1), scaled.max(axis=1)))
        ranks[rows[order]] = np.arange(1, len(rows) + 1)
    return ranks


def weights_of(given: Mapping[str, float] | None, goals: Sequence[str]) -> np.ndarray:
    """Return the weight of each of the ``goals``: 1, unless ``given`` says otherwise."""
    weights = dict.fromkeys(goals, 1.0)
    if given is not None and not isinstance(given, Mapping):
        raise _fault(given, f'write weights={{"{goals[0]}": 2}}')
    for name, weight in (given or {}).items():
        if name not in weights:
            raise _fault(given, near_miss(str(name), goals) or f"the goals are {', '.join(goals)}")
        if not (is_number(weight) and 0 <= weight < np.inf):
            raise _fault(given, f"replace {name} = {spell(weight)}")
        weights[name] = float(weight)
    if not any(weights.values()):
        raise _fault(given, "give at least one goal a weight above 0")
    return np.array(list(weights.values()))


def _fault(given: object, remedy: str) -> EvocityError:
    return EvocityError(
        f"weights = {spell(given)}", "a number of 0 or more for each goal in the mapping", remedy
    )
