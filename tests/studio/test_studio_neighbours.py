"""What other accounts and programs of the machine see of studio, and take from its user."""

import contextlib
import html
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest
from asking import Client

from evocity.evaluation import linux_processes
from evocity.studio import browser
from evocity.studio.connections import MOST_OWN, MOST_STRANGERS, Connections
from evocity.studio.server import HOST, running_server

linux = pytest.mark.skipif(not linux_processes.LINUX, reason="what Linux gives")
#: The account that may do least.
NOBODY = 65534


def commands() -> list[bytes]:
    """The arguments of all processes of the machine."""
    found = []
    for one in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            found.append(Path(f"/proc/{one}/cmdline").read_bytes())
    return found


def until(condition, seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


# -- the address in the browser ------------------------------------------------------------------


@pytest.fixture
def addresses(monkeypatch):
    """What a browser is opened with."""
    found = []
    monkeypatch.setattr(webbrowser, "open", found.append)
    return found


def test_the_browser_gets_a_file_that_its_user_alone_can_read(addresses):
    opened, url = threading.Event(), "http://127.0.0.1:8400/?token=a&b"
    with browser.opened_browser(url, opened):
        until(lambda: addresses)
        assert "token" not in addresses[0]
        path = Path(addresses[0].removeprefix("file://"))
        assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)
        (target,) = re.findall(r"0; url=([^\"]+)\"", path.read_text())
        assert html.unescape(target) == url
        if linux_processes.LINUX and os.geteuid() == 0:
            words = ["cat", str(path)]
            done = subprocess.run(words, user=NOBODY, group=NOBODY, capture_output=True, cwd="/")
            assert b"Permission denied" in done.stderr
        opened.set()
        until(lambda: not path.exists())
    assert not path.parent.exists()


def test_without_a_temporary_folder_no_browser_opens(addresses, monkeypatch, tmp_path):
    monkeypatch.setattr(browser.ProcessFolder, "__init__", lambda *_: os.mkdir(tmp_path))
    with browser.opened_browser("http://127.0.0.1:1/", threading.Event()):
        time.sleep(0.05)
    assert addresses == []


@pytest.mark.slow
@linux
def test_the_token_stands_on_no_command_line(night, tmp_path):
    told = tmp_path / "told"
    program = tmp_path / "browser"
    program.write_text(f'#!/bin/sh\necho "$@" > {told}.new; mv {told}.new {told}; sleep 600\n')
    program.chmod(0o755)
    words = [sys.executable, "-m", "evocity", "studio", str(night), "--json"]
    environment = {**os.environ, "TMPDIR": str(tmp_path), "BROWSER": f"{program} %s"}
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as running,
        contextlib.ExitStack() as ended,
    ):
        ended.callback(running.kill)
        url = json.loads(running.stdout.readline())["url"]
        token = url.partition("token=")[2]
        assert len(token) > 40
        until(told.exists)
        assert any(b"studio.html" in one for one in commands())  # the browser is found
        assert not any(token.encode() in one for one in commands())
        path = Path(told.read_text().strip().removeprefix("file://"))
        assert token in path.read_text()
        port = int(re.search(r":(\d+)/", url)[1])
        Client(SimpleNamespace(url=url, port=port)).open()
        until(lambda: not path.exists())
        assert path.parent.exists()
        for pid in linux_processes.descendants(running.pid):
            os.kill(pid, signal.SIGKILL)
        running.send_signal(signal.SIGTERM)
        running.wait(120)
    assert not path.parent.exists()


OPENING = [("Sec-Fetch-Mode", "navigate"), ("Sec-Fetch-Dest", "document")]
FILE = ("Sec-Fetch-Site", "cross-site")  # so a browser calls a file


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("{token}", [FILE, *OPENING], 200),
        ("/", [FILE, *OPENING], 403),
        ("/?token=guessed", [FILE, *OPENING], 403),
        ("/api/0/births", [FILE, *OPENING], 403),
        ("{token}", [FILE], 403),
        ("{token}", [FILE, OPENING[0]], 403),
        ("{token}", [FILE, OPENING[0], ("Sec-Fetch-Dest", "iframe")], 403),
        ("{token}", [FILE, ("Sec-Fetch-Mode", "no-cors"), OPENING[1]], 403),
        ("{token}", [FILE, *OPENING, ("Origin", "null")], 403),
    ],
)
def test_a_file_with_the_token_leads_to_the_page_and_nothing_else_does(
    night, path, headers, status
):
    with running_server(night) as server:
        client = Client(server)
        path = path.format(token=server.url.removeprefix(client.origin))
        told = client.ask("GET", path, headers)
        assert told.status == status
        assert ("set-cookie" in told.headers) == (status == 200)
        assert server.opened.is_set() == (status == 200)
        if status == 200:  # the page itself follows, which its own site asks for
            assert b"url=/" in told.content
            assert b"script" not in told.content


