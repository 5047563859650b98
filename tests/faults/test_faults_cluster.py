"""A Dask cluster breeds the same births, whatever ends in the middle of it."""

import contextlib
import importlib.metadata
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from codes import uniformly
from toy_runs import write_toy

from evocity import fitness
from evocity.errors import RecipeError, RunError
from evocity.evaluation import Workers, linux_processes
from evocity.evaluation.cluster import host as host_module
from evocity.evaluation.cluster.parcel import parcel_of, unpack
from evocity.evaluation.evaluator import Setup
from evocity.evaluation.kernel_warmup import DECODE
from evocity.kinds import KINDS as CHROMOSOMES
from evocity.search import Search, read_recipe
from evocity.search.preparation.startup import Crew
from evocity.store import RunLog

pytest.importorskip("distributed")

from evocity.evaluation.cluster import dask_link
from evocity.evaluation.cluster import engine as clusters
from evocity.evaluation.cluster.engine import Cluster

pytestmark = pytest.mark.skipif(not linux_processes.LINUX, reason="what Linux gives")

MEASURE = """
import ctypes, os, signal, sys, time
import numpy as np
import evocity
{imports}

@evocity.fitness(goal="max")
def bad(city, genome):
    told = genome.cities[0]
    {body}
    return float(city.heights.mean()) + len(told)
"""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def alive(pid: int) -> bool:
    """Whether a process is there and has not ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[0] != b"Z"
    except OSError:
        return False


def within(seconds: float, condition) -> bool:
    """Whether a ``condition`` comes true in so many seconds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


class Machines:
    """A scheduler and workers on this machine, as docs/cluster.md starts them."""

    def __init__(self, folder, workers: int, *, nthreads: int = 1):
        self.port, self._log = free_port(), open(folder / "dask.log", "ab")  # noqa: SIM115
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._nthreads = nthreads
        self.scheduler = self._scheduler()
        self.workers = [self.worker() for _ in range(workers)]
        assert within(120, self._answers)

    def _start(self, *words: str, shell: bool = False) -> subprocess.Popen:
        words = [sys.executable, "-m", *words] if not shell else ["sh", "-c", *words]
        return subprocess.Popen(words, stdout=self._log, stderr=self._log, start_new_session=True)

    def _answers(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port)):
            return True
        return False

    def _scheduler(self) -> subprocess.Popen:
        return self._start(
            "distributed.cli.dask_scheduler",
            *("--host", "127.0.0.1", "--port", str(self.port)),
            *("--no-dashboard", "--dashboard-address", "127.0.0.1:0"),
        )

    def worker(self) -> subprocess.Popen:
        """One in a loop, which starts it again when it ends."""
        command = (
            f"while sleep 0.1; do {sys.executable} -m distributed.cli.dask_worker {self.address} "
            f"--nthreads {self._nthreads} --memory-limit 0 --no-nanny --no-dashboard "
            "--dashboard-address 127.0.0.1:0; done"
        )
        return self._start(command, shell=True)

    def worker_pid(self, number: int) -> int:
        """Of the Dask worker that the loop runs."""
        for pid in linux_processes.children(self.workers[number].pid):
            with contextlib.suppress(OSError), open(f"/proc/{pid}/cmdline", "rb") as file:
                if b"dask_worker" in file.read():
                    return pid
        raise AssertionError("there is no worker")

    def kill_scheduler(self) -> None:
        os.killpg(self.scheduler.pid, signal.SIGKILL)
        self.scheduler.wait()

    def start_scheduler(self) -> None:
        self.scheduler = self._scheduler()

    def hosted(self) -> list[int]:
        """Ids of evocity's own processes below the Dask workers, the nurseries left out."""
        below = [
            one
            for number in range(len(self.workers))
            for nursery in linux_processes.children(self.worker_pid(number))
            for one in linux_processes.descendants(nursery)
        ]
        return [pid for pid in below if alive(pid)]

    def close(self) -> None:
        families = [linux_processes.descendants(one.pid) for one in [*self.workers, self.scheduler]]
        for one in [*self.workers, self.scheduler]:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(one.pid, signal.SIGKILL)
            one.wait()
        self._log.close()
        left = [pid for family in families for pid in family]
        assert within(60, lambda: not any(map(alive, left)))


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    found = Machines(tmp_path_factory.mktemp("machines"), 2)
    yield found
    found.close()


