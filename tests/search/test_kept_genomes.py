"""Workers keep genomes: what they get in place of tokens, and what they drop."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_leaves

from evocity.evaluation import kept_genomes
from evocity.evaluation.kept_genomes import GenomesOfWorker, GenomeTokens, KeptGenomes

GENOMES = [draw_leaves(seed).replace(made={"seed": seed}) for seed in range(6)]


def same(one, other):
    return one == other and one.made == other.made and np.array_equal(one.parent, other.parent)


@given(
    st.lists(st.lists(st.integers(0, 5), max_size=4), min_size=1, max_size=12), st.integers(0, 3)
)
@settings(max_examples=60, deadline=None)
def test_jobs_arrive_as_they_were_sent(jobs, most):
    tokens, sent, worker = GenomeTokens(), GenomesOfWorker(), KeptGenomes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_genomes, "MOST_GENOMES", most)
        for numbers in jobs:
            job = ("operator", tuple(GENOMES[k] for k in numbers), 7, True)
            pickled, new, gone = sent.write(job, tokens)
            worker.keep(new)
            name, parents, *rest = worker.unpickle(pickled)
            worker.drop(gone)
            assert (name, rest) == ("operator", [7, True])
            assert all(same(GENOMES[k], one) for k, one in zip(numbers, parents, strict=True))
            assert set(worker._pickled) == set(sent._sizes)


def test_a_genome_goes_to_a_worker_once():
    tokens, sent = GenomeTokens(), GenomesOfWorker()
    first = sent.write((GENOMES[0], [GENOMES[0], GENOMES[1]]), tokens)
    again = sent.write((GENOMES[1], [GENOMES[0]]), tokens)
    assert len(first[1]) == 2
    assert again[1:] == ([], [])
    assert len(again[0]) < 200


def test_large_genomes_go_with_each_job():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kept_genomes, "MOST_BYTES", 4)
        pickled, new, gone = GenomesOfWorker().write((GENOMES[0],), GenomeTokens())
    assert (new, gone) == ([], [])
    assert same(KeptGenomes().unpickle(pickled)[0], GENOMES[0])


def test_both_sides_keep_a_bounded_number_of_bytes(monkeypatch):
    tokens, sent, worker = GenomeTokens(), GenomesOfWorker(), KeptGenomes()
    size = max(len(tokens.find(genome)[1]) for genome in GENOMES)
    monkeypatch.setattr(kept_genomes, "MOST_BYTES", 4 * size)
    tokens = GenomeTokens()
    for turn in range(3):
        for genome in GENOMES:
            pickled, new, gone = sent.write((genome,), tokens)
            worker.keep(new)
            assert same(worker.unpickle(pickled)[0], genome), turn
            worker.drop(gone)
            assert sum(len(one[2]) for one in tokens._tokens.values()) <= 4 * size
            assert sum(sent._sizes.values()) <= 4 * size


def test_births_do_not_share_what_made_them():
    tokens, sent, worker = GenomeTokens(), GenomesOfWorker(), KeptGenomes()
    pickled, new, _ = sent.write((GENOMES[0],), tokens)
    worker.keep(new)
    worker.unpickle(pickled)[0].made["seed"] = "other"
    assert worker.unpickle(pickled)[0].made == {"seed": 0}
