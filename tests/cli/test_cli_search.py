"""Runs on the command line: made, resumed, looked at, stopped, failing."""

import json
from unittest.mock import patch

import pytest
from cli_tools import call, contents, refused, write_recipe, write_town
from PIL import Image

import evocity
from evocity.cli.shared.search_progress import LiveLine, LogLines, goal_signs, progress_line
from evocity.errors import MapError, RunError
from evocity.recipe.values import describe_reach
from evocity.search import Generation
from evocity.search.preparation.startup import Crew, start_engine


@pytest.fixture
def recipe(tmp_path):
    return write_recipe(tmp_path)


@pytest.fixture(scope="module")
def finished(finished_runs, tmp_path_factory):
    """A finished run, only looked at."""
    return finished_runs.copy("commanded", tmp_path_factory.mktemp("finished"))


def rows(folder):
    """All births of a run, but for what differs from one time to the next."""
    return evocity.open_run(folder).births().drop_columns(["seconds"]).to_pylist()


# -- run -----------------------------------------------------------------------------------


def test_a_run_leaves_its_births_and_a_report_and_says_where(tmp_path, recipe):
    result = call("run", recipe, "--out", tmp_path / "run", report=True)
    assert (tmp_path / "run" / "report.html").stat().st_size > 50_000
    assert result.stdout.splitlines() == [
        f"run:    {tmp_path / 'run'}",
        f"report: {tmp_path / 'run' / 'report.html'}",
    ]
    assert "generation 2/2 · 18 births · 0 failed" in result.stderr
    assert (tmp_path / "run" / "recipe.toml").read_text() == recipe.read_text()


@pytest.mark.slow
def test_a_run_is_on_settled_leaves_unless_told_otherwise(tmp_path):
    recipe = write_recipe(tmp_path, genome="", operators="pavement_fusion = 2\nmutation = 1")
    call("run", recipe, "--generations", 1, "--out", tmp_path / "run")
    run = evocity.open_run(tmp_path / "run")
    assert run.header.settle
    assert {birth.status for birth in run.individuals(run.births()["id"].to_pylist())} == {"ok"}
    left = evocity.encode(run.sources()[0].city).genome
    assert run.sources()[0].genome == left
    assert left.pavement.finest == 2 < left.pavement.coarsest
    call("show", tmp_path / "run", "--id", 7, "--leaves", "-o", tmp_path / "leaves.png")


def test_the_options_of_a_run_replace_the_recipes(tmp_path, recipe):
    options = ("--generations", 1, "--population", 4, "--seed", 8, "--workers", 0)
    call("run", recipe, *options, "--out", tmp_path / "run")
    run = evocity.open_run(tmp_path / "run")
    assert (run.header.seed, run.header.population, len(run.generations)) == (8, 4, 2)


def test_without_a_folder_a_run_finds_a_free_one(tmp_path, recipe, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("towns", "towns-2", "towns-3"):
        result = call("run", recipe, "--generations", 0)
        assert f"run:    runs/{name}\n" in result.stdout.replace("\\", "/")
        assert (tmp_path / "runs" / name / "report.html").is_file()


def test_an_existing_folder_is_refused(tmp_path, recipe):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "thesis.txt").write_text("years of work")
    message = refused(tmp_path, "run", recipe, "--out", tmp_path / "here", says="exists already")
    assert f"evocity resume {tmp_path / 'here'}" in message


def test_a_file_where_a_folder_should_be_is_refused(tmp_path, recipe):
    (tmp_path / "file").write_text("no folder")
    words = ("run", recipe, "--out", tmp_path / "file" / "run")
    refused(tmp_path, *words, says="cannot be created")