@pytest.fixture(scope="session")
def genome(town):
    return uniformly(town).genome


@pytest.fixture
def told():
    """What a cluster told of jobs that it did again."""
    return []


@pytest.fixture
def setup_of(tmp_path):
    """Function that makes the setup, and the measures, of the measure ``bad``."""

    def make(body: str = "pass", imports: str = ""):
        path = tmp_path / "own" / "bad.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(MEASURE.format(body=body, imports=imports))
        measures = fitness.load_file(path)
        header = SimpleNamespace(chromosome=CHROMOSOMES["fabric"], measures=("bad",), recorded=())
        # as searches do: else each worker would load the kernels by itself, in a birth's time
        return Setup(header, (("bad", str(path)),), sides=4, parts=(DECODE,)), measures

    return make


@pytest.fixture
def cluster(setup_of, told):
    """Function that makes an engine on a cluster for the measure ``bad``."""
    made = []

    def make(address, body="pass", imports="", seats=None, timeout=30.0, memory=None):
        parcel = parcel_of(*setup_of(body, imports))
        made.append(Cluster(parcel, address, seats, timeout, memory, told.append, told.append))
        return made[-1]

    yield make
    for one in made:
        one.close()


def named(genome, *names):
    """Jobs: to measure the genome under these names, which the measure reads."""
    return [(genome.replace(cities=(name,)),) for name in names]


def calm(count: int) -> list[str]:
    return [f"calm-{number}" for number in range(count)]


def births_of(folder) -> list:
    """All births but for how long they took."""
    run = RunLog(folder)
    rows = [row for number in run.generations for row in run.births(number).to_pylist()]
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows]


# -- the same births ---------------------------------------------------------------------


@pytest.mark.slow
def test_the_births_are_those_of_one_machine(tmp_path, machines):
    helper = "import evocity\ndef twice(x):\n    return 2 * x\n"
    more = "from helper import twice\n\n@evocity.fitness(goal='min')\ndef double(city):\n"
    more += "    if number(city) % 5 == 0:\n        raise ValueError('a bad mood')\n"
    more += "    return twice(float(city.heights.mean()))\n"
    more = "\n" + more
    (tmp_path / "helper.py").write_text(helper)
    recipe = write_toy(tmp_path, more, generations=2, max_failures=0.9, workers=2)

    def bred(name, **how):
        with Search(read_recipe(recipe), out=tmp_path / name, **how) as search:
            for _ in search:
                pass
        return births_of(tmp_path / name)

    expected = bred("here", workers=0)
    assert any("a bad mood" in (row["error"] or "") for row in expected)
    assert bred("of-2", workers=2) == expected  # other numbers: tests/search/test_search_run.py
    assert bred("dask", cluster=machines.address, workers=1) == expected
    assert bred("dask-4", cluster=machines.address, workers=2) == expected
    run = RunLog(tmp_path / "dask-4")
    engine = run.events()[0]
    assert (engine["engine"], engine["cluster"]) == ("dask", machines.address)
    assert (engine["dask_workers"], engine["workers"]) == (2, 4)
    assert run.provenance["evaluation"]["engine"] == "dask"
    assert RunLog(tmp_path / "of-2").provenance["evaluation"] == {
        "engine": "workers",
        "workers": 2,
    }


