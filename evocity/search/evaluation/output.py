"""What operators and measures print: so much of it is kept a birth, the rest goes nowhere."""

import contextlib
import io
import os
import re
import sys

#: Bytes that are kept of what one birth prints.
MOST_PRINTED = 4096
#: Bytes that are drained at once, and those that a pipe holds.
_AT_ONCE = 1 << 20

# Whatever moves the cursor or colours a terminal; a return becomes a new line.
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


class Budget:
    """What the streams of a worker may still print in this birth, in bytes."""

    def __init__(self):
        self.left = 0
        self.renew()

    def renew(self) -> None:
        # one more than is kept, by which the main process knows that there was more
        self.left = MOST_PRINTED + 1


class _Capped(io.RawIOBase):
    """Writes to a file descriptor as much as the budget has; the rest is dropped at no cost."""

    def __init__(self, descriptor: int, budget: Budget):
        self._descriptor, self._budget = descriptor, budget

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def close(self) -> None:
        pass  # another birth prints too

    def write(self, data) -> int:
        told = bytes(data[: max(self._budget.left, 0)])
        self._budget.left -= len(told)
        with contextlib.suppress(OSError):
            while told:
                told = told[os.write(self._descriptor, told) :]
        return len(data)


def stream(descriptor: int, budget: Budget) -> io.TextIOWrapper:
    """A text stream in place of `sys.stdout` or `sys.stderr`."""
    raw = _Capped(descriptor, budget)
    return io.TextIOWrapper(raw, encoding="utf-8", errors="backslashreplace", write_through=True)


class Drain:
    """The main process's end of the pipe that a worker prints into: never full for long.

    What the current birth printed is kept up to `MOST_PRINTED` bytes; ``flooded`` tells that it
    printed more, and need not be looked at all the time: who prints on waits then.
    """

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
        """Take what is there, so much that an endless printer cannot keep the reader."""
        taken = 0
        with contextlib.suppress(BlockingIOError):
            while taken < _AT_ONCE:
                got = self._take()
                if not got:
                    self.ended = True
                    return
                taken += got

    def _take(self) -> int:
        left = MOST_PRINTED + 1 - len(self._kept)
        if left > 0:
            got = os.read(self.descriptor, left)
            self._kept += got
            self.flooded = len(self._kept) > MOST_PRINTED
            return len(got)
        if hasattr(os, "splice"):  # nothing of it is copied
            return os.splice(self.descriptor, _nowhere(), _AT_ONCE)
        return len(os.read(self.descriptor, 1 << 16))

    def text(self) -> str:
        """What was printed since the last time, ready to be shown; "" if nothing was."""
        self.drain()
        kept, more = bytes(self._kept[:MOST_PRINTED]), self.flooded
        self._kept.clear()
        self.flooded = False
        told = kept.decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n")
        told = _CONTROL.sub("", told)
        if told and not told.endswith("\n"):
            told += "\n"
        return told + "… (this birth printed more, which is not kept)\n" if more else told

    def close(self) -> None:
        with contextlib.suppress(OSError):
            os.close(self.descriptor)


_descriptors: dict[int, int] = {}


def _nowhere() -> int:
    if os.getpid() not in _descriptors:
        _descriptors[os.getpid()] = os.open(os.devnull, os.O_WRONLY)
    return _descriptors[os.getpid()]


def show(text: str) -> None:
    """Print it where the user sees it, standard output being for results."""
    if text and sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)
            sys.stderr.flush()
