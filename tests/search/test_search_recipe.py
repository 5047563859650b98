"""A recipe's faults are told all at once, each with its key."""

import pytest

from evocity.errors import RecipeError
from evocity.operators import registry as operator_registry
from evocity.search import read_recipe, recipes


def faults(path) -> list[str]:
    with pytest.raises(RecipeError) as caught:
        read_recipe(path)
    return [line.strip() for line in caught.value.found.splitlines()[1:]]


def replaced(path, old, new, count=-1):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))
    return path


def test_all_faults_at_once(toy):
    path = toy()
    text = path.read_text().replace("population = 8", "population = 1").replace("seed", "sead")
    text = text.replace("pixels = 64", 'pixels = "64"').replace("right.npy", "nowhere.npy")
    text = text.replace("mutation = 2", "mutation = -2\nmutagen = 1").replace(
        "size_max = 6", "sise = 6"
    )
    path.write_text(text + '[[fitness]]\nname = "autosimilarty"\n[grid]\nx = 1\n')
    found = faults(path)
    keys = [line.split(": ")[0] for line in found]
    assert sorted(keys) == sorted(
        [
            "run.population",
            "run.sead",
            "map.pixels",
            "parents[1].map",
            "operators.mutation.weight",
            "operators.mutagen",
            "operators.pavement_fusion.sise",
            "fitness[1]",
            "grid",
        ]
    )
    assert all("; allowed: " in line for line in found)
    told = "\n".join(found)
    assert "autosimilarity" in told
    assert "lambda_crossover" in told
    assert "2 or more" in told
    assert "montpellier-pas-du-loup" in told
    assert "run, map, parents" in told
    for near in ("seed", "mutation", "autosimilarity"):
        assert f"did you mean {near}?" in told


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("population = 8", "population = 8.5", "run.population"),
        ("population = 8", "population = true", "run.population"),
        ("seed = 3", "seed = -3", "run.seed"),
        ("pixels = 64", "pixels = 66", "map.pixels"),
        ("metres_per_pixel = 2.0", "metres_per_pixel = nan", "map.metres_per_pixel"),
        ("timeout = 30.0", "timeout = 0", "evaluation.timeout"),
        ("max_failures = 0.5", "max_failures = 2", "evaluation.max_failures"),
        ("mutation = 2", "mutation = inf", "operators.mutation.weight"),
        ("mutation = 2", "mutation = { weight = 2, sigma = -0.5 }", "operators.mutation.sigma"),
        ("mutation = 2", "mutation = { sigma = true }", "operators.mutation.sigma"),
        ("mutation = 2", "mutation = { move = 2.5 }", "operators.mutation.move"),
        ("mutation = 2", "mutation = { iso = nan }", "operators.mutation.iso"),
        ("mutation = 2", "mutation = { repair = true }", "operators.mutation.repair"),
        ("mutation = 2", "mutation = 1e308", "operators.mutation.weight"),
        ("size_max = 6", "fill = [0.2, 0.3, 0.5]", "operators.pavement_fusion.fill"),
        ("size_max = 6", "fill = 0.3, parents = 3", "operators.pavement_fusion.fill"),
        ("size_max = 6", "fill = 0.3, void = true", "operators.pavement_fusion.fill"),
        ("size_max = 6", "fill = []", "operators.pavement_fusion.fill"),
        ("size_max = 6", "positions = [[1, 2, 3]]", "operators.pavement_fusion.positions"),
        ("size_max = 6", "parents = 10000000000", "operators.pavement_fusion.parents"),
        ("size_max = 6", "parents = 1", "operators.pavement_fusion.parents"),
        ('map = "left.npy"', 'map = "left.npy"\ncenter = [100.0]', "parents[0].center"),
        ('map = "left.npy"', 'map = "left.npy"\ncenter = [100.0, 95.0]', "parents[0].center"),
        ('map = "left.npy"', 'map = "~nouser/left.npy"', "parents[0].map"),
        ('map = "left.npy"', 'map = "a\\u0000b"', "parents[0].map"),
        ('map = "left.npy"', f'map = "{"x" * 400}"', "parents[0].map"),
        ('file = "toys.py"', 'file = "~nouser/toys.py"', "fitness[0].file"),
        ("fit = false", "reach = 40000", "genome.reach"),
        ("seed = 3", f"seed = 0x{'f' * 5000}", "run.seed"),
        ("[run]", "'x[' = 1\n[run]", "x["),
        ("[run]", "int = 1\n[run]", "int"),
        ("pixels = 64", f"pixels = 0x{'f' * 5000}", "map.pixels"),
        ("mutation = 2", "mutation = { parents = 2 }", "operators.mutation.parents"),
        ("mutation = 2", "mutation = 'often'", "operators.mutation"),
        ('file = "toys.py"', 'file = "none.py"', "fitness[0]"),
        ('file = "toys.py"', 'name = "gsi"', "fitness[0]"),
        ('file = "toys.py"', 'name = "gsi"\ntarget = 1\nlike = "lyon-1er"', "fitness[0] (gsi)"),
        ('file = "toys.py"', 'file = "toys.py"\ntarget = 1', "fitness[0] (toys.py)"),
        ('file = "toys.py"', 'name = "gsi"\nmin = 0.9\nmax = 0.1', "fitness[0] (gsi)"),
        ('file = "toys.py"', 'file = "toys.py"\nname = "rof"', "fitness[0]"),
        (
            'file = "toys.py"',
            'file = "toys.py"\n[[fitness]]\nname = "roof"\nfile = "toys.py"',
            "fitness",
        ),
        ("[[fitness]]", "[search]\nalgorithm = 'map_elite'\n[[fitness]]", "search.algorithm"),
        ("fit = false", "reach = 'some'", "genome.reach"),
        ("fit = false", "fit = 'yes'", "genome.fit"),
        ("fit = false", "domains = [40]", "genome.domains"),
        ("fit = false", "settle = 1", "genome.settle"),
        ("fit = false", "settle = 'walls'", "genome.settle"),
        ("fit = false", "topological = 'near'", "genome.topological"),
        ("fit = false", "topological = 1.5", "genome.topological"),
        ("fit = false", "sigma_max = 0.0", "genome.sigma_max"),
        ("fit = false", "sigma_max = inf", "genome.sigma_max"),
        ("fit = false", "lifs = 100", "genome.lifs"),
        ("fit = false", "max_error = 0.5", "genome.max_error"),
        ("block = 4", "block = 5", "map.pixels"),
        ("block = 4", "block = 1", "genome.block"),
        ("block = 4", "block = 4.0", "genome.block"),
        ("block = 4", "block = true", "genome.block"),
        ("block = 4", "block = [2, 16]", "genome.block"),
        *(
            ("block = 4", f"block = {sides!r}", "genome.block")
            for sides in ("3-16", "16-2", "1-8", "2-128", "2-4-8", "fine", "-2", "")
        ),
        ('name = "toy"', 'name = "a/b"', "run.name"),
    ],
)
def test_one_fault_is_told_once_at_its_key(toy, old, new, key):
    (line,) = faults(replaced(toy(), old, new))
    assert line.startswith(f"{key}: "), line