@pytest.mark.slow
def test_jobs_stream_in_and_outcomes_come_as_they_are_done(cluster, machines, genome, tmp_path):
    go = tmp_path / "go"
    body = f"while told == 'slow' and not os.path.exists({str(go)!r}): time.sleep(0.01)"
    engine = cluster(machines.address, body, timeout=120.0)
    engine.run("evaluate", named(genome, *calm(4)))  # workers are there
    jobs, taken = named(genome, "slow", *calm(20)), []

    def feed():
        for number, job in enumerate(jobs):
            while number > len(taken) + 8:
                yield None
            yield job

    for number, outcome in engine.stream("evaluate", feed()):
        assert outcome.status == "ok"
        taken.append(number)
        go.touch()
    assert sorted(taken) == list(range(21))
    assert taken[0] != 0


@pytest.mark.slow
def test_what_cannot_be_sent_is_an_error_as_with_workers(cluster, machines, genome, setup_of):
    job = (genome, [], threading.Lock())
    here = Workers(setup_of()[0], 1, 30.0)
    (expected,) = here.run("evaluate", [job])
    here.close()
    (found,) = cluster(machines.address).run("evaluate", [job])
    assert (found.status, found.error) == (expected.status, expected.error)
    assert "TypeError" in found.error


# -- measures ----------------------------------------------------------------------------

BAD = """{
        'hangs': lambda: time.sleep(1e6),
        'exits': lambda: os._exit(3),
        'kills': lambda: os.kill(os.getpid(), 9),
        'raises': lambda: [][0],
        'allocates': lambda: np.ones(10**8).sum(),
        'starts': lambda: os.spawnlp(os.P_NOWAIT, 'sleep', 'sleep', '1000'),
    }.get(told, float)()"""


@pytest.mark.slow
def test_bad_measures_cost_their_own_births(cluster, machines, genome, setup_of):
    names = ["hangs", "calm", "exits", "raises", "calm-2", "allocates", "starts", "kills", "calm-3"]
    limits = {"timeout": 4.0, "memory": 300 * 10**6}
    here = Workers(setup_of(BAD)[0], 2, **limits)
    expected = here.run("evaluate", named(genome, *names))
    here.close()
    engine = cluster(machines.address, BAD, seats=2, **limits)
    found = engine.run("evaluate", named(genome, *names))

    def compared(outcomes):  # one of memory tells how much there was just then
        return [(o.status, o.status == "memory" or o.error, o.values) for o in outcomes]

    assert compared(found) == compared(expected)
    ends = ["timeout", "ok", "died", "error", "ok", "memory", "ok", "died", "ok"]
    assert [one.status for one in found] == ends
    assert engine.size == 4
    engine.close()
    assert within(60, lambda: not machines.hosted())


DATA = """
from helper import of
from pathlib import Path

@evocity.fitness(goal="max", data=("deeper/levels.csv",))
def named_the_data(city):
    return 1.0
"""


@pytest.mark.slow
def test_files_of_measures_travel_with_what_they_import_and_read(
    cluster, machines, genome, tmp_path
):
    own = tmp_path / "own"
    (own / "deeper").mkdir(parents=True)
    (own / "helper.py").write_text("from deeper.more import more\ndef of(x):\n    return more(x)\n")
    (own / "deeper" / "more.py").write_text("def more(x):\n    return x + 1000\n")
    (own / "deeper" / "levels.csv").write_text("20000")
    body = "if told == 'raises': raise ValueError(__file__)\n"
    body += "    level = Path(__file__).parent / 'deeper' / 'levels.csv'\n"
    body += "    return of(len(told)) + float(level.read_text())"
    engine = cluster(machines.address, body, DATA)
    shutil.rmtree(own)  # another machine has no such folder
    found = engine.run("evaluate", named(genome, *calm(4), "raises"))
    assert [one.values for one in found[:4]] == [{"bad": 21006.0}] * 4
    assert f"({own / 'bad.py'}, line 17)" in found[4].error
    assert "measures-" not in found[4].error


