"""What a plot shows is what the run holds, in places, numbers and colours."""

from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from evocity import plot
from evocity.analysis.thumbnails import highest_of
from evocity.coding.usage import usage
from evocity.errors import EvocityError, RunError
from evocity.pictures import city_colours, render
from evocity.plot.fronts import _axes, _wide_apart
from evocity.plot.generations import in_place, quantiles
from evocity.plot.style import BROKEN, LIVING, PAPERS, fold
from evocity.selection.fronts import Hypervolume


def line(ax, label):
    return next(one for one in ax.lines if one.get_label() == label)


def images(ax):
    return [one for one in ax.images if one.get_visible()]


def pixels(image):
    return np.asarray(image.get_array())


# -- generations ------------------------------------------------------------------------------


def test_objectives_draws_quantiles_and_the_best_of_the_living(run):
    told = run.columns
    axes = plot.objectives(run)
    assert len(axes) == len(told.aims) == 4
    born, rows = told.lives
    for ax, aim in zip(axes, told.aims, strict=True):
        kept = told.feasible[rows]
        values, when = told.value(aim.name)[rows][kept], born[kept]
        medians = [np.median(values[when == n]) for n in range(told.last + 1)]
        np.testing.assert_allclose(ax.lines[0].get_ydata(), medians)
        path = ax.collections[0].get_paths()[0].vertices
        assert path[:, 1].min() == values.min()
        assert path[:, 1].max() == values.max()
        losses = [min(map(aim.loss, values[when == n])) for n in range(told.last + 1)]
        drawn = ax.lines[1].get_ydata()
        np.testing.assert_allclose([aim.loss(value) for value in drawn], losses)
        assert to_rgb(ax.lines[1].get_color()) == to_rgb(LIVING)
    assert 0.2 in [one.get_ydata()[0] for one in axes[2].lines]  # the target
    assert 500 in [one.get_ydata()[0] for one in axes[3].lines]  # the bound


def test_quantiles_of_a_generation_without_values_are_unknown():
    found = quantiles(np.array([0, 0, 2]), np.array([1.0, 3.0, 5.0]), 4)
    np.testing.assert_array_equal(found[2], [2, np.nan, 5, np.nan])
    np.testing.assert_array_equal(found[:, 0], [1, 1.5, 2, 2.5, 3])


def test_convergence_ends_at_the_archives_hypervolume(run):
    ax = plot.convergence(run)
    living, archive = ax.lines
    np.testing.assert_array_equal(living.get_xdata(), range(run.columns.last + 1))
    assert living.get_ydata()[-1] == pytest.approx(run.archive.hypervolume_alive)
    assert archive.get_ydata()[-1] == pytest.approx(run.archive.hypervolume)
    assert (archive.get_ydata() >= living.get_ydata() - 1e-12).all()
    first = run.columns.losses[run.columns.generation == 0]
    assert archive.get_ydata()[0] == pytest.approx(Hypervolume(first)(first))


def test_diversity_compares_the_maps_of_the_living(run):
    ax = plot.diversity(run)
    apart, placed = ax.lines
    told = run.columns
    ids = told.ids[told.alive]
    cities = [run[int(one)].city.heights for one in ids]
    pairs = [np.mean(abs(a - b) > 3.05) for n, a in enumerate(cities) for b in cities[:n]]
    assert apart.get_ydata()[-1] == pytest.approx(np.mean(pairs), abs=0.02)
    own = np.mean([in_place(run[int(one)].genome) for one in ids])
    assert placed.get_ydata()[-1] == pytest.approx(own)
    assert in_place(run[0].genome) == 1  # a source city's stones lie where they lay


# -- many births ------------------------------------------------------------------------------


def test_first_and_last_counts_individuals(run):
    told = run.columns
    for ax, aim in zip(plot.first_and_last(run), told.aims, strict=True):
        first, last = (
            np.unique(told.rows(run.members(n)["id"].to_numpy())) for n in (0, told.last)
        )
        first, last = first[told.feasible[first]], last[told.feasible[last]]
        bars = [one for one in ax.patches if hasattr(one, "get_height")]
        assert sum(one.get_height() for one in bars) == len(first)
        medians = [one.get_xdata()[0] for one in ax.lines if one.get_marker() == 7]
        values = told.value(aim.name)
        np.testing.assert_allclose(medians, [np.median(values[first]), np.median(values[last])])


