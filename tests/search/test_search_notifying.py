"""A user's commands: told of what is better and of every end, beside the search, and no harm."""

import os
import sys
import time
from math import nan
from pathlib import Path

import pytest
from test_search_recipe import faults
from test_search_run import rows, run

from evocity.errors import RunError
from evocity.evaluation import linux_processes
from evocity.evaluation.linux_processes import LINUX
from evocity.recipe.stop_and_notify import NotifySection, words_of
from evocity.search import Generation, Observer, Search, read_recipe
from evocity.search.steering.notification import (
    CommandRunner,
    Notification,
    Notifier,
    missing_programs,
)
from evocity.store import RunLog

if os.name == "nt":
    pytest.skip("the commands here are those of POSIX", allow_module_level=True)

PYTHON = sys.executable
#: Writes its arguments as a line of a file.
TELL = """
import sys, time
with open("told.txt", "a") as file:
    file.write("|".join(sys.argv[1:]) + "\\n")
print("said", sys.argv[1])
"""


def notified(path) -> list[dict]:
    return [one for one in RunLog(path).events() if one["event"] == "notify"]


@pytest.fixture
def telling(toy, tmp_path):
    (tmp_path / "tell.py").write_text(TELL)

    def write(lines: str = "", **settings):
        ask = f"{PYTHON} tell.py {{event}} {{generation}} '{{reason}}' {{run}} {{hypervolume}}"
        ask += " '{best}'"
        both = f'[notify]\non_improvement = "{ask}"\non_end = "{ask}"\n'
        return toy(recipe=lines or both, **settings)

    return write


def told(folder: Path) -> list[list[str]]:
    path = folder / "told.txt"
    return [one.split("|") for one in path.read_text().splitlines()] if path.exists() else []


# -- what is told --------------------------------------------------------------------------------


def test_what_got_better_and_the_end_are_told(telling, tmp_path, monkeypatch):
    out = tmp_path / "run"
    runners, init = [], CommandRunner.__init__
    monkeypatch.setattr(
        CommandRunner,
        "__init__",
        lambda self, *given: (runners.append(self), init(self, *given))[1],
    )
    until = time.monotonic() + 120
    with Search(read_recipe(telling(), generations=6), out=out, workers=0) as search:
        for _ in search:  # each command has ended before the next generation has
            while any(one._thread is not None for one in runners):
                assert time.monotonic() < until
                time.sleep(0.02)
    history = RunLog(out).history()
    volumes = [one["hypervolume"] for one in history]
    better = [k for k in range(1, 7) if volumes[k] > max(volumes[:k])]
    assert better
    *improved, last = told(tmp_path)
    assert [(one[0], int(one[1])) for one in improved] == [("improvement", k) for k in better]
    k = better[0]
    assert improved[0][2] == f"{volumes[k]:.6g} reached, before {max(volumes[:k]):.6g}"
    assert last[:4] == ["finish", "6", "all generations are done", str(out)]
    assert last[4] == f"{volumes[-1]:.6g}"
    assert last[5].startswith("spread ")
    events = notified(out)
    assert [(one["on"], one["generation"]) for one in events] == [
        *(("on_improvement", k) for k in better),
        ("on_end", 6),
    ]
    assert {one["code"] for one in events} == {0}
    assert {one["output"] for one in events} == {"said improvement", "said finish"}
    assert RunLog(out).status()["finished"]


def test_a_generation_of_which_nothing_is_known_hides_no_improvement(monkeypatch):
    asked = []
    monkeypatch.setattr(Notifier, "_notify", lambda self, key, **told: asked.append(told["reason"]))
    notifier = Notifier(NotifySection(), None, None, lambda *a, **k: None)
    for number, progress in enumerate([nan, 1.0, nan, 2.0, nan, 2.0, 3.0]):
        told = Generation(number, 8, 0, progress, {}, 1.0, 0.0, [], 0)
        notifier.generation(told, [], [])
    assert asked == ["2 reached, before 1", "3 reached, before 2"]


def test_it_changes_no_birth_and_goes_on_when_it_is_resumed(telling, tmp_path):
    run(telling(" "), tmp_path / "plain", workers=0, generations=4)
    out = tmp_path / "run"
    with Search(read_recipe(telling(), generations=4), out=out, workers=0) as search:
        for generation in search:
            if generation.number == 1:
                break
    assert told(tmp_path)[-1][:3] == ["stop", "1", "left"]
    best = max(one["hypervolume"] for one in RunLog(out).history())
    with Search.resume(out, workers=0) as search:
        found = list(search)
    assert rows(out) == rows(tmp_path / "plain")
    after = [int(one[1]) for one in told(tmp_path) if one[0] == "improvement" and int(one[1]) > 1]
    if any(one.hypervolume > best for one in found):  # what was reached before is no news
        assert found[after[0] - 2].hypervolume > best


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (KeyboardInterrupt(), "interrupted"),
        (ValueError("odd"), "ValueError: odd"),
        (None, "left"),
    ],
)
def test_every_end_is_told(telling, tmp_path, error, reason):
    def leave():
        with Search(read_recipe(telling()), out=tmp_path / "run", workers=0) as search:
            next(iter(search))
            if error is not None:
                raise error

    if error is None:
        leave()
    else:
        with pytest.raises(type(error)):
            leave()
    assert told(tmp_path)[-1][:3] == ["stop", "0", reason]