@pytest.mark.parametrize(
    ("replaced", "says"),
    [
        ({"run": 'nmae = "x"'}, "run.nmae: unknown key"),
        ({"run": "population = 1"}, "run.population: 1"),
        ({"run": 'population = "many"'}, "run.population"),
        ({"run": "seed = -1"}, "run.seed: -1"),
        ({"map": "pixels = 30"}, "map.pixels: 30"),
        ({"operators": "mutation = -2"}, "operators.mutation"),
        ({"operators": "mutation = { weight = 1, sigma = -0.1 }"}, "operators.mutation"),
        ({"operators": "grafting = 1"}, "operators.grafting: unknown operator"),
        ({"fitness": 'name = "beauty"'}, "`evocity fitness list` shows"),
        ({"fitness": 'name = "gsi"'}, "gsi"),
        ({"fitness": 'file = "missing.py"'}, "missing.py"),
        ({"parents": 'map = "atlantis"'}, "atlantis"),
        ({"evaluation": "workers = -1"}, "evaluation.workers: -1"),
        ({"search": 'algorithm = "luck"'}, "search.algorithm"),
    ],
)
def test_a_recipe_at_fault_is_refused(tmp_path, replaced, says):
    recipe = write_recipe(tmp_path, **replaced)
    refused(tmp_path, "run", recipe, "--out", tmp_path / "run", says=says)


def test_all_faults_of_a_recipe_are_told_at_once(tmp_path):
    recipe = write_recipe(tmp_path, run="population = 1", evaluation='workers = "two"')
    words = ("run", recipe, "--seed", -4, "--out", tmp_path / "run")
    message = refused(tmp_path, *words, says="3 faults")
    assert all(key in message for key in ("run.population", "evaluation.workers", "--seed -4"))


@pytest.mark.parametrize(
    ("option", "value"),
    [("generations", -3), ("population", 1), ("seed", -1), ("workers", -1), ("workers", 5000)],
)
def test_a_fault_of_the_command_line_is_not_the_recipes(tmp_path, recipe, option, value):
    words = ("run", recipe, f"--{option}", value, "--out", tmp_path / "run")
    message = refused(tmp_path, *words, says="the command line is at fault")
    assert f"--{option} {value}; allowed:" in message
    assert recipe.name not in message


def test_a_recipe_that_is_none_is_refused(tmp_path):
    words = ("--out", tmp_path / "run")
    refused(tmp_path, "run", tmp_path / "missing.toml", *words, says="missing.toml cannot be read")
    (tmp_path / "empty.toml").touch()
    refused(tmp_path, "run", tmp_path / "empty.toml", *words, says="empty.toml")
    (tmp_path / "torn.toml").write_text("[run")
    refused(tmp_path, "run", tmp_path / "torn.toml", *words, says="not valid TOML")
    refused(tmp_path, "run", tmp_path, *words, says="cannot be read")


def test_a_map_of_another_size_than_its_partner_is_refused(tmp_path, recipe):
    (tmp_path / "right.npy").unlink()
    write_town(tmp_path / "right.npy", side=16)
    refused(tmp_path, "run", recipe, "--out", tmp_path / "run", says="right")


def test_a_run_in_which_too_much_fails_fails(tmp_path):
    (tmp_path / "own_fails.py").write_text(
        "import evocity\n"
        "@evocity.fitness(goal='max')\n"
        "def always_fails(city):\n"
        "    raise ValueError('no taste')\n"
    )
    recipe = write_recipe(tmp_path, fitness='file = "own_fails.py"')
    result = call("run", recipe, "--out", tmp_path / "run", code=1)
    assert "no taste" in result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""


# -- resume, status, show ------------------------------------------------------------------


def test_a_resumed_run_is_the_uninterrupted_one(tmp_path, recipe, finished):
    call("run", recipe, "--generations", 1, "--out", tmp_path / "run")
    result = call("resume", tmp_path / "run", "--generations", 2)
    assert "generation 2/2" in result.stderr
    assert rows(tmp_path / "run") == rows(finished)


def test_who_reaches_a_cluster_without_tls_is_said_by_run_and_resume(tmp_path, recipe):
    def here(prepared, crew, *others):
        engine = start_engine(prepared, Crew(0), *others)
        engine.notes = describe_reach(crew.cluster)
        return engine

    said = "Note: the cluster at tcp://10.0.0.1:8786 uses no TLS: anyone who reaches"
    address = ("--cluster", "tcp://10.0.0.1:8786", "--workers", 1)
    with patch("evocity.search.engine.start_engine", here):
        words = ("--generations", 0, "--out", tmp_path / "run")
        assert said in call("run", recipe, *address, *words).stderr
        words = (tmp_path / "run", "--generations", 1)
        assert said in call("resume", *words, *address).stderr