def test_parallel_has_a_line_an_individual_between_its_ends(run):
    told = run.columns
    rows = np.flatnonzero(told.feasible)
    ax = plot.parallel(run, of=told.ids[rows])
    (drawn,) = [one for one in ax.collections if one.get_array() is not None]
    assert len(drawn.get_segments()) == len(rows)
    for n, aim in enumerate(told.aims):
        heights = np.array([one[n, 1] for one in drawn.get_segments()])
        assert (heights.min(), heights.max()) == (0, 1)
        best = np.argmin([aim.loss(v) for v in told.value(aim.name)[rows]])
        assert aim.target is not None or heights[best] == 1


def test_those_that_break_a_constraint_are_apart_in_every_plot(broken):
    (dotted, kept) = plot.parallel(broken, of=broken.columns.ids).collections
    assert len(dotted.get_segments()) == 2
    assert len(kept.get_segments()) == 4
    assert to_rgb(dotted.get_color()[0]) == to_rgb(BROKEN)
    ax = plot.front(broken, "gsi", "fsi", thumbnails=0)
    crosses = next(one for one in ax.collections if one.get_label() == "breaks a constraint")
    assert len(crosses.get_offsets()) == 2
    shown = plot.objectives(broken, "gsi")[0]
    assert len(line(shown, "breaks a constraint").get_xdata()) == 2
    texts = [one.get_text() for one in plot.gallery(broken).texts]
    assert sum(one.endswith(" ×") for one in texts) == 2


def test_credit_draws_what_the_table_tells(run):
    ax = plot.credit(run)
    told = run.columns
    births, lived, entered = ([b.get_width() for b in bars] for bars in ax.containers)
    names = [one.get_text().replace("\n", " ") for one in ax.get_yticklabels()]
    for name, count, some, new in zip(names, births, lived, entered, strict=True):
        own = told.operator == name.replace(" ", "_")
        assert count == own.sum()
        assert some == np.count_nonzero(told.lived[own])
        assert new <= count
    assert sum(births) == len(run)


# -- fronts -----------------------------------------------------------------------------------


def test_of_a_large_front_an_even_part_is_compared(monkeypatch):
    x = np.random.default_rng(4).permutation(1000) / 999
    values = np.column_stack([x, 1 - x])
    chosen = _wide_apart(values, np.arange(1000), 3)
    assert x[chosen].tolist() == pytest.approx([0, 0.5, 1], abs=1e-3)
    monkeypatch.setattr("evocity.plot.fronts._COMPARED", 11)
    assert x[_wide_apart(values, np.arange(1000), 3)].tolist() == pytest.approx(
        [0, 0.5, 1], abs=0.1
    )


def test_front_draws_each_birth_once_where_it_lies(run):
    told = run.columns
    ax = plot.front(run, "spread", "roof", thumbnails=3)
    layers = {one.get_label(): one for one in ax.collections if one.get_label()[0] != "_"}
    offsets = np.vstack([np.asarray(one.get_offsets()) for one in layers.values()])
    wanted = np.column_stack([told.value("spread"), told.value("roof")])
    np.testing.assert_array_equal(np.unique(offsets, axis=0), np.unique(wanted[told.ok], axis=0))
    assert len(offsets) == told.ok.sum()
    ids, ranks = told.ranked()
    front = wanted[told.rows(ids[ranks == 0])]
    drawn = np.asarray(layers["the front"].get_offsets())
    np.testing.assert_array_equal(np.unique(drawn, axis=0), np.unique(front, axis=0))
    maps = ax.child_axes
    assert len(maps) == min(3, len(front))
    for at in maps:
        one = int(at.texts[0].get_text())
        assert one in ids[ranks == 0]


def test_the_axes_of_a_front_are_the_two_goals(run):
    names = [aim.name for aim in run.columns.sought]
    two = SimpleNamespace(sought=run.columns.sought[:2], run=run)
    assert _axes(two, None, None) == tuple(names[:2])
    assert _axes(two, names[1], None) == (names[1], names[0])
    assert _axes(two, None, names[0]) == (names[1], names[0])
    assert _axes(two, None, "gsi") == (names[0], "gsi")
    assert _axes(two, "x", "y") == ("x", "y")
    for sought in (run.columns.sought[:1], [*run.columns.sought, *run.columns.sought][:3], []):
        with pytest.raises(RunError, match=r"measures\s+with a goal"):
            _axes(SimpleNamespace(sought=sought, run=run), None, None)
    if len(names) == 2:
        plain, named = (plot.front(run, *axes, thumbnails=0) for axes in ((), names))
        assert plain.get_xlabel() == named.get_xlabel()
        assert plain.get_ylabel() == named.get_ylabel()


