"""`Language`: regular languages of words of maps, which select a shape's products of maps.

A word's first letter is the outermost map. Each language is a deterministic automaton. Source:
Prusinkiewicz & Hammel 1991, language-restricted IFS; Thollot & Tosan 1995.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.errors import EvocityError, setting, spell

#: The most states of an automaton, and the most letters.
MOST_STATES, MOST_LETTERS = 4096, 1024


class ShapeError(EvocityError):
    """Error for an invalid shape, language or curve."""


@dataclass(frozen=True, eq=False)
class Language:
    """A set of words of the letters 0 … N − 1: all words that an automaton accepts.

    Parameters
    ----------
    table : the next state for each of S states and N letters, whole numbers ``(S, N)``; −1 for no
        next state. The automaton starts in state 0.
    accepting : whether a word may end in each state, bool ``(S,)``; by default all states accept.

    Two languages are equal if they accept the same words. For two languages with the same letters,
    the operators ``|``, ``&`` and ``-`` make the union, the intersection and the difference. The
    operator ``@`` makes the concatenation: the words of the first language, each followed by each
    word of the second language. The operator ``~`` makes the complement of a language. The language
    that an operator returns has a minimal automaton.

    Raises
    ------
    ShapeError : one of: an invalid table; too many states; too many letters.
    """

    table: np.ndarray
    accepting: np.ndarray | None = None

    def __post_init__(self):
        table = np.array(self.table)
        if table.ndim != 2 or table.dtype.kind not in "iu" or 0 in table.shape:
            raise ShapeError(
                f"the table of the language has the shape {table.shape} and the type {table.dtype}",
                "whole numbers, with a row for each state and a column for each letter",
                "give the next state for each state and letter, or -1 for no next state",
            )
        states, letters = table.shape
        if states > MOST_STATES or letters > MOST_LETTERS:
            raise ShapeError(
                f"the language is too large: {states} states and {letters} letters",
                f"a language of at most {MOST_STATES} states and {MOST_LETTERS} letters",
                "describe a language with fewer states or fewer letters",
            )
        wrong = (table < -1) | (table >= states)
        if wrong.any():
            raise ShapeError(
                f"the table of the language names the state {table[wrong][0]}, which does not "
                "exist",
                f"state numbers from 0 to {states - 1}, or -1 for no next state",
                "correct the state numbers in the table",
            )
        accepting = np.ones(states, bool) if self.accepting is None else np.array(self.accepting)
        if accepting.shape != (states,) or accepting.dtype != bool:
            raise ShapeError(
                f"the parameter 'accepting' has the shape {accepting.shape} and the type "
                f"{accepting.dtype}",
                f"an array of {states} booleans, one for each state of the language",
                f"give an array of {states} booleans",
            )
        object.__setattr__(self, "table", table.astype(np.int64))
        object.__setattr__(self, "accepting", accepting)
        self.table.setflags(write=False)
        self.accepting.setflags(write=False)

    @classmethod
    def every(cls, letters: int) -> "Language":
        """Make the language of all words of the letters 0 … ``letters`` − 1."""
        return cls(np.zeros((1, letters), np.int64))

    @classmethod
    def level(cls, letters: int, length: int) -> "Language":
        """Make the language of all words that have a given ``length``, 0 or more."""
        table = np.full((length + 1, letters), -1)
        table[:-1] = np.arange(1, length + 1)[:, None]
        return cls(table, np.arange(length + 1) == length)

    @classmethod
    def without(cls, letters: int, *forbidden: Sequence[int]) -> "Language":
        """Make the language of all words that contain no ``forbidden`` word. For example, words of
        ``without(4, [3, 3])`` never have the letter 3 twice in succession."""
        words = [tuple(word) for word in forbidden]
        _check_words(words, letters, 1)
        # states are prefixes of forbidden words: the longest that has just been read (Aho-Corasick)
        prefixes = sorted({word[:k] for word in words for k in range(len(word))}, key=len) or [()]
        number = {prefix: k for k, prefix in enumerate(prefixes)}

        def read(state: tuple, letter: int) -> int:
            text = (*state, letter)
            if any(text[-len(word) :] == word for word in words):
                return -1
            return next(number[text[k:]] for k in range(len(text) + 1) if text[k:] in number)

        table = [[read(state, letter) for letter in range(letters)] for state in prefixes]
        return cls(np.array(table)).minimal

    @classmethod
    def of_words(cls, letters: int, words: Sequence[Sequence[int]]) -> "Language":
        """Make the language that contains only the given ``words``."""
        prefixes = sorted({tuple(word)[:k] for word in words for k in range(len(word) + 1)} | {()})
        number = {prefix: k for k, prefix in enumerate(prefixes)}
        table = [[number.get((*prefix, k), -1) for k in range(letters)] for prefix in prefixes]
        whole = {tuple(word) for word in words}
        _check_words(whole, letters, 0)
        return cls(np.array(table), np.array([prefix in whole for prefix in prefixes])).minimal

    @property
    def letters(self) -> int:
        """Number of letters."""
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
        """Count the words that have a given ``length``, exactly."""
        if length < 0:
            raise ShapeError(setting("length", length), "a length of 0 or more", "give a length")
        ways = [int(ends) for ends in self.accepting]
        table = self.table.tolist()
        for _ in range(length):
            ways = [sum(ways[to] for to in row if to >= 0) for row in table]
        return ways[0]

    def words(self, length: int) -> Iterator[tuple[int, ...]]:
        """Yield all words that have a given ``length``, in lexicographic order."""
        left = [self.accepting]  # states from which so many letters lead to an end
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
        """The states from which words of any length lead on, bool ``(S,)``."""
        useful = self._reaching
        while True:
            goes_on = (np.append(useful, False)[self.table]).any(axis=1) & useful
            if (goes_on == useful).all():
                return useful
            useful = goes_on

    @property
    def lasts(self) -> bool:
        """Whether the language has arbitrarily long words. A shape of finitely many words has no
        attractor."""
        return bool(self.lasting[0])

    @cached_property
    def _reaching(self) -> np.ndarray:
        """Bool ``(S,)``: the states from which a word reaches an accepting state."""
        reaching = self.accepting.copy()
        while True:
            more = reaching | np.append(reaching, False)[self.table].any(axis=1)
            if (more == reaching).all():
                return reaching
            reaching = more

    @cached_property
    def minimal(self) -> "Language":
        """The language with the smallest automaton of the same words. Its states are numbered in
        breadth-first order."""
        table, accepting = self._whole()
        # Moore: states differ if they accept differently, then if their letters lead to others
        classes = accepting.astype(np.int64)
        while True:
            rows = np.column_stack([classes, classes[table]])
            _, finer = np.unique(rows, axis=0, return_inverse=True)
            if finer.max() == classes.max():
                break
            classes = finer.reshape(-1)
        _, first = np.unique(classes, return_index=True)
        after = classes[table[first]].tolist()
        minimal = _build(
            int(classes[0]),
            self.letters,
            lambda of, letter: after[of][letter],
            lambda of: accepting[first[of]],
            empty=int(classes[-1]),
        )
        minimal.__dict__["minimal"] = minimal
        return minimal

    def _whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Add a last state that accepts nothing and leads only to itself."""
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
                f"the languages have {self.letters} and {other.letters} letters",
                "two languages with the same number of letters",
                "add letters to the smaller language with renamed()",
            )
        (first, ends), (second, its_ends) = self._whole(), other._whole()
        tables = first.tolist(), second.tolist()
        return _explore(
            (0, 0),
            self.letters,
            lambda pair, letter: (tables[0][pair[0]][letter], tables[1][pair[1]][letter]),
            lambda pair: accepts(bool(ends[pair[0]]), bool(its_ends[pair[1]])),
        )

    def __matmul__(self, other: "Language") -> "Language":
        if self.letters != other.letters:
            return self._with(other, lambda a, b: a)
        (first, ends), (second, its_ends) = self._whole(), other._whole()

        def pair_of(state: int, others: frozenset) -> tuple[int, frozenset]:
            return state, others | {0} if ends[state] else others

        def read(pair, letter):
            state, others = pair
            after = frozenset(int(second[other, letter]) for other in others)
            return pair_of(int(first[state, letter]), after - {len(second) - 1})

        return _explore(
            pair_of(0, frozenset()),
            self.letters,
            read,
            lambda pair: any(its_ends[state] for state in pair[1]),
        )

    def renamed(self, letters: int, names: Sequence[int]) -> "Language":
        """Rename each letter k to ``names[k]``; the argument ``letters`` is the number of
        letters of the new language."""
        table = np.full((len(self.table), letters), -1)
        table[:, list(names)] = self.table
        return Language(table, self.accepting)

    def substituted(self, words: Mapping[int, Sequence[int]], letters: int) -> "Language":
        """Replace each letter by its word in ``words``, whose letters are 0 … ``letters`` − 1. A
        letter that has no word in ``words`` stays unchanged."""
        states = len(self.table)
        edges: list[dict[int, set[int]]] = [{} for _ in range(states)]
        silent: list[set[int]] = [set() for _ in range(states)]
        for state, letter in zip(*np.nonzero(self.table >= 0), strict=True):
            to, at = int(self.table[state, letter]), int(state)
            word = list(words.get(int(letter), [int(letter)]))
            for k, each in enumerate(word):
                after = to if k == len(word) - 1 else len(edges)
                if after == len(edges):
                    edges.append({})
                    silent.append(set())
                edges[at].setdefault(each, set()).add(after)
                at = after
            if not word:
                silent[at].add(to)

        def closed(some: set[int]) -> frozenset:
            reached, new = set(some), list(some)
            while new:
                more = silent[new.pop()] - reached
                reached |= more
                new += more
            return frozenset(reached)

        ends = set(np.flatnonzero(self.accepting).tolist())
        return _explore(
            closed({0}),
            letters,
            lambda some, letter: closed(set().union(*(edges[k].get(letter, ()) for k in some))),
            lambda some: bool(some & ends),
        )


