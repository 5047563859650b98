"""Runs with little in them, or with much; what cannot be drawn is told in three parts."""

import re
from itertools import combinations

import numpy as np
import pytest
from matplotlib.patches import Patch
from matplotlib.text import Text
from written_runs import CITY, written

import evocity
from evocity import plot
from evocity.errors import EvocityError
from evocity.genome import VOID
from evocity.pictures.colours import BARE, VOID_LABEL, city_colours, oklab, rgb, srgb
from evocity.plot.galleries import MOST
from evocity.plot.pedigrees import MOST_IN_A_ROW
from evocity.plot.style import panels


def plots_of_numbers(run):
    """Of goals gsi and fsi."""
    yield plot.objectives(run)
    yield plot.first_and_last(run)
    yield plot.convergence(run)
    yield plot.credit(run)
    yield plot.parallel(run, of=run.columns.ids)
    yield plot.front(run, "gsi", "fsi", thumbnails=0)


def plots_of_maps(run):
    yield plot.diversity(run)
    yield plot.front(run, "gsi", "fsi")
    yield plot.gallery(run, of=run.columns.ids, order="gsi", clusters=1)
    yield plot.pedigree(run, 0)


GOALS = [{"name": "gsi", "goal": "max", "max": 0.95}, {"name": "fsi", "goal": "min"}]


def values(gsi, fsi):
    return {"gsi": gsi, "fsi": fsi}


LOGS = {
    "one birth": [[{"id": 0, "operator": "source", "values": values(0.4, 2.0)}]],
    "all alike": [
        [{"id": 2 * g + n, "values": values(0.5, 0.0)} for n in range(2)] for g in (0, 1)
    ],
    "nobody keeps the constraints": [[{"id": n, "values": values(0.96, n)} for n in range(3)]],
    "failed births": [
        [
            {"id": 0, "values": values(0.4, 2.0)},
            {"id": 1, "status": "error", "error": "no", "values": {}, "genome": None},
            {"id": 2, "status": "error", "error": "it has no value", "values": {"gsi": 0.2}},
        ]
    ],
    "huge and tiny values": [
        [{"id": n, "values": values(0.1 + 1e-17 * n, (-1) ** n * 1e200)} for n in range(4)]
    ],
}


@pytest.mark.parametrize("name", LOGS)
def test_every_plot_of_a_small_run_is_drawn(tmp_path, name):
    run = written(tmp_path / "run", LOGS[name], wanted=GOALS)
    for axes in plots_of_numbers(run):
        np.ravel(np.asarray(axes, dtype=object))[0].figure.draw_without_rendering()


@pytest.mark.parametrize("name", ["one birth", "nobody keeps the constraints", "failed births"])
def test_every_map_of_a_small_run_is_drawn(tmp_path, name):
    run = written(tmp_path / "run", LOGS[name], wanted=GOALS)
    for axes in plots_of_maps(run):
        axes.figure.draw_without_rendering()


def test_a_run_without_known_goals_draws_what_it_can(tmp_path):
    run = written(
        tmp_path / "run", [[{"id": 0, "values": {"mine": 1.0}}]], wanted=[{"name": "mine"}]
    )
    assert plot.objectives(run)[0].get_ylabel() == "mine"
    plot.parallel(run)
    plot.gallery(run)


def test_a_gallery_shows_failed_births_as_such(tmp_path):
    run = written(tmp_path / "run", LOGS["failed births"], wanted=GOALS)
    ax = plot.gallery(run, of=[0, 1, 2])
    assert len(ax.images) == 2
    assert "error" in [one.get_text() for one in ax.texts]


def test_a_wide_pedigree_tells_how_many_are_left_out(tmp_path):
    first = [{"id": n, "values": values(0.4, 1.0)} for n in range(15)]
    child = [{"id": 15, "parents": tuple(range(15)), "values": values(0.4, 1.0)}]
    run = written(tmp_path / "run", [first, child], wanted=GOALS)
    ax = plot.pedigree(run, 15)
    assert len(ax.images) == 1 + MOST_IN_A_ROW
    assert f"+ {15 - MOST_IN_A_ROW}\nmore" in [one.get_text() for one in ax.texts]


def test_a_grid_with_small_cells_is_coloured(cells):
    from matplotlib.figure import Figure

    from evocity.plot import grids

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grids, "_MAP", 1e9)
        ax = grids.grid(cells)
    assert not ax.images
    squares = ax.collections[-1]
    assert len(squares.get_paths()) == len(cells.archive.births)
    assert plot.grid(cells, ax=Figure().add_subplot()).images


# -- colours ----------------------------------------------------------------------------------