def test_a_front_of_some_draws_these_alone(run):
    ax = plot.front(run, "spread", "roof", of="id < 6", thumbnails=0)
    layers = [one for one in ax.collections if one.get_label()[0] != "_"]
    assert sum(len(one.get_offsets()) for one in layers) == run.columns.ok[:6].sum()
    assert not ax.child_axes


# -- maps -------------------------------------------------------------------------------------


def test_gallery_shows_each_map_on_one_scale(run):
    ids = [int(one) for one in run.columns.ids[run.columns.ok][:5]]
    ax = plot.gallery(run, of=ids, columns=3, order=None)
    assert [one.get_text() for one in ax.texts if one.get_text() in map(str, ids)] == list(
        map(str, ids)
    )
    assert len(images(ax)) == 5
    lefts = [image.get_extent()[0] for image in images(ax)]
    assert lefts[0] == lefts[3] == 0
    assert lefts[1] == lefts[4] > lefts[0]
    high = highest_of(run.columns)
    for one, image in zip(ids, images(ax), strict=True):
        picture = render(run[one].city, highest=high, legend=False)
        np.testing.assert_array_equal(pixels(image), np.asarray(picture))


def test_gallery_orders_and_clusters(run):
    told = run.columns
    ids = told.ids[told.ok]

    def shown(**how):
        texts = [one.get_text() for one in plot.gallery(run, of=ids, **how).texts]
        return [int(text.split()[0]) for text in texts if text.split()[0].isdigit()
                and "like" not in text and "m" not in text.split()[1:]]  # fmt: skip

    by_spread = shown(order="spread")
    values = [told.value("spread")[told.rows([one])[0]] for one in by_spread]
    assert values == sorted(values, reverse=True)
    assert sorted(shown(order="looks")) == sorted(ids)
    assert sorted(shown(clusters=2)) == sorted(ids)


@pytest.mark.parametrize(("name", "first"), [("sky_view_factor", "high"), ("slivers", "low")])
def test_gallery_is_in_the_order_of_what_was_scored_later(run, name, first):
    ids = run.columns.ids[run.columns.ok][:6]
    table = run.score(ids, name, workers=0)
    table.loc[ids[2], name] = np.nan
    ax = plot.gallery(run, of=table, order=name)
    told = [one.get_text().split("\n") for one in ax.texts if "\n" in one.get_text()]
    order = [int(head.split()[0]) for head, _ in told if run[int(head.split()[0])].feasible]
    values = table[name][order]
    assert values.dropna().tolist() == sorted(values.dropna(), reverse=first == "high")
    assert [value for head, value in told if head.split()[0] == str(ids[2])] == ["–"]
    with pytest.raises(EvocityError, match=rf"order = 'error'[\s\S]*{name}"):
        plot.gallery(run, of=table, order="error")


def test_several_axes_have_their_figure(run):
    axes = plot.objectives(run)
    assert axes.figure is axes.flat[0].figure
    assert not hasattr(axes[:0], "figure")


@pytest.mark.parametrize("what", ["sigma", "lambda", "side", "usage"])
def test_lifs_colours_one_value_alike(run, what):
    genome = run[int(run.columns.ids[-1])].genome
    ax = plot.lifs(genome, what)
    (image,) = images(ax)
    values = {
        "sigma": genome.sigma,
        "lambda": genome.part,
        "side": genome.pavement.side,
        "usage": usage(genome).calls,
    }[what]
    raster = genome.pavement.raster(np.asarray(values))
    colours = pixels(image)
    assert colours.shape[:2] == raster.shape
    for value in np.unique(raster)[:20]:
        assert len(np.unique(colours[raster == value], axis=0)) == 1
    assert image.get_extent() == [0, 128, 128, 0]  # metres


