"""Output of operators and measures: the beginning of each birth's is kept, the rest discarded."""

import contextlib
import io
import os
import sys
from functools import cache

from evocity.errors import plain_text

#: The most bytes that are kept of one birth's output.
MOST_PRINTED = 4096
#: The most bytes to drain at once, and the size of the pipe.
_AT_ONCE = 1 << 20


class Budget:
    """The bytes that the streams of a worker may still write in this birth."""

    def __init__(self):
        self.renew()

    def renew(self) -> None:
        """Start the budget of the next birth."""
        # one byte more than is kept, by which the main process knows that there was more
        self.left = MOST_PRINTED + 1


class _Capped(io.RawIOBase):
    """Writes to a file descriptor within the budget, and drops the rest at no cost."""

    def __init__(self, descriptor: int, budget: Budget):
        self._descriptor, self._budget = descriptor, budget

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def close(self) -> None:
        pass  # the next birth prints too

    def write(self, data) -> int:
        allowed = bytes(data[: max(self._budget.left, 0)])
        self._budget.left -= len(allowed)
        with contextlib.suppress(OSError):
            while allowed:
                allowed = allowed[os.write(self._descriptor, allowed) :]
        return len(data)


def stream(descriptor: int, budget: Budget) -> io.TextIOWrapper:
    """Make a text stream that replaces `sys.stdout` or `sys.stderr`."""
    raw = _Capped(descriptor, budget)
    return io.TextIOWrapper(raw, encoding="utf-8", errors="backslashreplace", write_through=True)


class Drain:
    """The main process's end of the pipe that a worker prints into. It keeps `MOST_PRINTED` bytes
    of a birth; ``flooded`` says that the birth printed more, and must wait."""

    def __init__(self, descriptor: int):
        self.descriptor = descriptor
        self._kept = bytearray()
        self.flooded = False
        self.ended = False
        os.set_blocking(descriptor, False)
        if hasattr(os, "splice"):
            import fcntl

            with contextlib.suppress(OSError, AttributeError):
                fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, _AT_ONCE)

    def drain(self) -> None:
        """Read what the pipe holds, but at most `_AT_ONCE` bytes of endless output."""
        total = 0
        with contextlib.suppress(BlockingIOError):
            while total < _AT_ONCE:
                size = self._read()
                if not size:
                    self.ended = True
                    return
                total += size

    def _read(self) -> int:
        left = MOST_PRINTED + 1 - len(self._kept)
        if left > 0:
            printed = os.read(self.descriptor, left)
            self._kept += printed
            self.flooded = len(self._kept) > MOST_PRINTED
            return len(printed)
        if hasattr(os, "splice"):  # it copies nothing
            return os.splice(self.descriptor, _dev_null(os.getpid()), _AT_ONCE)
        return len(os.read(self.descriptor, 1 << 16))

    def text(self) -> str:
        """Return the output since the last call, ready to show; "" if there was none."""
        self.drain()
        kept, more = bytes(self._kept[:MOST_PRINTED]), self.flooded
        self._kept.clear()
        self.flooded = False
        text = kept.decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n")
        text = plain_text(text, "\n\t")
        if text and not text.endswith("\n"):
            text += "\n"
        return text + "… (this birth printed more, which is not kept)\n" if more else text

    def close(self) -> None:
        with contextlib.suppress(OSError):
            os.close(self.descriptor)


@cache
def _dev_null(process: int) -> int:
    return os.open(os.devnull, os.O_WRONLY)


def show(text: str) -> None:
    """Print a ``text`` for the user on standard error: standard output is for results."""
    if text and sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)
            sys.stderr.flush()
