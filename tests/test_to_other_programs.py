"""The page of other programs: its commands work, and Blender and QGIS open their files."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from cli_tools import call

import evocity

PAGE = Path(__file__).parent.parent / "docs" / "to-other-programs.md"
BLENDER = shutil.which("blender")
# QGIS has the Python of the system.
SYSTEM_PYTHON = "/usr/bin/python3"

# The genome of the page is smaller here, and its tiles divide it.
SMALLER = ("--pixels", "128", "--block", "4", "--no-fit")

# The importer of Blender 3.4 needs a name that NumPy 1.24 lacks, as the page says.
NUMPY_1_24 = "import numpy\nnumpy.bool = bool\n"

CHECKED = """
messages = []
QgsApplication.messageLog().messageReceived.connect(lambda text, *_: messages.append(text))
from qgis.core import QgsCoordinateReferenceSystem
assert buildings.isValid() and heights.isValid()
assert buildings.renderer().type() == "graduatedSymbol"
assert heights.renderer().type() == "singlebandpseudocolor"
assert "transverse Mercator" in buildings.crs().description()
number, _, names, _, _ = buildings.listStylesInDatabase()
assert (number, sorted(names)) == (2, ["classes", "heights"]), names
placed = {}
for name, kind in (("buildings", "graduatedSymbol"), ("street_edges", "graduatedSymbol"),
                   ("street_nodes", "singleSymbol"), ("places", "singleSymbol")):
    layer = QgsVectorLayer(f"streets.gpkg|layername={name}", name, "ogr")
    assert layer.isValid() and layer.crs().authid() == "EPSG:2154", name
    assert layer.renderer().type() == kind, name
    placed[name] = layer
assert {field.name() for field in buildings.fields()} >= {"id", "height", "area", "class"}
for path in ("lyon.fgb", ):
    layer = QgsVectorLayer(path, "table", "ogr")
    assert layer.isValid() and layer.featureCount() == buildings.featureCount()
from qgis.core import QgsMapRendererParallelJob, QgsMapSettings
from qgis.PyQt.QtCore import QSize
for name, layers in (("vector", list(placed.values())), ("raster", [heights])):
    settings = QgsMapSettings()
    settings.setLayers(layers)
    settings.setDestinationCrs(layers[0].crs())
    settings.setExtent(layers[0].extent())
    settings.setOutputSize(QSize(256, 256))
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    picture = job.renderedImage()
    colours = {picture.pixel(x, y) for x in range(256) for y in range(256)}
    assert len(colours) > 8, name
    assert picture.save(f"{name}.png")
assert not messages, messages
print("opened", buildings.featureCount())
"""


def blocks(language: str) -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


COMMANDS = [
    line for block in blocks("sh") for line in block.splitlines() if line.startswith("evocity ")
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A folder with the genome of the page."""
    made = tmp_path_factory.mktemp("programs")
    first = shlex.split(COMMANDS[0])[1:]
    call(*first[:-1], made / first[-1], *SMALLER)
    return made


def run_command(folder: Path, line: str, monkeypatch) -> Path:
    """Run a line of the page in the folder, and return the path of its output."""
    monkeypatch.chdir(folder)
    words = shlex.split(line)[1:]
    call(*words)
    return folder / words[words.index("-o" if "-o" in words else "--tiles") + 1]


def test_the_page_names_all_programs_in_few_steps():
    text = PAGE.read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", text, re.M | re.S))
    assert set(sections) == {
        "Blender", "Unreal and Unity", "Rhino and CAD", "QGIS", "Cesium", "A printer",
    }  # fmt: skip
    for name, section in sections.items():
        assert 3 <= len(re.findall(r"^\d\. ", section, re.M)) <= 5, name


@pytest.mark.parametrize("line", COMMANDS[1:])
def test_each_command_of_the_page_writes_its_file(folder, line, monkeypatch):
    output = run_command(folder, line, monkeypatch)
    if output.is_dir():
        assert (output / "tileset.json").is_file()
    else:
        assert output.stat().st_size > 1000


@pytest.fixture(scope="module")
def written(folder, request) -> Path:
    """The folder with the files of all commands."""
    with pytest.MonkeyPatch.context() as patch:
        for line in COMMANDS[1:]:
            run_command(folder, line, patch)
    return folder


@pytest.mark.clients
@pytest.mark.skipif(BLENDER is None, reason="Blender is not installed")
def test_blender_opens_the_scene_as_the_page_says(written):
    (block,) = blocks("python blender")
    script = written / "open.py"
    script.write_text(NUMPY_1_24 + block, encoding="utf-8")
    words = (BLENDER, "-b", "--python-exit-code", "1", "-P", script)
    told = subprocess.run(words, cwd=written, capture_output=True, text=True, timeout=240)
    assert told.returncode == 0, told.stderr
    count, highest = re.search(r"(\d+) buildings, the highest ([\d.]+)", told.stdout).groups()
    assert int(count) > 20
    assert 5 < float(highest) < 60


SYSTEMS = """
from qgis.core import QgsApplication, QgsRasterLayer, QgsVectorLayer
app = QgsApplication([], False)
app.initQgis()
heights, buildings = QgsRasterLayer("a.tif", "heights"), QgsVectorLayer("a.gpkg", "a", "ogr")
assert heights.isValid() and heights.crs().isValid()
assert heights.crs() == buildings.crs(), (heights.crs().toWkt(), buildings.crs().toWkt())
print(buildings.crs().description())
"""


def ask_qgis(folder: Path, script: Path) -> subprocess.CompletedProcess:
    settings = {"QT_QPA_PLATFORM": "offscreen", "HOME": str(folder), "LC_ALL": "C.UTF-8"}
    settings["XDG_RUNTIME_DIR"] = str(folder)
    return subprocess.run(
        (SYSTEM_PYTHON, script), cwd=folder, capture_output=True, text=True, env=settings,
        timeout=240,
    )  # fmt: skip


def has_qgis() -> bool:
    if not Path(SYSTEM_PYTHON).exists():
        return False
    words = (SYSTEM_PYTHON, "-c", "import qgis.core")
    return subprocess.run(words, capture_output=True, env={}).returncode == 0


@pytest.mark.clients
def test_qgis_opens_the_layers_as_the_page_says(written):
    if not has_qgis():
        pytest.skip("QGIS is not installed")
    (block,) = blocks("python qgis")
    script = written / "layers.py"
    script.write_text(block + CHECKED, encoding="utf-8")
    told = ask_qgis(written, script)
    assert told.returncode == 0, told.stderr
    assert "buildings, by height" in told.stdout
    assert re.search(r"opened \d+", told.stdout)
    assert "Warning" not in told.stderr, told.stderr
    assert "may only be partially supported" not in told.stderr


@pytest.mark.clients
def test_files_without_a_place_have_one_system_in_qgis(tmp_path):
    if not has_qgis():
        pytest.skip("QGIS is not installed")
    heights = np.zeros((32, 32), np.float32)
    heights[8:20, 10:24] = 9
    for suffix in (".tif", ".gpkg"):
        evocity.write_map(evocity.CityMap(heights, 2.0), tmp_path / f"a{suffix}")
    (tmp_path / "systems.py").write_text(SYSTEMS, encoding="utf-8")
    told = ask_qgis(tmp_path, tmp_path / "systems.py")
    assert told.returncode == 0, told.stderr
    assert "Metres from the south-west corner" in told.stdout
