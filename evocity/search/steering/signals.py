"""SIGTERM and SIGHUP, of `kill`, a shutdown or a closed terminal, end a search as Ctrl-C does."""

import contextlib
import signal
import threading
from collections.abc import Iterator

_NAMES = ("SIGTERM", "SIGHUP")


class Signalled(KeyboardInterrupt):
    """A signal arrived that ends the program; ``number``: which. The text is the signal's name."""

    def __init__(self, number: int):
        super().__init__(signal.Signals(number).name)
        self.number = number

    @property
    def exit_code(self) -> int:
        """The exit code that a shell expects: 128 and the signal's number, 143 or 129."""
        return 128 + self.number


@contextlib.contextmanager
def signals_raise() -> Iterator[None]:
    """Raise `Signalled` in the main thread at the first SIGTERM or SIGHUP within the block.

    An ignored signal stays ignored, as SIGHUP under `nohup`. In other threads, and on a system
    without these signals, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    before = {number: how for number, how in before.items() if how is signal.SIG_DFL}

    def interrupt(number: int, _) -> None:
        for other in before:  # the second does not cut short what the first began
            signal.signal(other, signal.SIG_IGN)
        raise Signalled(number)

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, how in before.items():
            signal.signal(number, how)