def test_a_finished_run_gets_its_report_again(tmp_path, recipe):
    call("run", recipe, "--generations", 0, "--out", tmp_path / "run")
    (tmp_path / "run" / "report.html").unlink()
    with patch(
        "evocity.search.engine.start_engine", side_effect=AssertionError("nothing to work on")
    ):
        result = call("resume", tmp_path / "run")
    assert (tmp_path / "run" / "report.html").is_file()
    assert result.stderr == "finished already at 0/0; --generations N goes on\n"


def test_status_tells_where_a_run_is(finished):
    told = json.loads(call("status", finished, "--json").stdout)
    assert set(told) == {
        "generation",
        "kept",
        "damaged",
        "differs",
        "births",
        "failures",
        "hypervolume",
        "best",
        "algorithm",
        "evaluation",
        "islands",
        "picked",
        "picks_share",
        "weights",
        "waiting",
        "refused",
        "parents",
        "evaluations_per_second",
        "finished",
        "stopped",
        "running",
        "seconds_left",
        "unreachable",
        "more_births",
        "front",
    }
    assert (told["generation"], told["births"], told["failures"]) == (2, 18, 0)
    assert (told["finished"], told["running"], told["seconds_left"]) == (True, False, None)
    assert set(told["best"]) == {"alignment", "gsi"}
    text = call("status", finished).stdout
    (generation,) = [line for line in text.splitlines() if line.startswith("generation")]
    assert generation.split()[1] == "2/2"
    goals = {"best alignment": "(more is better)", "best gsi": "(0.35 is wanted)"}
    for line in text.splitlines():
        if line.startswith("best"):
            assert line.endswith(goals.pop(" ".join(line.split()[:2])))
    assert goals == {}
    run = evocity.open_run(finished)
    left, right = run.header.cities[:2]
    assert list(told["parents"]) == [left, right]
    for number, name in enumerate((left, right)):
        (birth,) = run.individuals([number])
        assert told["parents"][name] == {m: birth.values[m] for m in ("alignment", "gsi")}
    had = (f"{name} {told['parents'][name]['gsi']:.4g}" for name in (left, right))
    assert f"parents: {', '.join(had)}" in text
    (front,) = [line.split()[1:] for line in text.splitlines() if line.startswith("front")]
    members = run.members(run.generations[-1]).to_pylist()
    assert [int(one) for one in front] == sorted(m["id"] for m in members if m["rank"] == 0)
    assert told["kept"] == []  # the run does not measure `smallest_share`


def test_status_tells_whose_buildings_the_cities_to_keep_have(tmp_path):
    share = 'name = "alignment"\n[[fitness]]\nname = "smallest_share"\nmin = 0.05'
    path = write_recipe(tmp_path, fitness=share)
    call("run", path, "--generations", 1, "--out", tmp_path / "run")
    kept = json.loads(call("status", tmp_path / "run", "--json").stdout)["kept"]
    assert all(0.99 < sum(one["built"].values()) < 1.01 for one in kept)
    lines = call("status", tmp_path / "run").stdout.splitlines()
    (first,) = [line for line in lines if line.startswith("to keep")]
    assert f"{kept[0]['id']}: Its buildings come from " in first


def test_one_individual_of_a_run_leaves_it(tmp_path, finished):
    front = call("status", finished).stdout.split("front")[1].split()[0]
    city = evocity.decode(evocity.open_run(finished).genome(int(front))).city
    call("decode", finished, "--id", front, "-o", tmp_path / "bred.tif")
    bred = evocity.read_map(tmp_path / "bred.tif")
    assert (bred.heights == city.heights).all()
    assert bred.name == f"run, individual {front}"
    told = json.loads(call("score", finished, "--id", front, "--fitness", "gsi", "--json").stdout)
    assert told == {"gsi": pytest.approx(evocity.fitness.get("gsi")(city))}
    call("show", finished, "--id", front, "-o", tmp_path / "bred.png")
    call("show", tmp_path / "bred.tif", "-o", tmp_path / "same.png")
    with Image.open(tmp_path / "bred.png") as one, Image.open(tmp_path / "same.png") as other:
        assert one.info["Title"] == f"run, individual {front}"
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize("words", [("decode", "-o", "m.tif"), ("score",)])
def test_a_run_without_an_id_says_where_ids_are(tmp_path, finished, words):
    output = [tmp_path / word if "." in word else word for word in words[1:]]
    message = refused(tmp_path, words[0], finished, *output, says="--id N")
    assert f"evocity status {finished}" in message
    assert str(finished / "report.html") in message
    example = message.split("for example --id ")[1].split(",")[0]
    call("score", finished, "--id", example, "--fitness", "gsi")
    refused(tmp_path, "encode", finished, "-o", tmp_path / "g.parquet", says="is a run folder")
    refused(tmp_path, words[0], finished, "--id", 9999, *output, says="from 0 to 17")


