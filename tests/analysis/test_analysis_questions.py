"""What one asks the morning after: each in one line of public names."""

import numpy as np
import pytest

import evocity

#: Each at most 88 characters; 9 is a birth that was bred.
QUESTIONS = {
    "the best compromise": "run.compromise()",
    "the best of a measure": 'run.best("alignment")',
    "who survived longest": "run.survivors(1)",
    "which operator paid": "run.credit()",
    "what share of each city lives in the front": "run.ancestry(run.front()).mean()",
    "where two runs differ": "print(run.compare(other))",
    "births with FSI over 2 and crumbs under 4": 'run.where("fsi > 2 and crumbs < 4")',
    "the nearest relative of a birth": 'run.nearest(19, by="kin")',
    "five that differ most": "run.most_different(5)",
    "its grandparents as pictures": "[i.picture() for p in run[19].parents for i in p.parents]",
    "its buildings against Lyon's": "evocity.fitness.fabric_distance(run[19].city, lyon)",
    "its file for QGIS": 'run[19].save("chosen.gpkg")',
}


@pytest.fixture(scope="module")
def answers(night, archipelago, tmp_path_factory) -> dict:
    names = {
        "evocity": evocity,
        "run": evocity.open_run(night),
        "other": evocity.open_run(archipelago),
        "lyon": evocity.read_map("lyon-1er", pixels=64),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("chosen"))
        found = {asked: eval(line, dict(names)) for asked, line in QUESTIONS.items()}
        names["layers"] = evocity.read_map("chosen.gpkg", pixels=64, metres_per_pixel=2.0)
    return names | found


def test_each_is_one_line_of_public_names():
    assert len(QUESTIONS) == 12
    assert max(map(len, QUESTIONS.values())) <= 88
    assert not any("._" in line for line in QUESTIONS.values())


def test_what_names_one_birth_is_an_individual(answers):
    run = answers["run"]
    for asked in (
        "the best compromise",
        "the best of a measure",
        "the nearest relative of a birth",
    ):
        assert answers[asked] in run
        assert answers[asked].status == "ok"
    best = answers["the best of a measure"]
    kept = run.scores[run.scores["feasible"]]
    assert best.scores["alignment"] == kept["alignment"].max()
    assert best.id == kept["alignment"].idxmax()
    assert answers["the best compromise"].id in run.archive.ids
    assert answers["the nearest relative of a birth"].id != 19


def test_what_names_several_is_a_frame_of_scores(answers):
    run = answers["run"]
    few = answers["births with FSI over 2 and crumbs under 4"]
    assert few.equals(run.scores.query("fsi > 2 and crumbs < 4"))
    middle = run.scores["fsi"].median()
    half = run.where(f"fsi > {middle} and not operator == 'source'")
    assert 0 < len(half) < len(run)
    assert half.equals(run.scores.query(f"fsi > {middle} and operator != 'source'"))
    different = answers["five that differ most"]
    assert len(set(different.index)) == 5
    assert list(different.columns) == list(run.scores.columns)
    longest = answers["who survived longest"]
    assert longest["lived"].tolist() == [max(one.lived for one in run)]


def test_shares_operators_and_runs(answers):
    run, shares = answers["run"], answers["what share of each city lives in the front"]
    assert list(shares.index) == list(run.header.cities)
    assert shares.sum() == pytest.approx(1)
    paid = answers["which operator paid"]
    assert paid["births"].sum() == len(run)
    assert paid["ancestors"].sum() == pytest.approx(1)
    assert paid.loc["source", "births"] == 2
    assert answers["where two runs differ"] is None  # it was printed
    told = str(run.compare(answers["other"]))
    assert "By what both want, spread, roof, alignment, crumbs" in told


def test_pictures_and_files(answers):
    run = answers["run"]
    pictures = answers["its grandparents as pictures"]
    assert len(pictures) == sum(len(one.parents) for one in run[19].parents) > 0
    assert all(picture.size[0] >= 64 for picture in pictures)
    assert np.isfinite(answers["its buildings against Lyon's"])
    city = run[19].city
    assert len(answers["layers"].buildings.area) > 0
    assert city.name == "run, individual 19"
