"""What one asks the morning after: each in one line of public names, as in the first notebook."""

import json
from pathlib import Path

import pytest

import evocity
from evocity import plot
from evocity.analysis.individual import describe_scarce

NOTEBOOK = Path(__file__).parents[2] / "notebooks" / "01-first-look.ipynb"
#: Each at most 88 characters; `one` is a birth that was bred.
QUESTIONS = {
    "the best compromise": "run.compromise()",
    "the best of a measure": 'run.best("alignment")',
    "who survived longest": "run.survivors(1)",
    "which operator paid": "run.credit()",
    "what share of each city lives in the front": "run.ancestry(run.front()).mean()",
    "where two runs differ": "print(run.compare(other))",
    "births with alignment and few crumbs": 'run.where("alignment > 0.5 and crumbs < 4")',
    "the nearest relative of a birth": 'run.nearest(one, by="kin")',
    "five that differ most": "run.most_different(5)",
    "its grandparents as pictures": "plot.pedigree(run, one, generations=2)",
    "its buildings against Lyon's": "plot.buildings(one)",
    "its file for QGIS": 'one.save("chosen.gpkg", at=one.ground)',
}


@pytest.fixture(scope="module")
def answers(night, archipelago, tmp_path_factory) -> dict:
    run = evocity.open_run(night)
    names = {"plot": plot, "run": run, "one": run[19], "other": evocity.open_run(archipelago)}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("chosen"))
        found = {asked: eval(line, dict(names)) for asked, line in QUESTIONS.items()}
        names["layers"] = evocity.read_map("chosen.gpkg", pixels=64, metres_per_pixel=2.0)
    return names | found


def test_each_is_one_line_of_public_names():
    assert len(QUESTIONS) == 12
    assert max(map(len, QUESTIONS.values())) <= 88
    assert not any("._" in line for line in QUESTIONS.values())
    cells = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    assert set(QUESTIONS.values()) <= {"".join(cell["source"]) for cell in cells}


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
    few = answers["births with alignment and few crumbs"]
    assert few.equals(run.scores.query("alignment > 0.5 and crumbs < 4"))
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
    assert "By the common goals, spread, roof, alignment, crumbs" in told


def test_pictures_and_files(answers):
    run = answers["run"]
    tree = answers["its grandparents as pictures"].figure
    told = " ".join(text.get_text() for ax in tree.axes for text in ax.texts)
    grandparents = [i for p in run[19].parents for i in p.parents]
    assert grandparents
    assert all(f"{one.id}, gen. {one.generation}" in told for one in grandparents)
    beside = [text.get_text() for text in answers["its buildings against Lyon's"].legend_.texts]
    for name in run.header.cities:
        assert any(name in told for told in beside)
    city = run[19].city
    assert len(answers["layers"].buildings.area) > 0
    assert city.name == "run, individual 19"


def test_cities_with_few_buildings_are_named():
    cities = ["left", "right", "middle"]
    shares = {"left": 0.93, "right": 0.0304, "none": 0.0396}
    text = describe_scarce(shares, cities)
    assert (
        text == "It has only 3 % of its buildings from right and 0 % of its buildings from middle."
    )
    assert describe_scarce({"left": 0.9, "right": 0.1}, cities[:2]) == ""
    assert describe_scarce({"left": 1.0}, cities[:1]) == ""
    assert describe_scarce({}, cities) == ""