# Machado, Oliveira & Fernandes 2009, severity 1, on linear RGB
DICHROMATS = {
    "all three": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                 [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


@pytest.mark.parametrize("eyes", DICHROMATS)
def test_eight_cities_are_told_apart_by_all_eyes(eyes):
    told = np.array([rgb(one) for one in city_colours([*"abcdefgh"])]) / 255
    linear = np.where(told <= 0.04045, told / 12.92, ((told + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.array(DICHROMATS[eyes]).T, 0, 1)
    seen = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    lab = oklab(seen)
    gaps = [np.linalg.norm(lab[a] - lab[b]) for a, b in combinations(range(8), 2)]
    assert min(gaps) > 0.085
    assert np.linalg.norm(lab[0] - lab[1]) > 0.25
    np.testing.assert_allclose(srgb(oklab(told)), told, atol=1e-6)


def test_bare_ground_is_no_city():
    assert city_colours([VOID_LABEL, "a"]) == city_colours([VOID, "a"])
    plain = city_colours(["a", "b", "c"])
    assert city_colours(["a", VOID, "b", "c"]) == [plain[0], BARE, *plain[1:]]
    assert city_colours([*map(str, range(9))])[8] == plain[0]


# -- faults -----------------------------------------------------------------------------------

FAULTS = {
    "a path": lambda run: plot.front(str(run.path), "spread", "roof"),
    "an unknown measure": lambda run: plot.front(run, "sprad", "roof"),
    "an unknown measure of many": lambda run: plot.objectives(run, ["spread", "roofs"]),
    "no measures": lambda run: plot.parallel(run, measures=[]),
    "an unknown id": lambda run: plot.gallery(run, of=[10**6]),
    "no condition": lambda run: plot.gallery(run, of="spread >"),
    "an unknown order": lambda run: plot.gallery(run, order="look"),
    "too many clusters": lambda run: plot.gallery(run, clusters=99),
    "no columns": lambda run: plot.gallery(run, columns=0),
    "an unknown generation": lambda run: plot.front(run, "spread", "roof", generation=99),
    "too many thumbnails": lambda run: plot.front(run, "spread", "roof", thumbnails=100),
    "thumbnails that are no number": lambda run: plot.front(run, "spread", "roof", thumbnails=True),
    "no grid": lambda run: plot.grid(run),
    "no island": lambda run: plot.grid(run, island="x"),
    "nobody's pedigree": lambda run: plot.pedigree(run, 10**6),
    "steps": lambda run: plot.pedigree(run, 0, generations=-1),
    "no genome": lambda run: plot.lifs(run),
    "an unknown map": lambda run: plot.lifs(run[0], "sigmas"),
    "an unknown count": lambda run: plot.usage(run[0], "pixel"),
    "no map": lambda run: plot.difference(run[0], 3),
    "maps of two sizes": lambda run: plot.difference(run[0], CITY),
    "no individual": lambda run: plot.buildings(CITY),
    "an unknown quantity": lambda run: plot.buildings(run[0], "areas"),
    "no axes": lambda run: plot.convergence(run, ax="here"),
    "too few axes": lambda run: plot.objectives(run, ax=panels(1)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_told_in_three_parts(run, fault):
    with pytest.raises(EvocityError) as told:
        FAULTS[fault](run)
    assert all((told.value.found, told.value.expected, told.value.remedy))


def test_too_many_maps_are_refused(tmp_path):
    births = [{"id": n, "values": values(0.4, 1.0)} for n in range(MOST + 1)]
    run = written(tmp_path / "run", [births], wanted=GOALS)
    with pytest.raises(EvocityError, match=f"at most {MOST}"):
        plot.gallery(run)


def test_without_matplotlib_an_error_names_the_extra(monkeypatch):
    def lacking(name):
        raise ImportError(name)

    monkeypatch.setattr("evocity.lazy_imports.import_module", lacking)
    monkeypatch.delitem(vars(evocity.plot), "front", raising=False)
    with pytest.raises(EvocityError, match=r"plot.front needs matplotlib") as told:
        evocity.plot.front  # noqa: B018
    assert "evocity[notebook]" in told.value.remedy


def test_dollars_and_backslashes_in_names_are_text(tmp_path):
    name = r"$\frac$ \q $"
    run = written(tmp_path / "run", [[{"id": n, "values": {name: 0.1 * n}} for n in range(3)]],
                  wanted=[{"name": name, "goal": "max"}])  # fmt: skip
    for axes in (plot.objectives(run, name), plot.parallel(run), plot.gallery(run, order=name),
                 plot.first_and_last(run, name)):  # fmt: skip
        figure = np.ravel(np.asarray(axes, dtype=object))[0].figure
        figure.draw_without_rendering()
        texts = [one.get_text() for one in figure.findobj(Text)]
        assert not [one for one in texts if re.search(r"(?<!\\)\$", one)]


def test_a_key_of_long_names_is_not_cut(tmp_path, monkeypatch):
    """One of few pictures is a narrow figure."""
    births = [[{"id": 0}], [{"id": 1, "parents": (0,)}]]
    run = written(tmp_path / "run", births, wanted=GOALS[:1])
    patches = [Patch(label="a-city-with-a-name-of-40-letters-in-all!")]
    monkeypatch.setattr("evocity.plot.pedigrees.city_patches", lambda cities: patches)
    ax = plot.pedigree(run, 1)
    ax.figure.draw_without_rendering()
    assert ax.get_legend().get_window_extent().x1 <= ax.figure.bbox.x1


@pytest.mark.slow
def test_a_pedigree_tells_where_it_is_cut(tmp_path):
    """A line of descent of sixteen steps: twelve are drawn, of however many."""
    births = [[{"id": n, "parents": (n - 1,) if n else ()}] for n in range(17)]
    run = written(tmp_path / "run", births, wanted=GOALS[:1])
    for steps, drawn, cut in ((None, 12, True), (40, 12, True), (12, 12, False), (3, 3, False)):
        ax = plot.pedigree(run, 16, steps)
        assert len([one for one in ax.texts if ", gen." in one.get_text()]) == drawn + 1
        title = ax.child_axes[0].get_title("left")
        assert title.startswith("16 ancestors")
        assert ("12 steps back at most" in title) == cut
    title = plot.pedigree(run, 9, None).child_axes[0].get_title("left")
    assert "at most" not in title, "nothing is left out"
