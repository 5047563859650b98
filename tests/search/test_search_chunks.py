"""What a Dask worker is given at a time: so much work that it pays to send it, so little that
nobody waits for the last. Nothing of Dask is here: a cluster on a virtual clock."""

from heapq import heappop, heappush
from queue import Empty
from types import SimpleNamespace

import pytest

from evocity.errors import RunError
from evocity.evaluation.cluster import engine as clusters
from evocity.evaluation.cluster.dask_link import SchedulerLost
from evocity.evaluation.cluster.engine import Cluster
from evocity.evaluation.cluster.host import Answer
from evocity.evaluation.evaluator import Outcome

#: Seconds of work in a chunk, and in the least ones; chunks of a worker at a time.
CHUNK, LEAST, DEPTH = 0.1, 0.03, 2


class Machines:
    """In the place of a link: Dask workers of one seat each, which take ``cost`` seconds a job.

    chunks, weights : jobs and bytes of each chunk, in the order they were sent.
    full : of each moment at which the main process waits, how many jobs were sent until then, and
        how many chunks each worker has.
    spent : when each worker was done with its last chunk.
    """

    def __init__(self, workers: int, cost: float):
        self.names, self.cost = [f"worker-{k}" for k in range(workers)], cost
        self.now, self.number = 0.0, 0
        self.spent = dict.fromkeys(self.names, 0.0)
        self.flying: list[tuple] = []
        self.chunks: list[int] = []
        self.weights: list[int] = []
        self.full: list[tuple[int, list[int]]] = []

    def sites(self):
        return dict.fromkeys(self.names, 1)

    def ask(self, function, sites, *given, seconds=0.0):
        if function.__name__ == "versions":
            return dict.fromkeys(sites, function())
        return dict.fromkeys(sites, 1)

    def send(self, number, site, heard, name, method, jobs):
        self.chunks.append(len(jobs))
        self.weights.append(sum(map(len, jobs)))
        self.spent[site] = max(self.now, self.spent[site]) + self.cost * len(jobs)
        heappush(self.flying, (self.spent[site], number, site, len(jobs)))

    def close(self):
        pass

    # -- what came of it, in the place of a queue --------------------------------------------

    def get(self, timeout):
        full = [sum(one[2] == name for one in self.flying) for name in self.names]
        self.full.append((sum(self.chunks), full))
        if not self.flying:
            raise Empty
        self.now, number, _, count = heappop(self.flying)
        return number, "done", Answer([Outcome("ok")] * count, self.cost * count)

    def get_nowait(self):
        raise Empty


@pytest.fixture
def sent(monkeypatch):
    """Function that has ``jobs`` done by so many workers, after others that tell what one costs."""

    def done(jobs, workers=2, cost=0.01) -> Machines:
        machines = Machines(workers, cost)
        monkeypatch.setattr(clusters, "Link", lambda address: machines)
        monkeypatch.setattr(clusters, "SimpleQueue", lambda: machines)
        monkeypatch.setattr(clusters, "make_versions", lambda: versions)
        parcel = SimpleNamespace(digest="", setup=b"", files={}, sides=4, parts=())
        ignored = lambda text: None  # noqa: E731
        engine = Cluster(parcel, "tcp://nowhere:1", 1, 9.0, None, ignored, ignored)
        engine.run("born", [(k,) for k in range(100 + round(4 / cost))])
        machines.chunks, machines.weights, machines.full = [], [], []
        outcomes = engine.run("born", jobs)
        assert [one.status for one in outcomes] == ["ok"] * len(jobs)
        assert sum(machines.chunks) == len(jobs)
        return machines

    return done


def test_a_scheduler_that_ends_before_a_worker_came_is_told(monkeypatch):
    class Ending(Machines):
        closed = asked = 0

        def sites(self):
            self.asked += 1
            if self.asked > 1:
                raise SchedulerLost("gone")
            return {}

        def close(self):
            self.closed += 1

    machines, told = Ending(1, 1.0), []
    monkeypatch.setattr(clusters, "Link", lambda address: machines)
    monkeypatch.setattr(clusters, "_TRY", 0.0)
    parcel = SimpleNamespace(digest="")
    with pytest.raises(RunError, match="answers at tcp://nowhere:1 any more, before a worker came"):
        Cluster(parcel, "tcp://nowhere:1", 1, 9.0, None, told.append, told.append)
    assert "waiting for workers" in told[0]
    assert machines.closed == 1


@pytest.mark.parametrize(
    ("address", "count"), [("tcp://10.0.0.1:8786", 1), ("tls://10.0.0.1:8786", 0), ("local:2", 0)]
)
def test_who_reaches_a_cluster_without_tls_is_a_note(monkeypatch, address, count):
    monkeypatch.setattr(clusters, "Link", lambda address: Machines(1, 1.0))
    monkeypatch.setattr(clusters, "make_versions", lambda: versions)
    parcel = SimpleNamespace(digest="", setup=b"", files={}, sides=4, parts=())
    notes = Cluster(parcel, address, 1, 9.0, None, print, print).notes
    assert len(notes) == count
    assert all(f"{address} uses no TLS: anyone who reaches this" in one for one in notes)


def versions():
    return {"evocity": "0"}


@pytest.mark.parametrize("cost", [0.0005, 0.01, 0.04])
def test_a_chunk_is_a_tenth_of_a_second_of_work_and_less_at_the_end(sent, cost):
    machines = sent([(k,) for k in range(round(4 / cost))], cost=cost)
    work = [count * cost for count in machines.chunks]
    assert max(work) <= CHUNK + 1e-9
    early = work[2 * DEPTH : len(work) // 2]  # the first ones part what was drawn until then
    assert min(early) > CHUNK - max(1.01 * cost, 0.1 * CHUNK)  # as much as whole births make
    assert min(work[:-1]) > LEAST - max(1.01 * cost, 0.1 * LEAST)  # the last one has what is left
    ends = sorted(machines.spent.values())
    assert ends[-1] - ends[0] <= max(LEAST, cost) + 1e-9  # nobody waits for the last


def test_a_worker_has_two_chunks_as_long_as_there_are_jobs(sent):
    machines = sent([(k,) for k in range(400)], workers=3)
    while_jobs_wait = [full for given, full in machines.full if given < 400]
    assert len(while_jobs_wait) > 20
    assert set(map(tuple, while_jobs_wait)) == {(DEPTH,) * 3}


def test_a_generation_is_parted_among_all_workers(sent):
    """64 births of 10 ms and 4 workers: 16 a worker are .16 s, in two chunks or more."""
    machines = sent([(k,) for k in range(64)], workers=4)
    assert len(machines.chunks) >= 4 * DEPTH
    assert machines.full[0][1] == [DEPTH] * 4
    ends = sorted(machines.spent.values())
    assert ends[-1] - ends[0] <= LEAST + 1e-9


def test_births_that_are_slow_go_one_by_one(sent):
    machines = sent([(k,) for k in range(12)], cost=3.0)
    assert machines.chunks == [1] * 12


def test_heavy_births_are_not_sent_together(sent):
    heavy = bytes(clusters._HEAVY // 3)
    machines = sent([(heavy,)] * 12, cost=0.001)
    assert max(machines.weights) < 1.5 * clusters._HEAVY