OWN_SOMETIMES = """import evocity
@evocity.fitness(goal="min", unit="m")
def sometimes(city):
    highest = float(city.heights.max())
    if int(10 * city.heights.sum()) % 3 == 0:
        raise ValueError("no taste\\n  for mixtures")
    return highest
"""


@pytest.mark.slow
def test_failures_are_told_at_the_end_and_by_status(tmp_path):
    (tmp_path / "own_sometimes.py").write_text(OWN_SOMETIMES, encoding="utf-8")
    fitness = 'file = "own_sometimes.py"\n[[fitness]]\nname = "gsi"\ntarget = 0.3'
    recipe = write_recipe(tmp_path, fitness=fitness, evaluation="workers = 0\nmax_failures = 1.0")
    result = call("run", recipe, "--generations", 1, "--out", tmp_path / "run")
    (told,) = [line for line in result.stderr.splitlines() if line.startswith("failed: ")]
    count = evocity.open_run(tmp_path / "run").status()["failures"]
    assert told.startswith(f"failed: {count} error, such as: sometimes (")
    assert "ValueError: no taste for mixtures" in told
    assert "sometimes" in result.stderr.split("best ")[1].split("↓")[0]
    assert "→0.3" in result.stderr
    text = call("status", tmp_path / "run").stdout
    assert told.removeprefix("failed: ") in text
    again = call("resume", tmp_path / "run")
    assert told in again.stderr


def test_show_draws_a_run(tmp_path, finished):
    before = contents(finished)
    call("show", finished, "-o", tmp_path / "bred.png")
    with Image.open(tmp_path / "bred.png") as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 64
    assert contents(finished) == before
    refused(tmp_path, "show", finished, "-o", tmp_path / "b.png", "--pixels", 9, says="options")


@pytest.mark.parametrize("name", ["missing", "empty"])
def test_no_run_is_refused(tmp_path, name):
    (tmp_path / "empty").mkdir()
    folder = tmp_path / name
    refused(tmp_path, "status", folder, "--json", says="no run")
    message = refused(tmp_path, "resume", folder, says="no run")
    assert "Stopped" not in message


def test_a_generation_that_has_been_is_refused(tmp_path, recipe):
    call("run", recipe, "--out", tmp_path / "run")
    refused(tmp_path, "resume", tmp_path / "run", "--generations", -1, says="generations")


# -- what happens on the way ---------------------------------------------------------------


class Search:
    """Stands for a search: yields some generations, then does what it is told to."""

    def __init__(self, then):
        self.then = then
        self.recipe, self.notes, self.finished = evocity.read_recipe("demo"), [], False
        self.asked_to_stop, self.stopped_by = False, None

    def __call__(self, recipe, out, progress):
        progress("reading a map")
        if self.then == "refuse":
            raise MapError("left.npy", "right.npy", "look")
        out.mkdir()
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def prepare(self):
        pass

    def observe(self, observer):
        pass

    def flush(self):
        pass

    def __iter__(self):
        yield generation(0)
        if isinstance(self.then, BaseException):
            raise self.then


def generation(number):
    values = {
        "number": number,
        "births": 12,
        "failures": 1,
        "hypervolume": 1.25,
        "best": {"gsi": 0.5},
        "evaluations_per_second": 3.0,
        "seconds_left": 61.0,
        "population": [],
    }
    return Generation(**values)


@pytest.fixture
def searching(monkeypatch):
    def replace(then):
        monkeypatch.setattr(evocity, "Search", Search(then), raising=False)

    return replace


def test_ctrl_c_says_how_to_go_on(tmp_path, recipe, searching):
    searching(KeyboardInterrupt())
    result = call("run", recipe, "--out", tmp_path / "run", code=130)
    assert result.stderr.endswith(f"Stopped. Go on with: evocity resume {tmp_path / 'run'}\n")
    assert result.stdout == ""