def on_leaves(toy, lines: str = 'block = "2-16"', **settings):
    """A recipe on leaves, with its sizes in metres."""
    path = toy(genome=lines, **settings)
    return replaced(path, "size_max = 6, size_min = 2", "side_max = 48, side_min = 16")


@pytest.mark.parametrize(
    ("lines", "key", "says"),
    [
        ('block = "2-16"\nlifs = 0', "genome.lifs", "1 or more"),
        ('block = "2-16"\nlifs = 2.5', "genome.lifs", "a whole number"),
        ('block = "2-16"\nmax_error = -0.1', "genome.max_error", "0 or more"),
        ('block = "2-16"\nmax_error = nan', "genome.max_error", "finite"),
        ('block = "2-16"\nlifs = 100\nmax_error = 0.5', "genome.max_error", "not both"),
        ("lifs = 100\nmax_error = 0.5", "genome.max_error", "not both"),
        ('block = "4"\nlifs = 100', "genome.lifs", "none where all range blocks have one side"),
    ],
)
def test_what_decides_of_leaves_is_checked(toy, lines, key, says):
    (line,) = faults(on_leaves(toy, lines))
    assert line.startswith(f"{key}: ")
    assert says in line


@pytest.mark.parametrize("block", ['block = "2-16"', ""])
def test_the_largest_side_divides_the_map(toy, block):
    path = replaced(on_leaves(toy, block), "pixels = 64", "pixels = 100")
    (line,) = faults(path)
    assert line.startswith("map.pixels: 100; allowed: a multiple of 16, the largest side of")
    assert "for example 96" in line


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("algorithm = 'nsga3x'", "search.algorithm: 'nsga3x'"),
        ("algorithm = 'hypervolum'", "did you mean hypervolume"),
        ("algorithm = 2", "search.algorithm: 2; allowed: text in quotes"),
        ("distinct = 1.5", "search.distinct: 1.5; allowed: 1.0 or less"),
        ("distinct = 'half'", "search.distinct: 'half'; allowed: a number"),
        ("apart = 1", "search.apart: 1; allowed: below 1"),
        ("apart = nan", "search.apart: nan"),
        ("distinkt = 0.5", "unknown key, did you mean distinct?"),
        ("tournament = 0", "search.tournament: 0; allowed: 1 or more"),
        ("tournament = 9", "search.tournament: 9, of 8 individuals; allowed: 8 or less"),
        (
            "algorithm = 'nsga3'\ntournament = 9",
            "search.tournament: 9, of 8 individuals; allowed: 8 or less",
        ),
        ("tournament = 2.5", "search.tournament: 2.5; allowed: a whole number"),
        ("credit = 'births'", "search.credit: 'births'; allowed: 'hypervolume' or 'archive'"),
        ("births = 0", "search.births: 0; allowed: 1 or more"),
        ("births = 1", "search.births: 1; allowed: 2 or more, one for each of the parents"),
        (
            "births = 4\nwindow = 4",
            "search.births: 4, with a window; allowed: no births: births enter it one at a time",
        ),
        (
            "births = 4\nalgorithm = 'cma'",
            "search.births: 4, with the algorithm 'cma'; allowed: no births: it breeds one child",
        ),
        (
            "algorithm = 'nsga2'\ngrid = [2, 2]",
            "allowed: algorithm, picks, adapt, credit, births, steer, mates, redraws, window, ",
        ),
    ],
)
def test_keys_of_the_search_are_those_of_its_algorithm(toy, lines, says):
    path = replaced(toy(), "[[fitness]]", f"[search]\n{lines}\n[[fitness]]", count=1)
    (line,) = faults(path)
    assert says in line