def test_usage_is_darkest_where_it_calls_most(run):
    genome = run[0].genome
    (image,) = images(plot.usage(genome))
    calls = usage(genome).pixels
    light = pixels(image).sum(axis=2, dtype=int)
    assert light[calls == calls.max()].max() <= light[calls == calls.min()].min()


def test_cities_have_one_colour_everywhere(run):
    genome = run[0].genome
    ax = plot.lifs(genome, "provenance")
    (patch,) = ax.get_legend().get_patches()
    assert to_rgb(patch.get_facecolor()) == to_rgb(city_colours(genome.cities)[0])
    drawn = plot.buildings(run[int(run.columns.ids[-1])])
    for name, colour in zip(run.header.cities, city_colours(run.header.cities), strict=True):
        own = [one for one in drawn.lines if one.get_label().startswith(f"{name}\n")]
        assert [to_rgb(one.get_color()) for one in own] == [to_rgb(colour)] * len(own)
    tree = plot.pedigree(run, int(run.columns.ids[-1]), 2)
    legend = [to_rgb(one.get_facecolor()) for one in tree.get_legend().get_patches()]
    assert legend == [to_rgb(one) for one in city_colours(run.header.cities)]


def test_difference_is_pale_where_both_are_alike(run):
    first, second = run[0], run[int(run.columns.ids[-1])]
    a, b, change = plot.difference(first, second)
    np.testing.assert_array_equal(pixels(images(a)[0]).shape, pixels(images(b)[0]).shape)
    colours = pixels(images(change)[0]).astype(int)
    up = second.city.heights - first.city.heights
    assert (colours[up > 3][:, 0] > colours[up > 3][:, 2]).all()  # red
    assert (colours[up < -3][:, 0] < colours[up < -3][:, 2]).all()  # blue
    assert len(np.unique(colours[up == 0], axis=0)) <= 1


def test_buildings_draws_every_building_of_child_parents_and_cities(run):
    child = next(one for one in run if one.parents and one.status == "ok")
    ax = plot.buildings(child, "height")
    lines = {one.get_label().split("\n")[0]: one for one in ax.lines}
    own = lines[f"individual {child.id}"]
    np.testing.assert_allclose(own.get_xdata(), np.sort(child.city.buildings.height))
    assert own.get_ydata()[-1] == 1
    assert {f"parent {one.id}" for one in child.parents} <= set(lines)
    assert {source.name for source in run.sources()} <= set(lines)
    assert not any(
        "parent" in one.get_label() for one in plot.buildings(child, parents=False).lines
    )


# -- trees and grids --------------------------------------------------------------------------


def test_pedigree_shows_who_descends_from_whom(run):
    child = next(one for one in reversed(list(run)) if one.parents and one.status == "ok")
    ax = plot.pedigree(run, child, 2)
    ids = [int(one.get_text().split(",")[0]) for one in ax.texts if ", gen." in one.get_text()]
    parents = {one.id for one in child.parents}
    grand = {one.id for parent in child.parents for one in parent.parents}
    assert sorted(ids) == sorted([child.id, *parents, *grand])
    assert len(images(ax)) == len(ids)
    (links,) = [one for one in ax.collections if hasattr(one, "get_segments")]
    assert len(links.get_segments()) == len(child.parents) + sum(
        len(one.parents) for one in child.parents if one.id in parents
    )
    ancestors = run.ancestors(child.id)["generation"].to_numpy()
    counts = np.bincount(ancestors)
    bars = [one.get_height() for one in ax.child_axes[0].patches][: len(counts)]
    np.testing.assert_array_equal(bars, counts)
    assert f"{len(ancestors) - 1} ancestors" in ax.child_axes[0].get_title("left")


def test_grid_holds_the_best_of_each_cell(cells):
    ax = plot.grid(cells)
    births = cells.archive.births
    assert len(images(ax)) == len(births)
    shown = {int(one.get_text()) for one in ax.texts if one.get_text().isdigit()}
    assert shown == set(births["id"].to_pylist())
    left = dict(zip(births["id"].to_pylist(), births["cell.gsi"].to_pylist(), strict=True))
    up = dict(zip(births["id"].to_pylist(), births["cell.mean_height"].to_pylist(), strict=True))
    for text in ax.texts:
        if text.get_text().isdigit():
            one = int(text.get_text())
            x, y = text.get_position()
            assert (int(x), 3 - 1 - int(y)) == (left[one], up[one])
    assert ax.get_xlim() == (0, 4)


