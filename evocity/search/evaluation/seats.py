"""One worker as the main process sees it: what it was given, what it answers, what it prints."""

import contextlib
import os
import socket
from typing import Any

from evocity.search.evaluation.frames import LENGTH, MOST_BYTES, read_of
from evocity.search.evaluation.output import Drain

_AT_ONCE = 1 << 20


class Seat:
    """A worker from its start to its end. Nothing here waits for it.

    ``state``: "starting", "idle", "busy", "ending" (it was told to end, or will by itself) or
    "gone". ``job``: the number of the one it works on, None if it works on none;
    ``next``: of the one that it was sent besides. ``since``: when
    the state began, in seconds of the pool's clock. ``resident``: bytes of memory it had before its
    first job. ``hung_up``: whether its end of the connection is closed, which the pool saw at
    ``closed``.
    """

    def __init__(self, token: int, now: float, prints: bool):
        self.token, self.pid = token, 0
        self.state, self.since = "starting", now
        self.job: int | None = None
        self.next: int | None = None
        self.resident = 0
        self.code: int | None = None
        self._ours, self.theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._incoming, self._outgoing = bytearray(), bytearray()
        self.hung_up = False
        self.closed: float | None = None
        self.drain: Drain | None = None
        self.printed: int | None = None
        if prints:
            read, self.printed = os.pipe()
            self.drain = Drain(read)

    @property
    def handle(self) -> socket.socket:
        return self._ours

    @property
    def writing(self) -> bool:
        """Whether something is left to be sent."""
        return bool(self._outgoing) and not self.hung_up

    def enter(self, state: str, now: float) -> None:
        self.state, self.since = state, now

    def send(self, told: bytes) -> None:
        self._outgoing += told
        self.flush()

    def flush(self) -> None:
        """Send what can be sent."""
        try:
            while self._outgoing:
                sent = self._ours.send(memoryview(self._outgoing)[:_AT_ONCE])
                del self._outgoing[:sent]
        except BlockingIOError:
            pass
        except OSError:  # its end tells more
            self._outgoing.clear()

    def messages(self) -> list[Any]:
        """What it sent since the last time. Raises ValueError for what no worker sends."""
        with contextlib.suppress(BlockingIOError):
            while not self.hung_up:
                try:
                    got = self._ours.recv(_AT_ONCE)
                except ConnectionError:
                    got = b""
                self.hung_up = not got
                self._incoming += got
        found = []
        while len(self._incoming) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(self._incoming)
            if length > MOST_BYTES:
                raise ValueError("a message without end")
            end = LENGTH.size + length
            if len(self._incoming) < end:
                break
            told = bytes(memoryview(self._incoming)[LENGTH.size : end])
            del self._incoming[:end]
            try:
                found.append(read_of(told))
            except Exception as error:
                raise ValueError(f"{type(error).__name__}: {error}") from None
        return found

    def text(self) -> str:
        """What it printed since the last time."""
        return "" if self.drain is None else self.drain.text()

    def given(self) -> None:
        """The worker has its ends of what connects it: they are closed here."""
        self.theirs.close()
        if self.printed is not None:
            os.close(self.printed)
            self.printed = None

    def close(self) -> None:
        self.state = "gone"
        self._ours.close()
        self.given()
        if self.drain is not None:
            self.drain.close()