def test_cells_have_no_tournament(toy):
    lines = "[search]\nalgorithm = 'map_elites'\ntournament = 4\n[[fitness]]"
    told = faults(replaced(toy(), "[[fitness]]", lines, count=1))
    (line,) = [one for one in told if "tournament" in one]
    assert "search.tournament: a key of " in line
    assert "not of map_elites" in line


def test_islands_bound_the_tournament_and_breed_as_many_as_live(toy):
    islands = "[[islands]]\npopulation = 2\n[[islands]]\npopulation = 6\n"
    lines = f"[search]\ntournament = 4\nbirths = 4\n{islands}[[fitness]]"
    told = faults(replaced(toy(), "[[fitness]]", lines, count=1))
    assert "islands[0].tournament: 4, of 2 individuals; allowed: 2 or less" in "\n".join(told)
    assert "search.births: 4, with 2 islands; allowed: no births" in "\n".join(told)
    assert len(told) == 2
    own = islands.replace("population = 6", "population = 6\ntournament = 4")
    recipe = read_recipe(replaced(toy(), "[[fitness]]", f"{own}[[fitness]]", count=1))
    assert [one.search.settings["tournament"] for one in recipe.local] == [2, 4]


def test_the_algorithm_has_its_keys(toy):
    search = read_recipe(toy()).search
    common = {"algorithm": "hypervolume", "picks": 0.5, "adapt": False, "window": None}
    common |= {"credit": "hypervolume", "births": None, "tournament": 2, "steer": 0.0}
    niches = {"mates": 0.0, "redraws": 0, "per_plan": 0, "source_plans": 0.0, "twins": 0.0}
    assert search.settings == common | niches | {"distinct": 0.5, "apart": 0.25}
    lines = "[search]\nalgorithm = 'nsga2'\ndistinct = 0\n[[fitness]]"
    search = read_recipe(replaced(toy(), "[[fitness]]", lines, count=1)).search
    assert (search.keys.distinct, search.keys.apart) == (0, 0.25)
    assert search.algorithm_of(12).size == 12


def test_leaves_are_the_default_fitted_and_settled(toy):
    code = read_recipe(on_leaves(toy, "")).genome
    assert (code.block, code.root, code.fit, code.settle) == ((2, 16), 16, True, True)
    assert (code.lifs, code.max_error, code.topological) == (None, None, None)
    code = read_recipe(on_leaves(toy, 'block = "4-8"\nlifs = 99\ntopological = 0.1')).genome
    assert (code.block, code.lifs, code.topological) == ((4, 8), 99, 0.1)
    assert read_recipe(toy(genome='block = "4"')).genome.block == 4


def test_sizes_in_range_blocks_are_refused_of_leaves_with_the_metres_to_write(toy):
    path = replaced(toy(genome='block = "2-16"'), "mutation = 2", "lambda_crossover.grain = 3")
    path = replaced(path, "lambda_crossover = 1\n", "")
    told = faults(path)
    assert [line.split(":")[0] for line in told] == [
        "operators.pavement_fusion.size_min",
        "operators.pavement_fusion.size_max",
        "operators.lambda_crossover.grain",
    ]
    assert "allowed: side_min = 16 (m, 2 range blocks of 4 px)" in told[0]
    assert "allowed: side_max = 48 (m" in told[1]
    assert "allowed: grain_side = 24 (m" in told[2]
    area = replaced(toy(genome=""), "mutation = 2", "region_fusion.limit = 50")
    assert "allowed: area_max = 3200 (m², 50 range blocks" in faults(area)[-1]
    assert read_recipe(toy()).operator("pavement_fusion").size_max == 6  # one side: they mean it


