"""The command as a process of its own: exit codes, standard output, what is loaded."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli_tools import AT_2_M, PLAIN, call, write_recipe, write_town

from evocity.store import RunLog

EVOCITY = (sys.executable, "-m", "evocity")
OLD = Path(__file__).parent.parent / "old" / "run-6"


def process(*words, **options):
    words = [*EVOCITY, *map(str, words)]
    return subprocess.run(words, capture_output=True, text=True, encoding="utf-8", **options)


def test_help_loads_nothing_heavy():
    program = (
        "import sys\n"
        "from evocity.cli import main\n"
        "main(['--help'], prog_name='evocity', standalone_mode=False)\n"
        "heavy = {'numba', 'numpy', 'scipy', 'rasterio', 'pyarrow', 'pydantic', 'rich'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"


READING = {"rasterio", "pyogrio", "osmium", "shapely", "PIL", "pandas", "evocity.io.writers"}
COMPUTING = {"numba", "llvmlite", "numpy.f2py", "scipy.linalg", "scipy.ndimage", "scipy.sparse"}


@pytest.mark.parametrize(
    "commands",
    [
        {
            ("cities",): {"numpy", "scipy", "pyarrow", "pydantic"},
            ("operators", "list"): {"evocity.search", "evocity.fitness"},
        },
        {("fitness", "list"): {"evocity.search", "evocity.coding"}},
        {
            ("status", str(OLD)): {
                "evocity.search.engine",
                "evocity.operators",
                "evocity.coding",
                "pyarrow.compute",
            }
        },
    ],
    ids=["lists", "measures", "status"],
)
def test_commands_that_list_load_no_more_than_they_tell(commands):
    """Nothing that reads maps or compiles, and of the others no more than said: a second that
    whoever asks would wait for. One after the other in a process."""
    heavy = {
        words: found & (READING | COMPUTING | commands[words])
        for words, found in loaded_by(list(commands)).items()
    }
    assert heavy == {words: set() for words in commands}


@pytest.mark.slow
def test_commands_that_draw_load_neither_gdal_nor_what_compiles(tmp_path):
    """A genome is decoded and drawn with what is compiled already, and with nothing of SciPy's;
    ``.tif`` and ``.gpkg`` alone load what writes them."""
    town = write_town(tmp_path / "town.npy")
    call("encode", town, *AT_2_M, *PLAIN, "-o", tmp_path / "g.parquet")
    commands = [
        ("decode", str(tmp_path / "g.parquet"), "-o", str(tmp_path / "g.png")),
        ("show", str(tmp_path / "g.parquet"), "-o", str(tmp_path / "shown.png")),
        ("show", str(tmp_path / "g.parquet"), "--leaves", "-o", str(tmp_path / "leaves.png")),
    ]
    for words in commands:
        call(*words)  # compiles what is not yet
    heavy = COMPUTING - {"numba", "llvmlite"} | READING - {"PIL", "evocity.io.writers"}
    heavy |= {"numba.np.linalg", "pyproj", "scipy.special"}
    loaded = loaded_by(commands)
    assert {words: found & heavy for words, found in loaded.items()} == {
        words: set() for words in commands
    }


def loaded_by(commands):
    """By command the modules that are loaded after it, one after the other in a process."""
    program = (
        "import sys\n"
        "from evocity.cli import main\n"
        f"for words in {commands!r}:\n"
        "    main(words, prog_name='evocity', standalone_mode=False)\n"
        "    print('loaded', *sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("loaded ")]
    return dict(zip(commands, map(set, lines), strict=True))


def test_a_bad_input_ends_a_process_with_2_and_one_message(tmp_path):
    done = process("encode", tmp_path / "missing.geojson", "-o", tmp_path / "g.parquet")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("Error: no file")
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_json_is_all_there_is_on_standard_output(tmp_path):
    town = write_town(tmp_path / "town.npy")
    own = tmp_path / "own_of_process.py"
    own.write_text(
        "import evocity, os\n"
        "print('loaded')\n"
        "@evocity.fitness(goal='max')\n"
        "def of_process(city):\n"
        "    print('called')\n"
        "    os.write(1, b'from below')\n"
        "    return 1\n"
    )
    done = process("score", town, *AT_2_M, "--fitness", own, "--json")
    assert json.loads(done.stdout) == {"of_process": 1}
    done = process("encode", town, *AT_2_M, *PLAIN, "-o", tmp_path / "g.parquet", "--json")
    assert json.loads(done.stdout)["lifs"] == 256
    told = [line for line in done.stderr.splitlines() if "kernels are compiled" not in line]
    assert told == ["Note: town: the whole raster of the file, 64 × 64 px"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.long)])
def test_ctrl_c_stops_a_run_that_can_be_resumed(tmp_path, workers):
    recipe = write_recipe(tmp_path, evaluation=f"workers = {workers}")
    words = ["run", recipe, "--generations", "100000", "--out", tmp_path / "run"]
    running = subprocess.Popen(
        [*EVOCITY, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        start_new_session=True,
    )
    with running:
        for line in running.stderr:
            if line.startswith("generation"):
                break
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the workers get it too
        out, err = running.communicate(timeout=120)
    assert running.returncode == 130, err
    assert out == ""
    folder = tmp_path / "run"
    assert err.splitlines()[-1] == (
        f"Stopped. Go on with: evocity resume {folder}; "
        f"see its results with: evocity report {folder}"
    )
    assert "Traceback" not in err
    last = RunLog(folder).events()[-1]
    assert (last["event"], last["reason"]) == ("stop", "interrupted")
    before = json.loads(call("status", folder, "--json").stdout)
    assert (before["finished"], before["running"]) == (False, False)
    assert call("report", folder).stdout == f"report: {folder / 'report.html'}\n"
    call("resume", folder, "--generations", before["generation"] + 1)
    after = json.loads(call("status", folder, "--json").stdout)
    assert (after["generation"], after["finished"]) == (before["generation"] + 1, True)