def test_a_parcel_is_opened_where_its_files_are(setup_of, tmp_path):
    setup, measures = setup_of()
    parcel = parcel_of(setup, measures)
    assert unpack(parcel.setup, parcel.files).measures == setup.measures
    assert unpack(parcel.setup, parcel.files).moved == {}
    (tmp_path / "own" / "bad.py").write_text("raise SystemExit")
    again = unpack(parcel.setup, parcel.files)
    assert again.measures != setup.measures
    assert list(again.moved.values()) == [str(tmp_path / "own")]
    with pytest.raises(RunError, match="has changed since evocity executed it"):
        parcel_of(setup, measures)


@pytest.mark.slow
def test_a_measure_of_the_session_travels_as_source(tmp_path, machines):
    @fitness.fitness(goal="max")
    def of_this_session(city):
        return float(np.median(city.heights))

    recipe = write_toy(tmp_path, generations=1, workers=2)
    text = recipe.read_text() + '[[fitness]]\nname = "of_this_session"\n'
    recipe.write_text(text)
    for name, how in (("one", {"workers": 1}), ("dask", {"cluster": machines.address})):
        with Search(read_recipe(recipe), out=tmp_path / name, **how) as search:
            for _ in search:
                pass
    assert births_of(tmp_path / "one") == births_of(tmp_path / "dask")


# -- what ends ---------------------------------------------------------------------------


@pytest.mark.slow
def test_a_dask_worker_that_is_killed_costs_nothing(cluster, machines, genome, told, tmp_path):
    """It is killed while it has a birth: births end once the file ``go`` is there."""
    go, notes = tmp_path / "go", tmp_path / "notes"
    notes.mkdir()
    go.touch()
    body = f"open(f'{notes}/{{os.getpid()}}', 'w').close()\n"
    body += f"    while not os.path.exists({str(go)!r}): time.sleep(0.01)"
    engine = cluster(machines.address, body, timeout=120.0)
    jobs = named(genome, *calm(60))
    expected = [one.values for one in engine.run("evaluate", jobs)]
    victim = machines.worker_pid(0)
    family = linux_processes.descendants(victim)
    go.unlink()
    for one in notes.iterdir():
        one.unlink()

    def has_a_birth() -> bool:
        below = set(linux_processes.descendants(victim))
        return go.exists() or not below.isdisjoint(int(one.name) for one in notes.iterdir())

    def kill():
        if within(120, has_a_birth):
            os.kill(victim, signal.SIGKILL)
            within(120, lambda: any("is gone" in text for text in told))
        go.touch()

    killer = threading.Thread(target=kill)
    killer.start()
    found = engine.run("evaluate", jobs)
    go.touch()
    killer.join()
    assert [one.values for one in found] == expected
    assert any("is gone; births that it had are done again" in text for text in told)
    assert within(60, lambda: not any(map(alive, family)))
    # the loop starts another, which takes part
    assert within(120, lambda: len(engine._link.sites()) == 2)
    assert within(120, lambda: bool(engine.run("evaluate", jobs)) and engine.size == 2)


@pytest.mark.long
def test_a_scheduler_that_is_gone_is_waited_for(cluster, tmp_path, genome, told):
    own = Machines(tmp_path, 2)
    try:
        engine = cluster(own.address, "time.sleep(0.05)")
        jobs = named(genome, *calm(60))
        expected = [one.values for one in engine.run("evaluate", jobs)]
        deed = threading.Timer(0.5, lambda: (own.kill_scheduler(), own.start_scheduler()))
        deed.start()
        found = engine.run("evaluate", jobs)
        deed.join()
        assert [one.values for one in found] == expected
        assert any("is gone" in text and "waiting for it" in text for text in told)
        assert "is back" in told[-1]
    finally:
        own.close()


