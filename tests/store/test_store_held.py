"""Is a run being written? Who only looks changes nothing and keeps nobody out."""

import subprocess
import sys
import threading
import time

import pytest

from evocity.errors import RunError
from evocity.store import lock
from evocity.store.lock import Lock, is_held
from evocity.store.run_directory import RunDirectory

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks of POSIX can be shared")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "lock"


def test_it_is_held_from_taking_to_release(path):
    assert not is_held(path)
    assert not path.exists()
    held = Lock(RunDirectory(path.parent))
    assert is_held(path)
    held.release()
    assert not is_held(path)
    assert path.read_bytes() == b""


def test_a_dead_process_holds_nothing(path):
    program = (
        "import sys, time; from evocity.store.lock import Lock;"
        "from evocity.store.run_directory import RunDirectory;"
        "held = Lock(RunDirectory(sys.argv[1])); print('held', flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen([sys.executable, "-c", program, path.parent], stdout=subprocess.PIPE)
    assert holder.stdout.readline().strip() == b"held"
    assert is_held(path)
    holder.kill()
    holder.communicate()
    assert not is_held(path)


def test_who_looks_keeps_nobody_out(path):
    Lock(RunDirectory(path.parent)).release()
    with open(path, "rb") as looking:
        lock._share(looking)
        assert not is_held(path)  # two may look
        threading.Thread(target=lambda: (time.sleep(0.015), looking.close())).start()
        Lock(RunDirectory(path.parent)).release()


def test_a_link_is_refused(path, tmp_path):
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RunError, match="link"):
        is_held(path)
    assert not (tmp_path / "elsewhere").exists()


def test_what_knows_no_locks_is_held_by_nobody(path, monkeypatch):
    path.touch()

    def fails(file):
        raise OSError("no locks here")

    monkeypatch.setattr(lock, "_share", fails)
    assert not is_held(path)