def test_missing_sections_are_told(tmp_path):
    path = tmp_path / "empty.toml"
    path.write_text("")
    assert [line.split(":")[0] for line in faults(path)] == ["parents", "fitness"]


def test_files_that_are_no_recipe(tmp_path):
    with pytest.raises(RecipeError, match="demo"):
        read_recipe(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("[run\n")
    with pytest.raises(RecipeError, match="not valid TOML"):
        read_recipe(tmp_path / "bad.toml")
    (tmp_path / "bad.toml").write_text("a = " + 5000 * "[")
    with pytest.raises(RecipeError, match="of more than 32 dotted parts"):
        read_recipe(tmp_path / "bad.toml")
    (tmp_path / "bad.toml").write_text("a = " + 5000 * "9")
    with pytest.raises(RecipeError, match="thousands of digits"):
        read_recipe(tmp_path / "bad.toml")
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(RecipeError, match="UTF-8"):
        read_recipe(tmp_path / "bad.toml")


def test_overrides_are_checked_like_the_recipe(toy):
    recipe = read_recipe(toy(), population=5, seed=9, workers=1)
    assert (recipe.run.population, recipe.run.seed, recipe.worker_count) == (5, 9, 1)
    assert recipe.overrides == {"run.population": 5, "run.seed": 9, "evaluation.workers": 1}
    with pytest.raises(RecipeError, match=r"run\.population: 1; allowed: 2 or more"):
        read_recipe(toy(), population=1)


def test_operators_take_the_genomes_reach(toy):
    recipe = read_recipe(replaced(toy(), "fit = false", "reach = 'all'"))
    assert recipe.operator("mutation").reach is None
    assert recipe.operator("pavement_fusion").size_max == 6


def test_a_misspelt_key_hides_no_wrong_type_beside_it(toy):
    found = faults(
        replaced(toy(), "mutation = 2", 'mutation = { weigth = 2, sigma = "x", parents = 2 }')
    )
    assert [line.split(":")[0] for line in found] == [
        f"operators.mutation.{key}" for key in ("weigth", "parents", "sigma")
    ]
    assert "did you mean weight?; allowed: weight, parents, sigma" in found[0]
    assert "'x'; allowed: a finite number" in found[2]


def test_an_operators_own_parameters_reach_it_as_python_has_them(toy):
    given = "fill = [0.2, 0.3, 0.5], void = true, positions = [[1, 2]], repair = 'none'"
    fusion = read_recipe(replaced(toy(), "size_max = 6", given)).operator("pavement_fusion")
    assert (fusion.fill, fusion.positions, fusion.repair) == ([0.2, 0.3, 0.5], [[1, 2]], None)


def test_a_domain_size_named_twice_counts_once(toy):
    path = replaced(toy(), "fit = false", "domains = [3, 2, 3]")
    recipe = read_recipe(path)
    assert recipe.genome.domains == [3, 2]
    assert recipe.operator("mutation").domains == (3, 2)


def test_cities_that_are_nearly_bundled(toy):
    (line,) = faults(replaced(toy(), "left.npy", "lyon-ler"))
    assert "did you mean lyon-1er?" in line


def test_without_a_number_of_workers_all_cores_that_may_be_used_work(toy, monkeypatch):
    recipe = read_recipe(replaced(toy(workers=2), "workers = 2", ""))
    monkeypatch.setattr("evocity.recipe.recipe.available_cores", lambda: 3)
    assert recipe.worker_count == 3


def test_a_broken_plugin_is_told_where_its_operator_is_missed(toy, monkeypatch):
    class Broken:
        name, value = "splice", "afar:Splice"

        def load(self):
            raise ImportError("its library is missing")

    monkeypatch.setattr("evocity.plugins.entry_points", lambda group: [Broken()])
    operator_registry._plugins.cache_clear()
    try:
        assert read_recipe(toy()).operator("mutation")
        (line,) = faults(replaced(toy(), "mutation = 2", "splice = 2"))
    finally:
        operator_registry._plugins.cache_clear()
    assert line.startswith("operators.splice: unknown operator")
    assert "plugin splice (afar:Splice) not loaded: ImportError: its library is missing" in line


@pytest.mark.parametrize("name", recipes())
def test_bundled_recipes_have_no_faults(name):
    assert read_recipe(name).text


def test_a_slip_in_a_line_is_shown(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[run]\nseed = 1\n[[fitness]]\ntarget = 1,2\n")
    with pytest.raises(RecipeError, match="target = 1,2; numbers have a point"):
        read_recipe(path)
    with pytest.raises(RecipeError, match=r"did you mean mine\.toml\?"):
        read_recipe(tmp_path / "mine.tml")
