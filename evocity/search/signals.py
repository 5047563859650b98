"""Signals that end a search as Ctrl-C does: SIGTERM, of `kill` and of a shutdown, and SIGHUP, of a
terminal that closes."""

import contextlib
import signal
import threading
from collections.abc import Iterator

_NAMES = ("SIGTERM", "SIGHUP")


class Signalled(KeyboardInterrupt):
    """A signal came that ends the program; ``number``: which. Its text is the signal's name."""

    def __init__(self, number: int):
        super().__init__(signal.Signals(number).name)
        self.number = number

    @property
    def exit_code(self) -> int:
        """What a shell expects: 128 and the signal's number, 143 or 129."""
        return 128 + self.number


@contextlib.contextmanager
def signals_raise() -> Iterator[None]:
    """Within, SIGTERM and SIGHUP raise `Signalled` in the main thread, once. What is ignored, as
    SIGHUP under `nohup`, stays so. Nothing changes in other threads, nor on a system without them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    before = {number: how for number, how in before.items() if how is signal.SIG_DFL}

    def ended(number: int, _) -> None:
        for other in before:  # the second does not cut short what the first began
            signal.signal(other, signal.SIG_IGN)
        raise Signalled(number)

    for number in before:
        signal.signal(number, ended)
    try:
        yield
    finally:
        for number, how in before.items():
            signal.signal(number, how)


__all__ = ["Signalled", "signals_raise"]