def test_an_end_is_told_though_nothing_can_be_written(telling, tmp_path):
    out = tmp_path / "run"

    def lose():
        with Search(read_recipe(telling()), out=out, workers=0) as search:
            for _ in search:
                if out.exists():
                    out.rename(tmp_path / "gone")

    with pytest.raises(RunError):
        lose()
    assert told(tmp_path)[-1][0] == "stop"
    assert "RunError" in told(tmp_path)[-1][2]


def test_a_search_that_never_begins_is_told_too(telling, tmp_path):
    recipe = read_recipe(telling())
    (tmp_path / "left.npy").write_bytes(b"no map")
    with pytest.raises(Exception, match="left"), Search(recipe, tmp_path / "run", 0) as search:
        search.prepare()
    assert told(tmp_path)[-1][0] == "stop"
    assert told(tmp_path)[-1][2].startswith("MapError: ")


# -- no harm -------------------------------------------------------------------------------------


def test_an_end_before_another_generation_is_told_with_where_the_run_is(telling, tmp_path):
    out = tmp_path / "run"
    with Search(read_recipe(telling(), generations=1), out=out, workers=0) as search:
        list(search)
    late = {"generations": 2, "until": "2020-01-01T07:00"}
    with Search.resume(out, workers=0, **late) as search:
        assert list(search) == []
    first, last = told(tmp_path)[-2:]
    assert first[0] == "finish"
    assert last[:3] == ["stop", "1", f"it is past {late['until'].replace('T', ' ')}"]
    assert last[3:] == first[3:]
    assert notified(out)[-1]["generation"] == 1


def errand(words, folder, key="on_improvement") -> Notification:
    return Notification(key, 3, words, Path(folder))


def test_commands_follow_each_other_and_the_last_alone_waits(tmp_path):
    script = (
        "import os, sys, time\nopen('log', 'a').write(f'{sys.argv[1]}+')\n"
        "while not os.path.exists('go'): time.sleep(.02)\nopen('log', 'a').write('-')"
    )
    runner, until = CommandRunner(240.0), time.monotonic() + 240
    for number in range(5):
        runner.start(errand([PYTHON, "-c", script, str(number)], tmp_path))  # waits for none
        while not (tmp_path / "log").exists() and time.monotonic() < until:
            time.sleep(0.02)
    (tmp_path / "go").touch()
    while len(ended := runner._results) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    assert [one["code"] for one in ended] == [0, 0]
    assert (tmp_path / "log").read_text() == "0+-4+-"
    runner.close(1.0)


def test_a_command_has_a_deadline_and_leaves_nothing(tmp_path):
    psutil = pytest.importorskip("psutil")
    script = "sleep 600 & echo $! > new; mv new pid; sleep $0"  # begins at once, on any machine
    for seconds, code in ((600, None), (0, 0)):
        runner = CommandRunner(2.0 if code is None else 120.0)
        runner.start(errand(["sh", "-c", script, str(seconds)], tmp_path))
        runner.close(240.0)
        (ended,) = runner.take_results()
        assert ended["code"] == code
        assert ended.get("reason") == ("it took more than 2 s" if code is None else None)
        pid = int((tmp_path / "pid").read_text())
        until = time.monotonic() + 60
        while psutil.pid_exists(pid) and psutil.Process(pid).status() != "zombie":
            assert time.monotonic() < until
            time.sleep(0.02)


@pytest.mark.skipif(not LINUX, reason="Linux lists sessions")
def test_a_child_with_a_process_group_of_its_own_ends_but_one_with_a_session_stays(tmp_path):
    script = (
        "import os, time\n"
        "for detach in (os.setpgrp, os.setsid):\n"
        "    if not os.fork():\n"
        "        detach()\n"
        "        open(detach.__name__, 'w').write(str(os.getpid()))\n"
        "        for low in range(3): os.close(low)\n"
        "        time.sleep(600)\n"
        "while not all(map(os.path.exists, ('setpgrp', 'setsid'))): time.sleep(.01)"
    )
    runner = CommandRunner(240.0)
    runner.start(errand([PYTHON, "-I", "-S", "-c", script], tmp_path))
    runner.close(240.0)
    (ended,) = runner.take_results()
    assert ended["code"] == 0
    group, session = (int((tmp_path / name).read_text()) for name in ("setpgrp", "setsid"))
    until = time.monotonic() + 60
    while linux_processes._stat(group)[:1] not in ([], [b"Z"]):
        assert time.monotonic() < until
        time.sleep(0.01)
    assert linux_processes._stat(session)[:1] not in ([], [b"Z"])  # docs/recipe.md says so
    linux_processes.kill(session)


