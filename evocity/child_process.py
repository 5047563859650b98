"""Commands that start Python programs as children of this process."""

import os
import signal
import sys

#: The option of prctl(2) that sends a signal to a process when its parent ends.
PDEATHSIG = 1


def tie_to_parent(program: str) -> str:
    """Return a ``program`` for ``python -c`` that the system kills when its parent ends, from
    before its first import on. The parent is the thread of this process that starts it. Other
    systems than Linux return the program as it is."""
    if not sys.platform.startswith("linux"):
        return program
    return (
        f"import ctypes, os; ctypes.CDLL(None).prctl({PDEATHSIG}, {int(signal.SIGKILL)}, 0, 0, 0)"
        f"; os.getppid() == {os.getpid()} or os._exit(1); {program}"
    )


def python_command(program: str, tied: bool = False) -> list[str]:
    """Return a command for this Python and a ``program``, with the paths of this process; ``tied``:
    the program ends with the thread that starts it."""
    path = [place for place in sys.path if place]
    program = f"import sys; sys.path[:] = {path!r}; {program}"
    return [sys.executable, "-c", tie_to_parent(program) if tied else program]