# -- figures ----------------------------------------------------------------------------------

DRAWN = {
    "objectives": lambda run, ax: plot.objectives(run, "spread", ax=ax),
    "first_and_last": lambda run, ax: plot.first_and_last(run, "spread", ax=ax),
    "front": lambda run, ax: plot.front(run, "spread", "roof", ax=ax),
    "parallel": lambda run, ax: plot.parallel(run, ax=ax),
    "gallery": lambda run, ax: plot.gallery(run, columns=4, ax=ax),
    "convergence": lambda run, ax: plot.convergence(run, ax=ax),
    "diversity": lambda run, ax: plot.diversity(run, ax=ax),
    "credit": lambda run, ax: plot.credit(run, ax=ax),
    "pedigree": lambda run, ax: plot.pedigree(run, run[-1], 2, ax=ax),
    "lifs": lambda run, ax: plot.lifs(run[0], ax=ax),
    "usage": lambda run, ax: plot.usage(run[0], ax=ax),
    "buildings": lambda run, ax: plot.buildings(run[0], ax=ax),
}


def test_every_plot_is_drawn_in_the_table():
    assert {*DRAWN, "grid", "difference"} == set(plot.__all__)


@pytest.mark.parametrize("name", DRAWN)
def test_axes_that_are_given_are_drawn_on_and_no_setting_changes(run, name):
    before = dict(matplotlib.rcParams)
    figure = Figure()
    ax = figure.add_subplot()
    found = DRAWN[name](run, ax)
    assert ax in np.ravel(np.asarray(found, dtype=object))
    assert dict(matplotlib.rcParams) == before
    assert "pyplot" not in dir(matplotlib) or not matplotlib.pyplot.get_fignums()
    figure.draw_without_rendering()


def overlapping(texts):
    boxes = [one.get_window_extent() for one in texts if one.get_text() and one.get_visible()]
    return [
        (a, b) for n, a in enumerate(boxes) for b in boxes[:n] if a.shrunk(0.8, 0.8).overlaps(b)
    ]


@pytest.mark.parametrize("name", [name for name in DRAWN if name != "front"])
def test_nothing_is_cut_and_no_texts_overlap(run, name):
    found = DRAWN[name](run, None)
    figure = np.ravel(np.asarray(found, dtype=object))[0].figure
    figure.draw_without_rendering()
    inches = figure.get_tightbbox()
    width, height = figure.get_size_inches()
    assert inches.x0 >= -0.01
    assert inches.y0 >= -0.01
    assert inches.x1 <= width + 0.01
    assert inches.y1 <= height + 0.01
    assert width <= 10
    for ax in figure.axes:
        assert not overlapping(ax.texts)


@pytest.mark.slow
def test_maps_show_metres_and_attribution(broken):
    maps = {
        "gallery": plot.gallery(broken),
        "front": plot.front(broken, "gsi", "fsi"),
        "pedigree": plot.pedigree(broken, 5),
        "lifs": plot.lifs(broken[0]),
        "usage": plot.usage(broken[0]),
        "difference": plot.difference(broken[0], broken[1])[0],
    }
    assert broken.header.attribution == "© left"
    for name, ax in maps.items():
        texts = [one.get_text() for one in ax.figure.findobj(matplotlib.text.Text)]
        assert any(text.endswith(" m") and text[:-2].isdigit() for text in texts), name
        assert any("© left" in text for text in texts), name


def test_a_legend_within_axes_lies_on_paper(run):
    """Lines of data would run through its words."""
    ax = Figure().add_subplot()
    plot.objectives(run, "spread", ax=ax)
    frame = ax.get_legend().get_frame()
    assert ax.get_legend().get_frame_on()
    assert matplotlib.colors.to_hex(frame.get_facecolor()) == PAPERS
    assert 0.5 < frame.get_alpha() < 1


def test_a_notebook_shows_the_figure(run):
    assert plot.convergence(run)._repr_png_().startswith(b"\x89PNG")
    assert plot.objectives(run, "spread")._repr_png_().startswith(b"\x89PNG")


def test_long_names_are_folded_where_words_end():
    assert fold("gsi") == "gsi"
    assert fold("open_space_connectivity", 14) == "open_space_\nconnectivity"
    assert all(len(line) <= 44 for line in fold("x" * 300).split("\n"))