def test_a_search_that_ends_does_not_wait_for_long(tmp_path, monkeypatch):
    monkeypatch.setattr("evocity.search.steering.notification._PATIENCE", 0.3)
    runner = CommandRunner(600.0)
    runner.start(errand(["sleep", "600"], tmp_path))
    time.sleep(0.2)
    runner.start(errand([PYTHON, "-c", "open('never', 'w')"], tmp_path))
    begun = time.monotonic()
    runner.close(0.3)
    assert time.monotonic() - begun < 60
    (ended,) = runner.take_results()
    assert (ended["code"], ended["reason"]) == (None, "the search had ended")
    assert not (tmp_path / "never").exists()


def test_endless_output_is_cut(tmp_path):
    script = "import sys\nfor _ in range(2000): sys.stdout.write('\\033[31mx' * 1000)"
    runner = CommandRunner(240.0)
    runner.start(errand([PYTHON, "-c", script], tmp_path))
    runner.close(240.0)
    (ended,) = runner.take_results()
    assert ended["code"] == 0
    assert 100 < len(ended["output"].encode()) <= 1000
    assert "\033" not in ended["output"]


@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ("no-such-program-here", None, "No such file"),
        ("./toys.py", None, "Permission denied"),
        (f"{PYTHON} -c 'import sys; sys.exit(3)'", 3, ""),
        (f"{PYTHON} -c 'import os, signal; os.kill(os.getpid(), signal.SIGKILL)'", -9, ""),
    ],
)
def test_a_command_that_fails_is_an_event_and_no_more(telling, tmp_path, command, code, says):
    out = tmp_path / "run"
    run(telling(f'[notify]\non_end = "{command}"\n'), out, workers=0, generations=1)
    (event,) = notified(out)
    assert event["code"] == code
    assert says in event.get("reason", "")
    assert RunLog(out).status()["finished"]


def test_a_command_is_not_waited_for_by_a_generation(telling, tmp_path, monkeypatch):
    monkeypatch.setattr("evocity.search.steering.notification._PATIENCE", 0.5)
    lines = '[notify]\non_improvement = "sleep 600"\ntimeout = 700\n'
    recipe = read_recipe(telling(lines), generations=8)

    seen = []

    class Times(Observer):
        def generation(self, *_):
            seen.append(time.monotonic())

    begun = time.monotonic()
    with Search(recipe, out=tmp_path / "run", workers=0, observers=[Times()]) as search:
        list(search)
    assert seen[-1] - begun < 250
    assert time.monotonic() - seen[-1] < 250
    (event,) = notified(tmp_path / "run")
    assert event["reason"] == "the search had ended"


# -- words and faults ----------------------------------------------------------------------------


def test_no_shell_reads_what_is_told():
    told = {"reason": "a; rm -rf / $HOME `x` {run} 'y", "run": "/r"}
    command = "mail -s 'evocity: {reason}' --json '{\"text\": \"{run}\"}' $HOME"
    assert words_of(command, told) == [
        "mail",
        "-s",
        "evocity: a; rm -rf / $HOME `x` {run} 'y",
        "--json",
        '{"text": "/r"}',
        "$HOME",
    ]
    assert words_of("x {reason}", {"reason": "a\0b"}) == ["x", "a b"]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (
            'on_end = "mail \'me"',
            'notify.on_end: "mail \'me" cannot be split into words (No closing quotation)',
        ),
        ('on_end = ""', "notify.on_end: ''; allowed: a command"),
        ('on_end = "mail {reson}"', "notify.on_end: {reson}, did you mean {reason}?"),
        ("on_end = 3", "notify.on_end: 3; allowed: text in quotes"),
        ('on_start = "mail"', "notify.on_start: unknown key"),
        ("timeout = 0", "notify.timeout: 0; allowed: above 0"),
    ],
)
def test_faults_are_told_with_the_others(toy, lines, says):
    (line,) = faults(toy(recipe=f"[notify]\n{lines}\n"))
    assert line.startswith(says), line


def test_a_program_that_is_not_here_is_told_before_the_night(telling, tmp_path):
    lines = '[notify]\non_end = "no-such-program {reason}"\non_improvement = "sleep 0"\n'
    recipe = read_recipe(telling(lines))
    (note,) = missing_programs(recipe.notify, tmp_path)
    assert "notify.on_end: no program no-such-program" in note
    with Search(recipe, workers=0) as search:
        search.prepare()
        assert note in search.notes
    section = NotifySection(on_end="./tell.py")
    (tmp_path / "tell.py").chmod(0o755)
    assert missing_programs(section, tmp_path) == []