@pytest.mark.slow
def test_what_came_before_a_scheduler_was_lost_is_kept(
    cluster, machines, genome, told, monkeypatch
):
    engine = cluster(machines.address, "time.sleep(0.02)")
    jobs = named(genome, *calm(40))
    expected = [one.values for one in engine.run("evaluate", jobs)]
    take, look, came, lost = engine._take, engine._look, [], []

    def taken(*told):
        if lost == ["while looking"] and came:  # another came after it was connected to again
            lost.append("while hearing")
            raise dask_link.SchedulerLost(lost[-1])
        came.append(found := take(*told))
        return found

    def looked():
        if came and not lost:  # one chunk or more, as their times would have it
            came.clear()
            lost.append("while looking")
            raise dask_link.SchedulerLost(lost[-1])
        look()

    monkeypatch.setattr(engine, "_take", taken)
    monkeypatch.setattr(engine, "_look", looked)
    assert [one.values for one in engine.run("evaluate", jobs)] == expected
    assert lost == ["while looking", "while hearing"]
    assert sum("is gone" in text for text in told) == 2


@pytest.mark.long
def test_a_scheduler_that_does_not_come_back_ends_the_run(
    cluster, tmp_path, genome, told, monkeypatch
):
    own = Machines(tmp_path, 1)
    try:
        engine = cluster(own.address)
        monkeypatch.setattr(clusters, "PATIENCE", 2.0)
        monkeypatch.setattr(dask_link, "CONNECT", 1.0)
        own.kill_scheduler()
        began = time.monotonic()
        with pytest.raises(
            RunError, match=r"did not answer again within 2 s.*[\s\S]*evocity resume"
        ):
            engine.run("evaluate", named(genome, *calm(4)))
        assert time.monotonic() - began < 20
    finally:
        own.close()