def test_a_run_error_on_the_way_is_the_runs_failure(tmp_path, recipe, searching):
    searching(RunError("the disk is full", "space", "make some"))
    result = call("run", recipe, "--out", tmp_path / "run", code=1)
    assert "the disk is full" in result.stderr
    assert "what to do: make some" in result.stderr
    said = ["reading a map …", f"run: {tmp_path / 'run'}", "planned: ", "generation 0"]
    assert all(map(str.startswith, result.stderr.splitlines(), said))
    assert "Traceback" not in result.stderr


def test_an_error_before_the_start_is_the_users(tmp_path, recipe, searching):
    searching("refuse")
    refused(tmp_path, "run", recipe, "--out", tmp_path / "run", says="left.npy")


def test_a_report_that_fails_loses_nothing(tmp_path, recipe, searching, monkeypatch):
    def fails(folder):
        raise ValueError("no ink")

    searching(None)
    monkeypatch.setattr("evocity.report.write_report", fails, raising=False)
    result = call("run", recipe, "--out", tmp_path / "run", code=1, report=True)
    assert "no ink" in result.stderr
    assert f"data are safe in {tmp_path / 'run'}" in result.stderr
    assert f"try again with: evocity report {tmp_path / 'run'}" in result.stderr


def test_the_line_of_progress():
    assert progress_line(generation(3), 9, {"gsi": "→0.35"}) == (
        "generation 3/9 · 12 births · 1 failed · 3.0 evaluations/s · hypervolume 1.25 · "
        "best gsi 0.5 →0.35 · 0:01:01 left"
    )


def test_the_signs_of_goals(tmp_path):
    fitness = "\n[[fitness]]\n".join(
        ['name = "alignment"', 'name = "crumbs"', 'name = "gsi"\nlike = "lyon-1er"',
         'name = "fsi"\ngoal = "min"', 'name = "mean_height"\ntarget = 12.0']
    )  # fmt: skip
    signs = goal_signs(evocity.read_recipe(write_recipe(tmp_path, fitness=fitness)))
    assert signs == {
        "alignment": "↑",
        "crumbs": "↓",
        "gsi": "→lyon-1er",
        "fsi": "↓",
        "mean_height": "→12",
    }


@pytest.mark.slow
def test_invented_heights_of_parents_are_told(tmp_path):
    parents = 'map = "lyon-1er"\n[[parents]]\nmap = "villeurbanne-gratte-ciel"'
    recipe = write_recipe(tmp_path, parents=parents)
    words = ("run", recipe, "--generations", 0, "--out")
    lines = call(*words, tmp_path / "run").stderr.splitlines()
    assert "Note: lyon-1er: a window of 64 × 64 m, with" in "\n".join(lines)
    assert sum("the file names a window of 512 × 512 m" in line for line in lines) == 2
    (note,) = [line for line in lines if "no height" in line]
    assert "villeurbanne-gratte-ciel: 5 of 5 buildings have no height" in note
    assert "get 6 m; those that touch become one building; default_height in" in note
    recipe.write_text(recipe.read_text().replace('-ciel"', '-ciel"\ndefault_height = 9.0'))
    lines = call(*words, tmp_path / "more").stderr.splitlines()
    (note,) = [line for line in lines if "no height" in line]
    assert "and get 9 m" in note


def test_a_parent_that_is_mostly_empty_is_told(tmp_path):
    parents = 'map = "lyon-1er"\n[[parents]]\nmap = "new-york-west-village"'
    wide = "pixels = 64\nmetres_per_pixel = 30.0"
    recipe = write_recipe(tmp_path, parents=parents, map=wide)
    lines = call("run", recipe, "--generations", 0, "--out", tmp_path / "run").stderr.splitlines()
    notes = [line for line in lines if "of 64 × 64 px" in line]
    assert [note.split()[1] for note in notes] == ["lyon-1er:", "new-york-west-village:"]
    assert all(note.endswith("[map], choose another window") for note in notes)


def test_a_terminal_gets_one_live_line(capsys):
    with LiveLine() as show:
        show("generation 1/2 [not markup]")
    assert "generation 1/2 [not markup]" in capsys.readouterr().err


def test_a_log_file_gets_few_lines_but_the_first_and_the_last(capsys):
    with LogLines() as show:
        for number in range(1000):
            show(f"generation {number}")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "generation 0"
    assert lines[-1] == "generation 999"
    assert len(lines) < 10
