"""Processes on Linux: children, memory, signals and orphans; other systems report nothing here."""

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Collection
from functools import cache

from evocity.child_process import PDEATHSIG

LINUX = sys.platform.startswith("linux")

#: An option of prctl(2).
_CHILD_SUBREAPER = 36
#: Options of mallopt(3): freed memory that stays at the end of the heap, and the size of arrays
#: that have pages of their own.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
#: The most freed memory that a process keeps, and the largest array on its heap, bytes.
_KEPT, _LARGEST = 64 << 20, 32 << 20
#: Seconds that killed processes may take to end.
_SWEEP = 2.0
#: The most times that the processes of a session are listed and killed.
_ROUNDS = 20


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> None:
    """Make the system kill this process when the process ``parent`` ends."""
    _libc().prctl(PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


def outlive_parent() -> None:
    """Undo `die_with_parent`, and `tie_to_parent` of `evocity.child_process`: the end of the parent
    no longer kills this process."""
    _libc().prctl(PDEATHSIG, 0, 0, 0, 0)


def keep_freed_memory(most: int | None = None) -> None:
    """Let this process keep freed memory for its next arrays, at most ``most`` bytes, or 64 MiB.

    Otherwise Linux takes back large arrays, and clears new pages for the next ones. Without glibc
    nothing changes.
    """
    if not LINUX or not hasattr(_libc(), "mallopt"):
        return
    _libc().mallopt(_MMAP_THRESHOLD, _LARGEST)
    _libc().mallopt(_TRIM_THRESHOLD, _KEPT if most is None else min(most, _KEPT))


def adopt_orphans() -> None:
    """Make this process, and not init, the parent of descendants whose parents end."""
    _libc().prctl(_CHILD_SUBREAPER, 1, 0, 0, 0)


def children(pid: int) -> list[int]:
    """List the ids of the children of a process, also of those that ended and are not reaped."""
    ids: list[int] = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):
            with (
                contextlib.suppress(ProcessLookupError),
                open(f"/proc/{pid}/task/{thread}/children") as file,
            ):
                ids += map(int, file.read().split())
    except FileNotFoundError:  # the process is gone, or the kernel was built without this file
        if os.path.isdir(f"/proc/{pid}"):
            others = map(int, filter(str.isdigit, os.listdir("/proc")))
            return [other for other in others if _stat(other)[1:2] == [b"%d" % pid]]
    except OSError:
        pass
    return ids


def _stat(pid: int) -> list[bytes]:
    """Read the state, the parent and more of a process; empty if no such process exists."""
    with contextlib.suppress(OSError), open(f"/proc/{pid}/stat", "rb") as file:
        return file.read().rpartition(b")")[2].split()  # the name in brackets may hold anything
    return []


def descendants(pid: int) -> list[int]:
    """List the ids of the children of a process, of their children, and so on."""
    ids, following = [], [pid]
    while following:
        following = [one for parent in following for one in children(parent) if one not in ids]
        ids += following
    return ids


def kill(pid: int) -> None:
    """Send SIGKILL to a process, if it exists."""
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def kill_group(pid: int) -> None:
    """Send SIGKILL to the process group that ``pid`` leads, if there is one."""
    with contextlib.suppress(OSError):
        if pid > 1 and pid != os.getpgrp():
            os.killpg(pid, signal.SIGKILL)


def kill_session(pid: int) -> None:
    """Send SIGKILL to all processes of the session that ``pid`` leads or led. On other systems
    than Linux, only its own process group gets the signal."""
    kill_group(pid)
    if not LINUX or pid == os.getsid(0):
        return
    session = b"%d" % pid
    for _ in range(_ROUNDS):  # a killed process may have started another one meanwhile
        others = [
            one
            for one in map(int, filter(str.isdigit, os.listdir("/proc")))
            if (found := _stat(one)) and found[3] == session and found[0] not in (b"Z", b"X")
        ]
        if not others:
            return
        for one in others:
            kill(one)


def sweep(spared: Collection[int]) -> None:
    """Kill all but the ``spared`` children with their descendants; wait two seconds at most."""
    me, end = os.getpid(), time.monotonic() + _SWEEP
    while True:
        left = [one for one in children(me) if one not in spared]
        if not left:
            return
        for pid in left:
            for one in (pid, *descendants(pid)):
                kill(one)
        for pid in left:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)
        if time.monotonic() > end:
            return
        time.sleep(0.001)


def is_stopped(pid: int) -> bool:
    """Whether a signal has stopped a process, so that it cannot answer; False if unknown."""
    return _stat(pid)[:1] == [b"T"]


def has_children() -> bool:
    """Whether this process has children, ended or not, by one system call."""
    if not hasattr(os, "waitid"):
        return False
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def _pages(pid: int | str, field: int) -> int:
    with contextlib.suppress(OSError, ValueError, IndexError), open(f"/proc/{pid}/statm") as file:
        return int(file.read().split()[field]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def resident_memory(pid: int) -> int:
    """Return the bytes of memory that a process has; 0 if unknown."""
    return _pages(pid, 1)


def writable_memory() -> int:
    """Return the bytes that this process may write, about as RLIMIT_DATA counts; 0 if unknown."""
    return _pages("self", 5)


def _proportional_memory(pid: int) -> int:
    """Return the bytes of memory of a process, with its share of shared memory; slow to read."""
    with contextlib.suppress(OSError, ValueError), open(f"/proc/{pid}/smaps_rollup") as file:
        for line in file:
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    return 0


def added_memory(pid: int, before: int, allowed: int) -> int:
    """Return the bytes that a process and its descendants added to ``before``; above ``allowed``,
    shared memory counts once."""
    family = [pid, *descendants(pid)]
    added = sum(map(resident_memory, family)) - before
    if added > allowed and len(family) > 1:
        added = sum(map(_proportional_memory, family)) - before
    return added


def describe_exit_code(code: int | None) -> str:
    """Write an exit code with the name of its signal: -9 (SIGKILL)."""
    if code is not None and code < 0 and sys.platform != "win32":
        with contextlib.suppress(ValueError):
            return f"{code} ({signal.Signals(-code).name})"
    return str(code)
