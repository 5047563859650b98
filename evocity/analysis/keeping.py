"""Which few to keep, and why: the compromise, the extremes, one of each kind."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.clusters import labelled, medoids
from evocity.analysis.compromise import best_compromise
from evocity.analysis.extras import library
from evocity.analysis.fabrics import told_share
from evocity.analysis.individual import Individual
from evocity.analysis.likeness import Likeness
from evocity.displayed import Displayed
from evocity.genome import VOID
from evocity.search.fronts import Scale

if TYPE_CHECKING:
    import pandas as pd

#: So many of the archive are compared by looks, at most: some of all times, evenly.
MOST_COMPARED = 320
#: A source city of which no larger share of what is built is made has left no trace.
TRACE = 0.01
#: Two look alike that differ in no larger share of the map than this.
APART = 0.05


@dataclass(frozen=True)
class Kept:
    """A birth worth keeping. ``role``: "compromise", "best NAME", "of another kind"; ``why``: in a
    sentence or two; ``gave_up``: in which goal it is farthest behind the best, and how far;
    ``built``: of which source cities its buildings are made, ``stones`` in words."""

    individual: Individual
    role: str
    why: str
    gave_up: str

    @cached_property
    def built(self) -> dict[str, float]:
        """Source city -> share of what is built that is its stone, the largest first; empty where
        nothing is built, and of forms that are not made of stones."""
        if not self.individual.run.header.chromosome.stones:
            return {}
        shares = self.individual.ancestry(built=True)
        return dict(sorted(shares.items(), key=lambda one: -one[1]))

    @property
    def stones(self) -> str:
        """Whose stones what is built is, in a sentence; empty where `built` is, and where there is
        one source city alone."""
        if sum(city != VOID for city in self.individual.run.header.cities) < 2:
            return ""
        shares = ", ".join(f"{city} {told_share(share)}" for city, share in self.built.items())
        return f"Of what is built: {shares}." if shares else ""

    @property
    def reasons(self) -> list[str]:
        """All that is told of it, in sentences."""
        return [text for text in (self.why, self.gave_up, self.stones) if text]

    def __str__(self) -> str:
        return f"{self.individual.id}, {self.role}. {' '.join(self.reasons)}"


class Keeping(list[Kept], Displayed):
    """A few births worth keeping; ``str()`` tells each in a line, and what they lack."""

    def __str__(self) -> str:
        return "\n".join([*map(str, self), *filter(None, [self.lacking])])

    @cached_property
    def untraced(self) -> list[str]:
        """The source cities, such as have buildings, of which in none of them more than a hundredth
        of what is built is made."""
        built = [one.built for one in self]
        if not any(built):
            return []
        cities = [one.name for one in self[0].individual.told.sources if one.city.built.any()]
        return [city for city in cities if all(one.get(city, 0.0) <= TRACE for one in built)]

    @property
    def lacking(self) -> str:
        """That source cities are `untraced`, in a sentence; empty where none is."""
        if not self.untraced:
            return ""
        cities = " or ".join(self.untraced)
        return f"In none of these is more than {TRACE:.0%} of what is built from {cities}."

    @property
    def frame(self) -> "pd.DataFrame":
        """A row each, index ``id``: role, why, gave_up, and the measures."""
        pandas = library("pandas", "a table of births")
        rows = [
            {"role": one.role, "why": one.why, "gave_up": one.gave_up} | one.individual.scores
            for one in self
        ]
        return pandas.DataFrame(rows, pandas.Index([k.individual.id for k in self], name="id"))


def kept_of(
    told: Told,
    ids: np.ndarray,
    likeness: Likeness,
    count: int,
    where: str = "in the archive",
    apart: float = APART,
) -> Keeping:
    """``count`` of the births ``ids``, which are ``where``, or as many as differ: the best
    compromise; the best by each goal; for the rest those in the middle of the largest groups of
    births that look alike, of which none is among them yet, and then those that differ most from
    all named before. One that differs from them in no larger share of the map than ``apart`` is
    none of these. At least one birth, all measured."""
    choice = _Choice(told, ids, where)
    choice.take(best_compromise(choice.losses, np.ones(len(told.goals))), "compromise")
    for column, goal in enumerate(told.goals):
        if len(choice.roles) < count and choice.differ(column):
            choice.take(choice.best(column), f"best {goal}")
    wanted = min(count, len(ids))
    kinds = _kinds(choice, likeness, count, apart) if len(choice.roles) < wanted else ()
    for row, why in kinds:
        choice.take(row, "of another kind", why)
        if len(choice.roles) == wanted:  # they would go on
            break
    return Keeping(choice.told_of(row) for row in choice.roles)


def _kinds(
    choice: "_Choice", likeness: Likeness, count: int, apart: float
) -> Iterator[tuple[int, str]]:
    """Rows that stand for those that look like them, the largest group first, and then those that
    are farthest from all others; why each does."""
    own = np.fromiter(choice.roles, np.intp)
    rest = np.setdiff1d(np.arange(len(choice.ids)), own)
    room = min(max(0, MOST_COMPARED - len(own)), len(rest))
    rest = rest[np.linspace(0, len(rest) - 1, room).round().astype(np.intp)]
    rows = np.concatenate([own, rest])
    whole = len(rows) == len(choice.ids)
    where = f"of the {len(rows)} " + (choice.where if whole else "that were compared")
    matrix = likeness.matrix(choice.ids[rows], "looks")
    middle = medoids(matrix, min(count, len(rows)))
    labels = labelled(matrix, middle)
    sizes = np.bincount(labels, minlength=len(middle))
    taken = set(labels[: len(own)].tolist())

    def near() -> np.ndarray:
        """How far each is from the nearest that is chosen; that itself -1."""
        chosen = np.isin(rows, list(choice.roles))
        return np.where(chosen, -1, matrix[:, chosen].min(axis=1))

    for group in np.argsort(-sizes, kind="stable").tolist():
        if group not in taken and near()[middle[group]] > apart:
            yield int(rows[middle[group]]), _stands_for(int(sizes[group]) - 1, where)
    while (far := near()).max() > apart:
        row = int(far.argmax())
        yield int(rows[row]), f"It differs in {far[row]:.0%} of the map from all named before."


def _stands_for(others: int, where: str) -> str:
    """How many ``others`` one stands for, of those that were compared."""
    if not others:
        return f"It looks like no other {where}."
    many = f"{others} others {where} that look" if others > 1 else f"1 other {where} that looks"
    return f"It stands for {many} most like it."


class _Choice:
    """Those chosen so far of the births ``ids``: row to role and reason."""

    def __init__(self, told: Told, ids: np.ndarray, where: str):
        self.told, self.ids, self.where = told, ids, where
        self.losses = told.losses[told.rows(ids)]
        self.scaled = Scale(self.losses)(self.losses)
        self.roles: dict[int, tuple[list[str], str]] = {}
        self._aims = {aim.name: aim for aim in told.aims}

    def differ(self, column: int) -> bool:
        """Whether some are better than others by one goal."""
        return bool(self.scaled[:, column].any())

    def best(self, column: int) -> int:
        """The row that is best by one goal; of equal ones the best by the sum of all."""
        return int(np.lexsort((self.scaled.sum(axis=1), self.losses[:, column]))[0])

    def take(self, row: int, role: str, why: str = "") -> None:
        """Choose a ``row`` in a ``role``, one more if it is chosen already."""
        self.roles.setdefault(row, ([], why))[0].append(role)

    def value(self, row: int, column: int) -> str:
        """What a birth has of a goal, with its unit; of a sum its loss."""
        goal = self.told.goals[column]
        if goal in self._aims and self._aims[goal].total is None:
            value = self.told.value(goal)[self.told.rows(self.ids[row : row + 1])][0]
            return f"{value:.4g} {self._aims[goal].unit}".rstrip()
        return f"a loss of {self.losses[row, column]:.4g}"

    def told_of(self, row: int) -> Kept:
        roles, why = self.roles[row]
        one = Individual(self.told, int(self.ids[row]))
        goals, sentences = self.told.goals, []
        if "compromise" in roles:
            worst = int(self.scaled[row].argmax())
            behind = self.scaled[row, worst]
            sentences.append(
                f"Of the {len(self.ids)} {self.where} it is nearest to the best of all goals at "
                f"once: farthest behind in {goals[worst]}, by {behind:.0%} of the range."
                if behind > 0
                else f"Of the {len(self.ids)} {self.where} it is the best in every goal."
                if len(self.ids) > 1
                else f"It is the only one {self.where}."
            )
        best = [goal for goal in goals if f"best {goal}" in roles]
        if best and self.scaled[row].any():  # else it is the best in all
            told = ", ".join(self._best_value(row, goals.index(goal)) for goal in best)
            sentences.append(f"None of the {len(self.ids)} {self.where} is better by {told}.")
        sentences += [why] if why else []
        sentences += self._beside_parents(row) if one.operator != "source" else []
        if one.operator == "source":
            parent = self.told.run.header.cities[one.id]
            sentences.append(f"It is the parent {parent} as its code has it, not a child.")
        if not one.alive:
            sentences.append("It does not live any more.")
        return Kept(one, ", ".join(roles), " ".join(sentences), self._gave_up(row))

    def _best_value(self, row: int, column: int) -> str:
        """A goal in which none is better, what it has, and how many have as much."""
        others = int((self.losses[:, column] == self.losses[row, column]).sum()) - 1
        alike = f", as {others} {'others have' if others > 1 else 'other has'}" if others else ""
        return f"{self.told.goals[column]} ({self.value(row, column)}{alike})"

    def _beside_parents(self, row: int) -> list[str]:
        """In which goals it is better than every parent's own code, and in which one of these is
        better."""
        of_parents = self.told.losses[self.told.rows(self.told.founders)]
        if not len(of_parents):
            return []
        best = of_parents.min(axis=0)
        goals, own = np.array(self.told.goals, object), self.losses[row]
        better, worse = ", ".join(goals[own < best]), ", ".join(goals[own > best])
        told = f"No parent is as good in {better}" if better else "It beats all parents in no goal"
        return [f"{told}; one is better in {worse}." if worse else f"{told}."]

    def _gave_up(self, row: int) -> str:
        worst = int(self.scaled[row].argmax())
        if self.scaled[row, worst] <= 0:
            return "It gave up nothing."
        goal, best = self.told.goals[worst], self.best(worst)
        return (
            f"It gave up {goal}: {self.value(row, worst)}, the best has {self.value(best, worst)}."
        )


__all__ = ["Keeping", "Kept", "kept_of"]
