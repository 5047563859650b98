"""What Linux tells of processes, and what it does at their end; other systems tell nothing here."""

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Collection
from functools import cache

LINUX = sys.platform.startswith("linux")

#: Of prctl(2).
_PDEATHSIG, _CHILD_SUBREAPER = 1, 36
#: Seconds that killed processes may take to be gone.
_SWEEP = 2.0


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> None:
    """Have the system kill this process when ``parent`` (its id) ends, whatever runs here then."""
    _libc().prctl(_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:  # it ended before
        os._exit(1)


def adopt_orphans() -> None:
    """Have descendants whose parents end become children of this process, and not of init."""
    _libc().prctl(_CHILD_SUBREAPER, 1, 0, 0, 0)


def children(pid: int) -> list[int]:
    """Ids of the children of a process, those that ended and were not waited for too."""
    found: list[int] = []
    try:
        for thread in os.listdir(f"/proc/{pid}/task"):
            with (
                contextlib.suppress(ProcessLookupError),
                open(f"/proc/{pid}/task/{thread}/children") as file,
            ):
                found += map(int, file.read().split())
    except FileNotFoundError:  # the process is gone, or the kernel was built without this file
        return _listed(pid) if os.path.isdir(f"/proc/{pid}") else found
    except OSError:
        return found
    return found


def _listed(parent: int) -> list[int]:
    found = []
    for name in os.listdir("/proc"):
        if name.isdigit():
            with contextlib.suppress(OSError, ValueError), open(f"/proc/{name}/stat", "rb") as file:
                # the name before the last bracket may hold anything
                if int(file.read().rpartition(b")")[2].split()[1]) == parent:
                    found.append(int(name))
    return found


def descendants(pid: int) -> list[int]:
    """Ids of the children of a process, of theirs, and so on."""
    found, following = [], [pid]
    while following:
        following = [one for parent in following for one in children(parent) if one not in found]
        found += following
    return found


def kill(pid: int) -> None:
    """SIGKILL, if the process is there."""
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def kill_group(pid: int) -> None:
    """SIGKILL to all of the process group that ``pid`` leads, if there is one."""
    with contextlib.suppress(OSError):
        if pid > 1 and pid != os.getpgrp():
            os.killpg(pid, signal.SIGKILL)


def sweep(spared: Collection[int]) -> None:
    """Kill the children of this process but those ``spared``, with all their descendants, and wait
    for them, two seconds at most. Those of a killed child come to this process if it adopts
    orphans, and are killed then."""
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
    """Whether a process stands still by a signal, and so cannot answer; False where not told."""
    with contextlib.suppress(OSError, IndexError), open(f"/proc/{pid}/stat", "rb") as file:
        return file.read().rpartition(b")")[2].split()[0] == b"T"
    return False


def has_children() -> bool:
    """Whether this process has any, ended or not: one call to the system."""
    if not hasattr(os, "waitid"):
        return False
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def resident(pid: int) -> int:
    """Bytes of memory that a process has; 0 where that is not told."""
    with contextlib.suppress(OSError, ValueError, IndexError), open(f"/proc/{pid}/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def proportional(pid: int) -> int:
    """Bytes of memory that a process has, what several share by its share; dear to ask."""
    with contextlib.suppress(OSError, ValueError), open(f"/proc/{pid}/smaps_rollup") as file:
        for line in file:
            if line.startswith("Pss:"):
                return int(line.split()[1]) * 1024
    return 0


def taken(pid: int, before: int, allowed: int) -> int:
    """Bytes of memory that a process and its descendants have, less those it had ``before``; looked
    at more closely where they seem more than ``allowed``."""
    family = [pid, *descendants(pid)]
    found = sum(map(resident, family)) - before
    if found > allowed and len(family) > 1:  # what they share counts once
        found = sum(map(proportional, family)) - before
    return found


def own_data() -> int:
    """Bytes that this process may write, much as RLIMIT_DATA counts; 0 where not told."""
    with contextlib.suppress(OSError, ValueError, IndexError), open("/proc/self/statm") as file:
        return int(file.read().split()[5]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def code_told(code: int | None) -> str:
    """An exit code in words: -9 (SIGKILL)."""
    if code is not None and code < 0 and sys.platform != "win32":
        with contextlib.suppress(ValueError):
            return f"{code} ({signal.Signals(-code).name})"
    return str(code)