# -- connections ---------------------------------------------------------------------------------


@pytest.fixture
def many_files():
    """As many open files as these tests need."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 4096:
        pytest.skip("too few files may be open")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 4096), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def is_open(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) != b""
    except BlockingIOError:
        return True
    except OSError:
        return False


@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\nHost: "], ids=["silent", "half"])
def test_a_thousand_idle_connections_keep_no_user_out(night, many_files, said):
    with running_server(night) as server, contextlib.ExitStack() as stack:
        client = Client(server)
        client.open()
        kept = http.client.HTTPConnection(HOST, server.port, timeout=120)
        stack.callback(kept.close)

        def ask_again() -> None:
            kept.request("GET", "/api/runs", headers={"Cookie": client.cookie})
            with kept.getresponse() as answer:
                assert answer.status == 200
                answer.read()

        ask_again()
        idle = []
        for number in range(1000):
            connection = stack.enter_context(socket.create_connection((HOST, server.port), 120))
            if said:
                with contextlib.suppress(OSError):
                    connection.sendall(said)
            connection.setblocking(False)
            idle.append(connection)
            if number % 100 == 99:
                assert client.get("/api/runs").status == 200
                ask_again()
        for _ in range(20):
            assert client.get("/api/0/picks").status == 200
        until(lambda: sum(map(is_open, idle)) <= MOST_STRANGERS)
        ask_again()


class Counted:
    """A connection that only counts."""

    def __init__(self, is_idle: bool = True):
        self.is_idle, self.dropped = is_idle, False

    def drop(self) -> None:
        self.dropped = True


def test_the_oldest_stranger_leaves_first_and_no_own_connection_for_it():
    connections = Connections()
    own = [Counted() for _ in range(MOST_OWN)]
    for one in own:
        connections.add(one)
        connections.trust(one)
        connections.trust(one)
    strangers = [Counted() for _ in range(MOST_STRANGERS + 3)]
    for one in strangers:
        connections.add(one)
    assert [one.dropped for one in strangers] == [True] * 3 + [False] * MOST_STRANGERS
    assert not any(one.dropped for one in own)
    connections.remove(strangers[3])
    connections.add(late := Counted())
    assert not strangers[4].dropped
    connections.trust(strangers[0])  # which is dropped, and does not count again
    assert not any(one.dropped for one in own)
    own[0].is_idle = False
    connections.trust(late)
    assert [one.dropped for one in own] == [False, True] + [False] * (MOST_OWN - 2)


# -- the end -------------------------------------------------------------------------------------


@pytest.mark.slow
@linux
@pytest.mark.parametrize("seconds", [0.0, 2.0])
def test_ctrl_c_just_after_a_brood_began_ends_all_at_once(night, tmp_path, seconds):
    """Also while kernels are compiled, which takes minutes."""
    environment = {
        **os.environ,
        "TMPDIR": str(tmp_path),
        "NUMBA_CACHE_DIR": str(tmp_path / "numba"),
    }
    words = [sys.executable, "-m", "evocity", "studio", str(night), "--no-browser", "--json"]
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as running,
        contextlib.ExitStack() as ended,
    ):
        ended.callback(running.kill)
        url = json.loads(running.stdout.readline())["url"]
        client = Client(SimpleNamespace(url=url, port=int(re.search(r":(\d+)/", url)[1])))
        client.open()
        brood = {"operators": ["pavement_fusion"], "parents": [3, 20], "count": 6}
        assert client.post("/api/0/breed", brood).status == 200
        time.sleep(seconds)
        family = linux_processes.descendants(running.pid)
        began = time.monotonic()
        running.send_signal(signal.SIGINT)
        assert running.wait(120) == 130
        assert time.monotonic() - began < 20  # 0.8 s on a machine with nothing else to do
    until(lambda: all(linux_processes._stat(one)[:1] in ([], [b"Z"]) for one in family), 20.0)
