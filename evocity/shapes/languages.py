"""Regular languages of words of maps: which products of a shape's maps are drawn.

A word's first letter is the outermost map. Source: Prusinkiewicz & Hammel 1991, language-restricted
IFS; Thollot & Tosan 1995; here a deterministic automaton each.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.errors import EvocityError, setting, shown

#: The most states of an automaton, and the most letters.
MOST_STATES, MOST_LETTERS = 4096, 1024


class ShapeError(EvocityError):
    """A shape, a language or a curve that cannot be."""


@dataclass(frozen=True, eq=False)
class Language:
    """The words that an automaton accepts, of the letters 0 … N − 1.

    Parameters
    ----------
    table : whole numbers ``(S, N)``: the state that each letter leads to from each, −1 where there
        is none. State 0 is the first.
    accepting : bool ``(S,)``, whether a word may end in a state; all unless told.

    Two are equal if they accept the same words; ``|``, ``&`` and ``-`` are the union, the
    intersection and the difference of two with the same letters, ``~`` is the complement and ``@``
    the concatenation: words of the first followed by words of the second. What each gives is
    minimal.

    Raises
    ------
    ShapeError : a table that is none, too many states or letters.
    """

    table: np.ndarray
    accepting: np.ndarray | None = None

    def __post_init__(self):
        table = np.array(self.table)
        if table.ndim != 2 or table.dtype.kind not in "iu" or 0 in table.shape:
            raise ShapeError(
                f"a table of shape {table.shape}",
                "whole numbers, a row a state, a column a letter",
                "give the state that each letter leads to, -1 for none",
            )
        states, letters = table.shape
        if states > MOST_STATES or letters > MOST_LETTERS:
            raise ShapeError(
                f"{states} states of {letters} letters",
                f"at most {MOST_STATES} states of {MOST_LETTERS} letters",
                "describe a simpler language",
            )
        wrong = (table < -1) | (table >= states)
        if wrong.any():
            raise ShapeError(
                f"state {table[wrong][0]} in a table of {states}",
                f"-1…{states - 1}",
                "correct the table",
            )
        accepting = np.ones(states, bool) if self.accepting is None else np.array(self.accepting)
        if accepting.shape != (states,) or accepting.dtype != bool:
            raise ShapeError(
                f"accepting of shape {accepting.shape}, {accepting.dtype}",
                f"true or false for each of {states} states",
                "correct it",
            )
        object.__setattr__(self, "table", table.astype(np.int64))
        object.__setattr__(self, "accepting", accepting)
        self.table.setflags(write=False)
        self.accepting.setflags(write=False)

    # -- which there are ---------------------------------------------------------------------

    @classmethod
    def every(cls, letters: int) -> "Language":
        """All words of so many letters."""
        return cls(np.zeros((1, letters), np.int64))

    @classmethod
    def level(cls, letters: int, length: int) -> "Language":
        """All words of one length, 0 or more."""
        table = np.full((length + 1, letters), -1)
        table[:-1] = np.arange(1, length + 1)[:, None]
        return cls(table, np.arange(length + 1) == length)

    @classmethod
    def without(cls, letters: int, *forbidden: Sequence[int]) -> "Language":
        """All words in which none of the ``forbidden`` ones occurs: ``without(4, [3, 3])`` has no 3
        after a 3."""
        words = [tuple(one) for one in forbidden]
        for word in words:
            if not word or not all(0 <= letter < letters for letter in word):
                raise ShapeError(
                    f"forbidden word {shown(list(word))}",
                    f"one or more letters of 0…{letters - 1}",
                    "correct it",
                )
        # states are beginnings of forbidden words: what of them has just been read (Aho-Corasick)
        begun = sorted({word[:k] for word in words for k in range(len(word))}, key=len) or [()]
        number = {one: k for k, one in enumerate(begun)}

        def read(state: tuple, letter: int) -> int:
            text = (*state, letter)
            if any(text[-len(word) :] == word for word in words):
                return -1
            return next(number[text[k:]] for k in range(len(text) + 1) if text[k:] in number)

        table = [[read(state, letter) for letter in range(letters)] for state in begun]
        return cls(np.array(table)).minimal

    @classmethod
    def of_words(cls, letters: int, words: Sequence[Sequence[int]]) -> "Language":
        """Exactly these words."""
        begun = sorted({tuple(word)[:k] for word in words for k in range(len(word) + 1)} | {()})
        number = {one: k for k, one in enumerate(begun)}
        table = [[number.get((*one, k), -1) for k in range(letters)] for one in begun]
        told = {tuple(word) for word in words}
        for word in told:
            if not all(0 <= letter < letters for letter in word):
                raise ShapeError(
                    f"word {shown(list(word))}", f"letters of 0…{letters - 1}", "correct it"
                )
        return cls(np.array(table), np.array([one in told for one in begun])).minimal

    # -- what is asked of one ----------------------------------------------------------------

    @property
    def letters(self) -> int:
        """How many there are."""
        return self.table.shape[1]

    def __contains__(self, word: Sequence[int]) -> bool:
        state = 0
        for letter in word:
            if not 0 <= letter < self.letters:
                return False
            state = int(self.table[state, letter])
            if state < 0:
                return False
        return bool(self.accepting[state])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Language):
            return NotImplemented
        own, its = self.minimal, other.minimal
        return np.array_equal(own.table, its.table) and np.array_equal(own.accepting, its.accepting)

    def __hash__(self) -> int:
        return hash((self.minimal.table.tobytes(), self.minimal.accepting.tobytes()))

    def count(self, length: int) -> int:
        """How many words of a ``length`` there are, exactly."""
        if length < 0:
            raise ShapeError(setting("length", length), "0 or more", "correct it")
        ways = [int(one) for one in self.accepting]
        table = self.table.tolist()
        for _ in range(length):
            ways = [sum(ways[to] for to in row if to >= 0) for row in table]
        return ways[0]

    def words(self, length: int) -> Iterator[tuple[int, ...]]:
        """All words of a ``length``, in lexicographic order."""
        left = [self.accepting]  # from which states so many letters lead to an end
        for _ in range(length):
            reached = np.append(left[-1], False)[self.table]
            left.append(reached.any(axis=1))
        if not left[length][0]:
            return
        word, states, letter = [], [0], 0
        while True:
            if len(word) == length:
                yield tuple(word)
                letter = self.letters
            while letter < self.letters:
                to = int(self.table[states[-1], letter])
                if to >= 0 and left[length - len(word) - 1][to]:
                    break
                letter += 1
            if letter < self.letters:
                word.append(letter)
                states.append(to)
                letter = 0
            elif word:
                letter = word.pop() + 1
                states.pop()
            else:
                return

    @cached_property
    def lasting(self) -> np.ndarray:
        """Bool ``(S,)``: the states from which there are words of any length."""
        useful = self._reaching
        while True:
            goes_on = (np.append(useful, False)[self.table]).any(axis=1) & useful
            if (goes_on == useful).all():
                return useful
            useful = goes_on

    @property
    def lasts(self) -> bool:
        """Whether it has words of any length: else there is no attractor."""
        return bool(self.lasting[0])

    @cached_property
    def _reaching(self) -> np.ndarray:
        """From which states an accepting one is reached."""
        found = self.accepting.copy()
        while True:
            more = found | np.append(found, False)[self.table].any(axis=1)
            if (more == found).all():
                return found
            found = more

    # -- what is made of some ----------------------------------------------------------------

    @cached_property
    def minimal(self) -> "Language":
        """The least automaton of the same words; its states are numbered as they are reached."""
        table, accepting = self._whole()
        # Moore: states are told apart by whether they accept, then by where their letters lead
        classes = accepting.astype(np.int64)
        while True:
            rows = np.column_stack([classes, classes[table]])
            _, finer = np.unique(rows, axis=0, return_inverse=True)
            if finer.max() == classes.max():
                break
            classes = finer.reshape(-1)
        empty = classes[-1]
        number, order = {int(classes[0]): 0}, [0]
        rows = []
        for state in order:
            row = []
            for to in table[state].tolist():
                of = int(classes[to])
                if of == empty:
                    row.append(-1)
                    continue
                if of not in number:
                    number[of] = len(order)
                    order.append(to)
                row.append(number[of])
            rows.append(row)
        found = Language(np.array(rows), accepting[order])
        found.__dict__["minimal"] = found
        return found

    def _whole(self) -> tuple[np.ndarray, np.ndarray]:
        """With one more state, the last, that accepts nothing and leads nowhere else."""
        states = len(self.table)
        table = np.where(self.table < 0, states, self.table)
        table = np.vstack([table, np.full((1, self.letters), states)])
        return table, np.append(self.accepting, False)

    def __and__(self, other: "Language") -> "Language":
        return self._with(other, lambda a, b: a and b)

    def __or__(self, other: "Language") -> "Language":
        return self._with(other, lambda a, b: a or b)

    def __sub__(self, other: "Language") -> "Language":
        return self._with(other, lambda a, b: a and not b)

    def __invert__(self) -> "Language":
        return Language.every(self.letters) - self

    def _with(self, other: "Language", accepts: Callable[[bool, bool], bool]) -> "Language":
        if self.letters != other.letters:
            raise ShapeError(
                f"languages of {self.letters} and {other.letters} letters",
                "the same letters",
                "widen the smaller one",
            )
        (first, one), (second, two) = self._whole(), other._whole()
        tables = first.tolist(), second.tolist()
        return _explored(
            (0, 0),
            self.letters,
            lambda pair, letter: (tables[0][pair[0]][letter], tables[1][pair[1]][letter]),
            lambda pair: accepts(bool(one[pair[0]]), bool(two[pair[1]])),
        )

    def __matmul__(self, other: "Language") -> "Language":
        if self.letters != other.letters:
            return self._with(other, lambda a, b: a)
        (first, one), (second, two) = self._whole(), other._whole()

        def begun(state: int, others: frozenset) -> tuple[int, frozenset]:
            return state, others | {0} if one[state] else others

        def read(pair, letter):
            state, others = pair
            after = frozenset(int(second[other, letter]) for other in others)
            return begun(int(first[state, letter]), after - {len(second) - 1})

        return _explored(
            begun(0, frozenset()),
            self.letters,
            read,
            lambda pair: any(two[state] for state in pair[1]),
        )

    def renamed(self, letters: int, names: Sequence[int]) -> "Language":
        """The same among so many ``letters``: letter k has become ``names[k]``."""
        table = np.full((len(self.table), letters), -1)
        table[:, list(names)] = self.table
        return Language(table, self.accepting)

    def substituted(self, words: Mapping[int, Sequence[int]], letters: int) -> "Language":
        """Each letter replaced by its word, of one of so many ``letters`` or more. Letters that
        ``words`` do not name stay."""
        states = len(self.table)
        edges: list[dict[int, set[int]]] = [{} for _ in range(states)]
        silent: list[set[int]] = [set() for _ in range(states)]
        for state, letter in zip(*np.nonzero(self.table >= 0), strict=True):
            to, at = int(self.table[state, letter]), int(state)
            word = list(words.get(int(letter), [int(letter)]))
            for k, one in enumerate(word):
                after = to if k == len(word) - 1 else len(edges)
                if after == len(edges):
                    edges.append({})
                    silent.append(set())
                edges[at].setdefault(one, set()).add(after)
                at = after
            if not word:
                silent[at].add(to)

        def closed(some: set[int]) -> frozenset:
            found, new = set(some), list(some)
            while new:
                more = silent[new.pop()] - found
                found |= more
                new += more
            return frozenset(found)

        ends = set(np.flatnonzero(self.accepting).tolist())
        return _explored(
            closed({0}),
            letters,
            lambda some, letter: closed(set().union(*(edges[k].get(letter, ()) for k in some))),
            lambda some: bool(some & ends),
        )


def _explored(start, letters: int, read: Callable, accepts: Callable) -> Language:
    """The automaton of all states that are reached from ``start``, minimal."""
    number, order, rows = {start: 0}, [start], []
    for state in order:
        row = []
        for letter in range(letters):
            to = read(state, letter)
            if to not in number:
                if len(order) == MOST_STATES:
                    raise ShapeError(
                        f"a language of more than {MOST_STATES} states",
                        "a simpler one",
                        "combine fewer, or simpler ones",
                    )
                number[to] = len(order)
                order.append(to)
            row.append(number[to])
        rows.append(row)
    return Language(np.array(rows), np.array([accepts(one) for one in order], bool)).minimal


__all__ = ["MOST_LETTERS", "MOST_STATES", "Language", "ShapeError"]
