"""Genomes that a worker keeps, so that a parent of many births goes to each worker once.

A job holds tokens in place of the genomes that its worker has, or gets with it. Both sides drop the
genomes that were used least recently, by the same rule: the main process says which.
"""

import itertools
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from evocity.evaluation.frames import LENGTH, unpickle, write_frame
from evocity.genome import Genome

#: The most genomes that a worker keeps, and the most bytes of all of them, pickled.
MOST_GENOMES, MOST_BYTES = 96, 64 << 20


@dataclass(frozen=True)
class Token:
    """Stands for a genome in the arguments of a job."""

    number: int


def _mapped(job: tuple, change: Callable[[Any], Any]) -> tuple:
    """Change the arguments of a ``job``, and the items of tuples and lists among them."""
    return tuple(
        type(item)(map(change, item)) if type(item) in (tuple, list) else change(item)
        for item in job
    )


class GenomeTokens:
    """Tokens of the genomes of jobs, with their pickled bytes, in the main process."""

    def __init__(self):
        self._tokens: OrderedDict[int, tuple[int, Genome, bytes]] = OrderedDict()
        self._next, self._bytes = itertools.count(), 0

    def find(self, genome: Genome) -> tuple[int, bytes]:
        """Return the token of this very object, and its bytes."""
        known = self._tokens.get(id(genome))
        if known is None:  # an entry keeps its genome, so that no other object gets the same id
            known = next(self._next), genome, write_frame(genome)[LENGTH.size :]
            self._tokens[id(genome)] = known
            self._bytes += len(known[2])
            while len(self._tokens) > MOST_GENOMES or self._bytes > MOST_BYTES:
                self._bytes -= len(self._tokens.popitem(last=False)[1][2])
            return known[0], known[2]
        self._tokens.move_to_end(id(genome))
        return known[0], known[2]


class GenomesOfWorker:
    """The tokens of the genomes that one worker keeps, as the main process knows them."""

    def __init__(self):
        self._sizes: OrderedDict[int, int] = OrderedDict()

    def write(
        self, job: tuple, tokens: GenomeTokens
    ) -> tuple[bytes, list[tuple[int, bytes]], list[int]]:
        """Pickle a ``job`` for the worker. Returns the bytes, the genomes that the worker lacks,
        with their tokens, and the tokens that it drops after the job. Raises the errors of
        pickling, and knows no more then than before."""
        used: dict[int, bytes] = {}

        def token_of(item: Any) -> Any:
            if type(item) is not Genome:
                return item
            token, pickled = tokens.find(item)
            if len(pickled) > MOST_BYTES // 4:
                return item
            used[token] = pickled
            return Token(token)

        text = write_frame(_mapped(job, token_of))[LENGTH.size :]
        new = [(token, pickled) for token, pickled in used.items() if token not in self._sizes]
        for token, pickled in used.items():
            self._sizes[token] = len(pickled)
            self._sizes.move_to_end(token)
        gone = []
        while len(self._sizes) > MOST_GENOMES or sum(self._sizes.values()) > MOST_BYTES:
            gone.append(self._sizes.popitem(last=False)[0])  # after the job, which may need it
        return text, new, gone


class KeptGenomes:
    """The genomes that this worker keeps, by token."""

    def __init__(self):
        self._pickled: dict[int, bytes] = {}
        self._genomes: dict[int, Genome] = {}

    def keep(self, new: Iterable[tuple[int, bytes]]) -> None:
        """Keep ``new`` genomes, which are unpickled when a job needs them."""
        self._pickled.update(new)

    def drop(self, gone: Sequence[int]) -> None:
        """Drop the genomes with these tokens."""
        for token in gone:
            self._pickled.pop(token, None)
            self._genomes.pop(token, None)

    def unpickle(self, job: bytes | memoryview) -> Any:
        """Return the job of these bytes. Each birth gets its own copies of the genomes, which share
        their arrays."""
        return _mapped(unpickle(job), self._find)

    def _find(self, item: Any) -> Any:
        if not isinstance(item, Token):
            return item
        token = item.number
        if token not in self._genomes:
            self._genomes[token] = unpickle(self._pickled[token])
            self._pickled[token] = b""
        genome = self._genomes[token]
        return genome.replace(made=genome.made)
