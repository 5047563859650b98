"""One worker as the main process sees it: its connection, its state, its job and its output."""

import contextlib
import os
import selectors
import socket
from collections.abc import Iterator

from evocity.evaluation.answers import Answer, Checked, Ready, read_answer
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.frames import LENGTH, MOST_BYTES
from evocity.evaluation.kept_genomes import GenomesOfWorker
from evocity.evaluation.output import Drain

_AT_ONCE = 1 << 20
#: The share of a worker's time for canaries; the most outcomes that wait for the next one.
_SHARE, MOST_HELD = 0.005, 64


class Seat:
    """A worker from its start to its end.

    No method waits for the worker. ``state``: "starting", "idle", "busy", "checking" while it
    evaluates its canary, "ending" or "gone", ``since`` a time of the pool's clock. ``job``,
    ``next``: the numbers of its job and of the following one, or None. ``held``: numbers and
    outcomes since its last good canary. ``canary``: the canary's digest at the start, or "".
    ``genomes``: those that the worker keeps. ``resident``: bytes of memory before its first job.
    ``hung_up``: whether its connection ended, ``closed`` when. ``output``: the write end of its
    output's pipe.
    """

    def __init__(self, token: int, now: float, prints: bool):
        self.token, self.pid = token, 0
        self.state, self.since = "starting", now
        self.job: int | None = None
        self.next: int | None = None
        self.resident = 0
        self.canary, self._canary_seconds = "", 0.0
        self.genomes = GenomesOfWorker()
        self.held: list[tuple[int, Outcome]] = []
        self._held_seconds = 0.0
        self.handle, self.theirs = socket.socketpair()
        self.handle.setblocking(False)
        self._incoming, self._outgoing = bytearray(), bytearray()
        self.hung_up = False
        self.closed: float | None = None
        self.drain: Drain | None = None
        self.output: int | None = None
        if prints:
            read, self.output = os.pipe()
            self.drain = Drain(read)

    @property
    def has_unsent(self) -> bool:
        """Whether some bytes are still to be sent."""
        return bool(self._outgoing) and not self.hung_up

    @property
    def first(self) -> int:
        """The number of its job, or of the first outcome that it holds."""
        return self.held[0][0] if self.job is None else self.job

    @property
    def needs_check(self) -> bool:
        """Whether it has worked long enough since its last good canary."""
        worked = self._held_seconds * _SHARE
        return bool(self.held) and (worked > self._canary_seconds or len(self.held) >= MOST_HELD)

    def set_up(self, ready: Ready) -> None:
        """Take over what a worker tells when it is ready."""
        self.resident, self.canary = ready.resident, ready.canary
        self._canary_seconds = ready.seconds

    def hold(self, number: int, outcome: Outcome, seconds: float) -> None:
        """Keep an ``outcome``, which took so many seconds, until the next good canary."""
        self.held.append((number, outcome))
        self._held_seconds += seconds

    def take_held(self) -> list[tuple[int, Outcome]]:
        """Return the outcomes that it held, and hold none."""
        held, self.held, self._held_seconds = self.held, [], 0.0
        return held

    def enter(self, state: str, now: float) -> None:
        """Enter a ``state``."""
        self.state, self.since = state, now

    def send(self, message: bytes) -> None:
        """Send a framed ``message``, as soon as the worker reads it."""
        self._outgoing += message
        self.flush()

    def flush(self) -> None:
        """Send as many bytes as the connection takes now."""
        try:
            while self._outgoing:
                sent = self.handle.send(memoryview(self._outgoing)[:_AT_ONCE])
                del self._outgoing[:sent]
        except BlockingIOError:
            pass
        except OSError:  # the worker's exit code says more
            self._outgoing.clear()

    def messages(self) -> Iterator[Ready | Answer | Checked]:
        """Receive the messages since the last call. Raises ValueError at the first invalid one."""
        with contextlib.suppress(BlockingIOError):
            while not self.hung_up:
                try:
                    received = self.handle.recv(_AT_ONCE)
                except ConnectionError:
                    received = b""
                self.hung_up = not received
                self._incoming += received
        while len(self._incoming) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(self._incoming)
            if length > MOST_BYTES:
                raise ValueError(f"a message of {length} bytes")
            end = LENGTH.size + length
            if len(self._incoming) < end:
                break
            message = bytes(memoryview(self._incoming)[LENGTH.size : end])
            del self._incoming[:end]
            yield read_answer(message)

    def text(self) -> str:
        """Return the output since the last call."""
        return "" if self.drain is None else self.drain.text()

    def close_worker_ends(self) -> None:
        """Close the worker's ends of the connection and of the pipe, which the worker has now."""
        self.theirs.close()
        if self.output is not None:
            os.close(self.output)
            self.output = None

    def close(self) -> None:
        """Close the connection and the pipe."""
        self.state = "gone"
        self.handle.close()
        self.close_worker_ends()
        if self.drain is not None:
            self.drain.close()


class SeatSelector(selectors.DefaultSelector):
    """A selector that also selects on seats, whose keys have the seat as ``data``."""

    def watch(self, seat: Seat) -> None:
        """Select on a worker's messages, on its output unless flooded, and on room to send."""
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if seat.has_unsent else 0)
        self._set(seat.handle.fileno(), 0 if seat.hung_up else events, seat)
        if seat.drain is not None:
            calm = not seat.drain.flooded and not seat.drain.ended
            self._set(seat.drain.descriptor, selectors.EVENT_READ if calm else 0, seat)

    def unwatch(self, seat: Seat) -> None:
        """Select no longer on a worker."""
        self._set(seat.handle.fileno(), 0, seat)
        if seat.drain is not None:
            self._set(seat.drain.descriptor, 0, seat)

    def _set(self, descriptor: int, events: int, seat: Seat) -> None:
        before = self.get_map().get(descriptor)
        if before is None and events:
            self.register(descriptor, events, seat)
        elif before is not None and not events:
            self.unregister(descriptor)
        elif before is not None and events != before.events:
            self.modify(descriptor, events, seat)
