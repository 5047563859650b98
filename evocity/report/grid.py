"""The grid of a run of MAP-Elites as a picture."""

import io
from importlib.util import find_spec

from PIL import Image

from evocity import plot
from evocity.analysis import Run
from evocity.report.sheet import contact_sheet

_DPI = 200


def grid_picture(run: Run, island: str | None = None) -> Image.Image:
    """Draw the grid of births of a run, or of an ``island``, as `evocity.plot.grid` does. The
    library matplotlib must be installed, which the extra ``notebook`` installs.

    Raises ValueError if the run, or the island, has no grid.
    """
    if island not in run.columns.grids:
        raise ValueError("a run without a grid")
    content = io.BytesIO()
    plot.grid(run, island).figure.savefig(content, format="png", dpi=_DPI)
    with Image.open(content) as picture:
        return picture.convert("RGB")


def run_picture(run: Run) -> Image.Image:
    """Draw a run as one picture. The picture is the grid if the run has a grid and matplotlib is
    installed, otherwise a `contact_sheet`. Raises `RunError` if the run has no complete generation
    yet, or is damaged."""
    has_grid = None in run.columns.grids and find_spec("matplotlib") is not None
    return grid_picture(run) if has_grid else contact_sheet(run)
