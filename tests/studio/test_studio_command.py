"""`evocity studio` as it is typed: what is printed, how it ends, what it needs."""

import contextlib
import json
import os
import posixpath
import re
import signal
import subprocess
import sys
import urllib.parse
import urllib.request
from http.cookiejar import CookieJar
from types import SimpleNamespace

import pytest
from asking import Client, contents
from brought import bring, footprints
from click.testing import CliRunner

import evocity
from evocity.cli import main
from evocity.search.steering.stop_rules import Signalled, signals_raise
from evocity.studio.answers import page_files
from evocity.studio.server import _hangup_ends

EVOCITY = (sys.executable, "-m", "evocity")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("kind", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_it_prints_its_address_answers_and_ends_with_a_signal(night, kind, tmp_path):
    before = contents(night)
    words = [*EVOCITY, "studio", str(night), "--no-browser", "--json"]
    running = subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        preexec_fn=lambda: signal.signal(getattr(signal, kind), signal.SIG_DFL),  # under nohup too
    )
    with running, contextlib.ExitStack() as ended:
        ended.callback(running.kill)
        line = running.stdout.readline()
        told = json.loads(line)
        assert list(told) == ["url"]
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
        with browser.open(told["url"], timeout=120) as answer:
            page = answer.read()
        assert (answer.status, page) == (200, page_files()["/"][1])
        with browser.open(told["url"].partition("?")[0] + "api/0/births", timeout=120) as answer:
            assert answer.status == 200
        address = urllib.parse.urlsplit(told["url"])
        client = Client(SimpleNamespace(url=told["url"], port=address.port))
        client.open()
        bring(client, "own.geojson", footprints(tmp_path / "own.geojson", 1).read_bytes())
        assert list(tmp_path.glob("evocity-desk-*"))
        os.killpg(running.pid, getattr(signal, kind))
        out, err = running.communicate(timeout=120)
    assert out == ""  # one line was all
    assert "Traceback" not in err
    assert running.returncode == 128 + getattr(signal, kind)
    assert list(tmp_path.glob("evocity-desk-*")) == []
    assert contents(night) == before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="a signal of POSIX")
def test_a_terminal_that_closes_in_the_middle_of_an_answer_ends_it_after_that():
    server, answered = SimpleNamespace(should_exit=False), []

    def served():
        with signals_raise(), _hangup_ends(server):
            signal.raise_signal(signal.SIGHUP)
            answered.append(server.should_exit)

    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup too
    try:
        with pytest.raises(Signalled):
            served()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)
    assert answered == [True]


@pytest.mark.slow
def test_without_a_run_it_begins_at_the_desk_and_writes_nothing(tmp_path):
    own = tmp_path / "own.py"
    own.write_text(
        "import evocity\n@evocity.fitness(goal='max')\ndef own(city):\n"
        "    print('noise')\n    return 1.0\n"
    )
    (tmp_path / "here").mkdir()
    words = [*EVOCITY, "studio", "--no-browser", "--json", "--fitness", str(own)]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path / "here"
    ) as running:
        told = json.loads(running.stdout.readline())
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
        browser.open(told["url"], timeout=120).close()
        address = told["url"].partition("?")[0] + "api/desk"
        with browser.open(address, timeout=120) as answer:
            desk = json.loads(answer.read())
        with browser.open(f"{address}-measures", timeout=120) as answer:
            assert "own" in [one["name"] for one in json.loads(answer.read())["measures"]]
        running.terminate()
        out, err = running.communicate(timeout=120)
    assert (out, "Traceback" in err) == ("", False)
    assert desk["home"] == str(tmp_path / "here" / "runs")
    assert list((tmp_path / "here").iterdir()) == []


def refused(*words) -> str:
    done = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert (done.exit_code, done.stdout) == (2, "")
    return done.stderr


def test_without_the_extra_it_is_named(night, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    told = refused("studio", night)
    assert "uvicorn" in told
    assert "pip install 'evocity[studio]'" in told


def test_what_is_no_run_is_refused(tmp_path):
    for words in ([tmp_path / "none"], ["--runs", tmp_path / "none"]):
        told = refused("studio", *words, "--no-browser")
        assert told.count("expected:") == told.count("what to do:") == 1
    said = refused("studio", "--fitness", "gsi")
    assert "--fitness gsi" in said
    assert "evocity's own measures" in said  # and of no other package, which `fitness list` names
    assert "none.toml" in refused("studio", "--recipe", tmp_path / "none.toml")


def test_who_reaches_the_cluster_of_a_recipe_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("evocity.studio.server.serve", lambda *given, **more: None)
    recipe = tmp_path / "far.toml"
    for kind, said in (("tcp", True), ("tls", False)):
        line = f'[evaluation]\ncluster = "{kind}://10.0.0.1:8786"\n'
        recipe.write_text(evocity.read_recipe("demo").text.replace("[evaluation]\n", line))
        done = CliRunner().invoke(main, ["studio", "--recipe", str(recipe)])
        assert done.exit_code == 0
        assert ("Note: the cluster at tcp://10.0.0.1:8786 uses no TLS" in done.stderr) == said


def imported(page, roots: set[str]) -> set[str]:
    """The addresses that load with those of ``roots``."""
    found, left = set(), set(roots)
    while left:
        address = left.pop()
        found.add(address)
        if address.endswith(".js"):
            text = page[address][1].decode()
            names = re.findall(r'^import [^;]*? from "([^"]+)";', text, re.M)
            left |= {posixpath.normpath(posixpath.join(address, "..", one)) for one in names}
            left -= found
    return found


def test_the_page_is_small_and_asks_nothing_of_another_host():
    page = page_files()
    assert {"/", "/page/studio.js", "/page/viewer.js"} <= set(page)
    first = imported(page, {one for one in page if not one.endswith(".js")} | {"/page/studio.js"})
    parts = {"desk": 65_000, "board": 30_000, "space": 60_000, "modeller": 80_000}
    for name, most in parts.items():  # which load at their first use
        later = imported(page, {f"/page/{name}.js"}) - first
        assert later
        assert sum(len(page[one][1]) for one in later) < most, name
    assert sum(len(page[one][1]) for one in first) < 250_000
    for address, (_, content) in page.items():
        text = content.decode().replace(
            "http://www.w3.org/2000/svg", ""
        )  # names SVG, loads nothing
        for forbidden in (
            "innerHTML",
            "outerHTML",
            "insertAdjacent",
            "document.write",
            "eval(",
            "Function(",
            "http:",
            "https:",
            "WebSocket",
            "EventSource",
            "style=",
            "onclick",
        ):
            assert forbidden not in text, f"{address}: {forbidden}"