def test_an_address_where_nobody_answers_is_told_in_time(cluster, monkeypatch):
    monkeypatch.setattr(dask_link, "CONNECT", 1.0)
    began = time.monotonic()
    with pytest.raises(RunError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9 "):
        cluster("tcp://127.0.0.1:9")
    assert time.monotonic() - began < 60  # and not as long as `clusters.PATIENCE`


def test_a_cluster_without_workers_is_told_in_time(cluster, tmp_path, monkeypatch, told):
    monkeypatch.setattr(clusters, "PATIENCE", 1.0)
    own = Machines(tmp_path, 0)
    try:
        with pytest.raises(RunError, match="no worker came to the Dask scheduler"):
            cluster(own.address)
        assert "waiting for workers" in told[0]
    finally:
        own.close()


@pytest.mark.slow
def test_other_versions_are_refused(cluster, machines, monkeypatch):
    real = importlib.metadata.version

    def version(name):
        return "0.1" if name == "numpy" else real(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    with pytest.raises(RunError, match=rf"numpy {np.__version__} there, 0\.1 here"):
        cluster(machines.address)


def test_without_the_extra_it_is_named(cluster, monkeypatch):
    monkeypatch.setattr(dask_link, "MISSING", "No module named 'distributed'")
    with pytest.raises(RunError, match=r"extra `cluster`[\s\S]*pip install 'evocity\[cluster\]'"):
        cluster("local:2")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_leaves_no_process(tmp_path, number):
    recipe = write_toy(tmp_path, generations=400, workers=2)
    script = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from evocity.cli import main; main(prog_name='evocity')"
    )
    words = ["run", str(recipe), "--out", str(tmp_path / "run"), "--cluster", "local:2"]
    run = subprocess.Popen(
        [sys.executable, "-c", script, *words, "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    first = tmp_path / "run" / "membership" / "generation-00000001.parquet"
    assert within(250, lambda: first.exists() or run.poll() is not None)
    family = linux_processes.descendants(run.pid)
    assert len(family) > 4
    if number == signal.SIGINT:  # a terminal's goes to all of the group
        os.killpg(run.pid, number)
    else:
        run.send_signal(number)
    shown, _ = run.communicate(timeout=60)
    assert run.returncode == 128 + number, shown
    assert "Traceback" not in shown, shown
    assert "distributed" not in shown, shown
    assert "Go on with: evocity resume" in shown
    assert within(10, lambda: not any(map(alive, family)))


# -- recipes -----------------------------------------------------------------------------


@pytest.mark.parametrize("address", ["tcp://10.0.0.1:8786", "tls://host:1", "local:1", "none"])
def test_addresses_of_clusters(tmp_path, address):
    recipe = read_recipe(write_toy(tmp_path, workers=2), cluster=address)
    assert recipe.evaluation.cluster == address


@pytest.mark.parametrize(
    "address", ["", "local:0", "local:257", "local", "http://host:1", "tcp://host", "tcp://a b:1"]
)
def test_addresses_that_are_none(tmp_path, address):
    with pytest.raises(RecipeError, match=r"evaluation\.cluster"):
        read_recipe(write_toy(tmp_path, workers=2), cluster=address)
    with pytest.raises(RecipeError, match=r"cluster = "):
        Search(read_recipe(write_toy(tmp_path, workers=2)), cluster=address or "local:")


def test_a_cluster_has_worker_processes(tmp_path):
    path = write_toy(tmp_path, workers=2)
    with pytest.raises(RecipeError, match="workers = 0"):
        read_recipe(path, cluster="local:2", workers=0)
    with pytest.raises(RecipeError, match="workers = 0"):
        Search(read_recipe(path), cluster="local:2", workers=0)
    assert read_recipe(path, cluster="local:3", workers=2).worker_count == 6


def test_workers_of_one_machine_say_nothing_of_a_cluster_that_a_run_goes_on_with(tmp_path):
    path = write_toy(tmp_path, workers=2)
    for workers in (0, 2):
        crew = Crew.choose(read_recipe(path, workers=workers), cluster="local:2")
        assert (crew.workers, crew.cluster) == (None, "local:2")
    crew = Crew.choose(read_recipe(path, workers=2, cluster="local:3"), cluster="local:2")
    assert crew.workers == 2
    assert Crew.choose(read_recipe(path), workers=3, cluster="local:2").workers == 3


def test_an_idle_host_ends_its_workers(setup_of, genome, monkeypatch):
    monkeypatch.setattr(host_module, "IDLE", 0.2)
    from evocity.evaluation.frames import write_frame

    host = host_module.Host(parcel_of(*setup_of()), 2, 30.0, None)
    jobs = [bytes(write_frame(job)) for job in named(genome, *calm(6))]
    first = host.run("evaluate", jobs)
    assert [one.status for one in first.outcomes] == ["ok"] * 6
    assert within(60, lambda: not host._pools)
    assert [one.values for one in host.run("evaluate", jobs).outcomes] == [
        one.values for one in first.outcomes
    ]
    host.close()
    with pytest.raises(host_module.HostClosed):
        host.run("evaluate", jobs)


def test_a_host_that_can_have_no_worker_says_so(setup_of, genome, monkeypatch):
    """Nobody would ever answer, and a cluster has no deadline of its own."""
    from evocity.evaluation.frames import write_frame

    def refused(*given, **how):
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(host_module, "Workers", refused)
    host = host_module.Host(parcel_of(*setup_of()), 2, 30.0, None)
    jobs, answers = [bytes(write_frame(job)) for job in named(genome, *calm(3))], []
    for _ in range(2):
        asking = threading.Thread(
            target=lambda: answers.append(host.run("evaluate", jobs)), daemon=True
        )
        asking.start()
        asking.join(120)
    assert ["Too many open files" in one.failed for one in answers] == [True, True]
    assert host._sitting == 0
    host.close()


def test_a_host_that_is_closed_ends_what_hangs(setup_of, genome):
    from evocity.evaluation.frames import write_frame

    host = host_module.Host(parcel_of(*setup_of("time.sleep(1e6)")), 1, 600.0, None)
    jobs = [bytes(write_frame(job)) for job in named(genome, *calm(2))]
    closer = threading.Timer(3.0, host.close)
    closer.start()
    began = time.monotonic()
    with pytest.raises(host_module.HostClosed):
        host.run("evaluate", jobs)
    assert time.monotonic() - began < 120  # and not as long as a birth may take