def _check_words(words: Iterable[tuple[int, ...]], letters: int, shortest: int) -> None:
    for word in words:
        if len(word) < shortest or not all(0 <= letter < letters for letter in word):
            raise ShapeError(
                f"the word {spell(list(word))} is invalid",
                f"a list of {'one or more ' * (shortest > 0)}numbers from 0 to {letters - 1}",
                "correct the numbers in the word",
            )


def _explore(start, letters: int, read: Callable, accepts: Callable) -> Language:
    """Build the minimal automaton of all states reached from ``start``."""
    return _build(start, letters, read, accepts).minimal


def _build(start, letters: int, read: Callable, accepts: Callable, empty=None) -> Language:
    """Build the automaton of all states reached from ``start`` without ``empty``, numbered in
    breadth-first order."""
    number, order, rows = {start: 0, empty: -1}, [start], []
    for state in order:
        row = []
        for letter in range(letters):
            to = read(state, letter)
            if to not in number:
                if len(order) == MOST_STATES:
                    raise ShapeError(
                        f"the language has more than {MOST_STATES} states",
                        f"a language of at most {MOST_STATES} states",
                        "combine fewer languages, or languages of fewer states",
                    )
                number[to] = len(order)
                order.append(to)
            row.append(number[to])
        rows.append(row)
    return Language(np.array(rows), np.array([accepts(state) for state in order], bool))
