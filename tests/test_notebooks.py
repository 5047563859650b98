"""Each notebook runs, as the site runs it, on one tiny run that the first of them breeds."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

nbformat = pytest.importorskip("nbformat")
pytest.importorskip("nbclient")

ROOT = Path(__file__).parent.parent
PATHS = sorted((ROOT / "notebooks").glob("*.ipynb"))
#: How many figures and pictures each shows at least.
PICTURES = {"01": 2, "02": 10, "03": 2, "04": 3, "05": 4, "06": 0, "07": 4}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("notebooks")


@pytest.fixture(scope="module")
def rendering() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(ROOT / "docs" / "site" / "rendering.py")))


def cells(path: Path, kind: str) -> list[str]:
    notebook = nbformat.read(path, as_version=4)
    return [cell.source for cell in notebook.cells if cell.cell_type == kind]


def outputs(notebook) -> list:
    return [one for cell in notebook.cells for one in cell.get("outputs", [])]


def test_these_are_all():
    assert [path.stem[:2] for path in PATHS] == list(PICTURES)


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem[:2])
def test_notebook_runs(path, folder, rendering):
    kept = nbformat.read(path, as_version=4)
    assert not outputs(kept), "kept without outputs"
    assert all(cell.execution_count is None for cell in kept.cells if cell.cell_type == "code")
    shown = outputs(rendering.executed(path, folder))
    assert not [one.text for one in shown if one.get("name") == "stderr"]
    pictures = [one for one in shown if "image/png" in one.get("data", {})]
    assert len(pictures) >= PICTURES[path.stem[:2]]


def test_all_breed_the_same_run():
    making = {one for path in PATHS for one in cells(path, "code") if "EVOCITY_RUN" in one}
    assert len(making) == 1


def test_links_lead_somewhere():
    checked = 0
    for path in PATHS:
        for target in re.findall(r"\]\(([^)#:\s]+)[^)]*\)", "\n".join(cells(path, "markdown"))):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
            checked += 1
    assert checked > 3


@pytest.mark.slow
def test_lists_of_a_log_arrive_as_lists(folder, rendering):
    """In DuckDB, polars and pandas, which know nothing of evocity."""
    duckdb, polars = pytest.importorskip("duckdb"), pytest.importorskip("polars")
    pandas = pytest.importorskip("pandas")
    if not (folder / "tiny-run").exists():  # no notebook was run before
        rendering.executed(PATHS[5], folder)
    births = f"{folder}/tiny-run/births/*.parquet"
    told = duckdb.sql(f"SELECT id, parents, sigma FROM '{births}' ORDER BY id")
    assert [str(one) for one in told.types] == ["BIGINT", "BIGINT[]", "FLOAT[]"]
    rows = told.fetchall()
    frame = polars.read_parquet(births, columns=["id", "parents", "sigma"]).sort("id")
    assert frame.schema["parents"] == polars.List(polars.Int64)
    assert frame.rows() == rows
    table = pandas.read_parquet(folder / "tiny-run" / "births", columns=["id", "parents", "sigma"])
    table = table.sort_values("id")
    assert [(i, p.tolist(), s.tolist()) for i, p, s in table.itertuples(index=False)] == rows
    assert rows[0][1] == []
    assert max(len(parents) for _, parents, _ in rows) == 2
