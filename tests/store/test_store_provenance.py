"""What a run was made with is told in full."""

import re
import tomllib
from pathlib import Path

import evocity
from evocity.store import environment

PROJECT = Path(__file__).parents[2] / "pyproject.toml"

# They read, draw or write maps and print: no number of a birth depends on them.
AROUND = {"llvmlite", "pillow", "shapely", "pyogrio", "pyproj", "rasterio", "affine", "osmium"}
AROUND |= {"click", "rich", "tomli-w", "jinja2", "markupsafe"}


def test_the_versions_of_all_that_computes_are_recorded():
    versions = environment()["versions"]
    assert versions.pop("evocity") == evocity.__version__
    declared = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["dependencies"]
    names = {re.match(r"[A-Za-z0-9-]+", line)[0] for line in declared}
    assert set(versions) == names - AROUND
    assert all(re.match(r"\d+\.\d+", str(version)) for version in versions.values())
