"""Commands where the system gives little: few letters, few open files, names that lead nowhere."""

import os
import subprocess
import sys

import pytest
from cli_tools import AT_2_M, PLAIN, refused, write_recipe, write_town

EVOCITY = (sys.executable, "-m", "evocity")
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")


@pytest.mark.parametrize("encoding", ["cp1252", "cp1251"])
@pytest.mark.parametrize("words", [("fitness", "list"), ("cities",), ("operators", "list")])
def test_consoles_of_few_letters_show_the_rest_as_question_marks(words, encoding):
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    done = subprocess.run([*EVOCITY, *words], capture_output=True, env=environment)
    assert done.returncode == 0, done.stderr
    done.stdout.decode(encoding)
    assert encoding == "cp1252" or b"?" in done.stdout
    assert not done.stderr


def loop(folder):
    """A name that is a loop of links."""
    for name, target in (("a.png", "b.png"), ("b.png", "a.png")):
        (folder / name).symlink_to(folder / target)
    return folder / "a.png"


def long_name(folder):
    return folder / ("n" * 300 + ".png")


@pytest.mark.parametrize("output", [loop, long_name])
def test_outputs_that_no_file_can_have(tmp_path, output):
    town = write_town(tmp_path / "town.npy", side=32)
    path = output(tmp_path)
    says = "symbolic links" if output is loop else "name too long"
    refused(tmp_path, "show", town, *AT_2_M, "-o", path, says=says)
    refused(tmp_path, "encode", town, *AT_2_M, *PLAIN, "-o", path, says=says)


@pytest.mark.parametrize(
    "words",
    [("status",), ("decode", "-o", "x.png"), ("fitness", "check"), ("fitness", "new"), ("score",)],
)
def test_arguments_that_no_file_can_have(tmp_path, words):
    refused(tmp_path, *words, "n" * 300, says="")


@linux_only
@pytest.mark.parametrize("files", [pytest.param(12, marks=pytest.mark.slow), 40])
def test_workers_need_open_files(tmp_path, files):
    recipe = write_recipe(tmp_path)
    command = f"ulimit -n {files}; exec {' '.join(EVOCITY)} run {recipe} --workers 2 --out run"
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path, encoding="utf-8"
    )
    assert done.returncode == 1
    assert f"may open only {files} files" in done.stderr
    assert "ulimit -n" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "run").exists()


@linux_only
def test_a_soft_limit_of_open_files_is_raised(tmp_path):
    program = (
        "import resource\n"
        "from evocity.evaluation.process_state import require_open_files\n"
        "hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (40, hard))\n"
        "require_open_files()\n"
        "print(resource.getrlimit(resource.RLIMIT_NOFILE)[0])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert int(done.stdout) >= 256, done.stderr


def test_kernels_without_a_writable_folder_are_compiled_once_a_command():
    program = (
        "import os, sys\n"
        "from numba.core import caching\n"
        "caching.CacheImpl._locator_classes = [caching.UserProvidedCacheLocator]\n"
        "for kind in (caching.CompileResultCacheImpl, caching.CodeLibraryCacheImpl):\n"
        "    kind._locator_classes = [caching.UserProvidedCacheLocator]\n"
        "import evocity.accelerate\n"
        "print(evocity.accelerate.cache_folder())\n"
        "print(os.environ['NUMBA_CACHE_DIR'])\n"
    )
    environment = {key: one for key, one in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    kernels, folder = done.stdout.splitlines()
    assert kernels.startswith(folder)
    assert not os.path.exists(folder)
    assert done.stderr.count("NUMBA_CACHE_DIR") == 1
