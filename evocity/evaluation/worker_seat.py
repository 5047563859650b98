"""One worker as the main process sees it: its connection, its state, its job and its output."""

import contextlib
import os
import socket
from typing import Any

from evocity.evaluation.frames import LENGTH, MOST_BYTES, unpickle
from evocity.evaluation.output import Drain

_AT_ONCE = 1 << 20


class Seat:
    """A worker from its start to its end. No method waits for the worker.

    ``state``: "starting", "idle", "busy", "ending" (the pool ends it, or it ends by itself) or
    "gone". ``since``: when the state began, in seconds of the pool's clock. ``job``: the number of
    the job that it works on, or None; ``next``: the number of the job that it has already received
    to follow. ``resident``: bytes of memory that it had before its first job. ``hung_up``: whether
    its end of the connection is closed; ``closed``: when the pool noticed. ``output``: the write
    end of the pipe for its output, None without a pipe.
    """

    def __init__(self, token: int, now: float, prints: bool):
        self.token, self.pid = token, 0
        self.state, self.since = "starting", now
        self.job: int | None = None
        self.next: int | None = None
        self.resident = 0
        self._ours, self.theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._incoming, self._outgoing = bytearray(), bytearray()
        self.hung_up = False
        self.closed: float | None = None
        self.drain: Drain | None = None
        self.output: int | None = None
        if prints:
            read, self.output = os.pipe()
            self.drain = Drain(read)

    @property
    def handle(self) -> socket.socket:
        """The main process's end of the connection."""
        return self._ours

    @property
    def has_unsent(self) -> bool:
        """Whether some bytes are still to be sent."""
        return bool(self._outgoing) and not self.hung_up

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
                sent = self._ours.send(memoryview(self._outgoing)[:_AT_ONCE])
                del self._outgoing[:sent]
        except BlockingIOError:
            pass
        except OSError:  # the worker's exit code says more
            self._outgoing.clear()

    def messages(self) -> list[Any]:
        """Receive the messages since the last call. Raises ValueError for bytes that no worker
        sends."""
        with contextlib.suppress(BlockingIOError):
            while not self.hung_up:
                try:
                    received = self._ours.recv(_AT_ONCE)
                except ConnectionError:
                    received = b""
                self.hung_up = not received
                self._incoming += received
        messages = []
        while len(self._incoming) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(self._incoming)
            if length > MOST_BYTES:
                raise ValueError(f"a message of {length} bytes")
            end = LENGTH.size + length
            if len(self._incoming) < end:
                break
            message = bytes(memoryview(self._incoming)[LENGTH.size : end])
            del self._incoming[:end]
            try:
                messages.append(unpickle(message))
            except Exception as error:
                raise ValueError(f"{type(error).__name__}: {error}") from None
        return messages

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
        self._ours.close()
        self.close_worker_ends()
        if self.drain is not None:
            self.drain.close()
