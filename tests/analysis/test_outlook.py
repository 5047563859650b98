"""Targets and bounds that a real run does not reach, and the sentences about them."""

import math
from types import SimpleNamespace
from unittest.mock import patch

import pytest
from toy_runs import write_toy
from written_runs import written

import evocity
from evocity.analysis.outlook import outlook, unreachable
from evocity.analysis.slope import more_births
from evocity.fitness import registry

GSI = '\n[[fitness]]\nname = "gsi"\n'


def bred(folder, recipe: str):
    """A run of two generations."""
    path = write_toy(folder, recipe=recipe, generations=2, workers=0)
    with (
        patch.dict(registry._from_files),
        evocity.Search(evocity.read_recipe(path), out=folder / "run") as search,
    ):
        list(search)
    return evocity.open_run(folder / "run")


@pytest.mark.slow
def test_a_run_states_the_target_and_the_bound_that_no_birth_reaches(tmp_path):
    run = bred(tmp_path, f"{GSI}target = 0.05\nmin = 0.9\n")
    births, (low, high) = run.columns, (0.05, 0.9)
    values = births.value("gsi")
    own = values[births.rows(births.founders)]
    bred_values = values[~(births.operator == "source")]
    assert low < bred_values.min()
    assert bred_values.max() < high
    found = outlook(run)
    above, below = found["unreachable"]
    assert above.startswith(f"gsi (at least 0.9) was never above {bred_values.max():.3g}.") or (
        above.startswith(f"gsi 0.05 was never above {bred_values.max():.3g}.")
    )
    assert f"No parent has more than {own.max():.3g}." in above
    assert below.startswith(f"gsi 0.05 was never below {bred_values.min():.3g}.")
    assert f"No parent has less than {own.min():.3g}." in below
    assert below.endswith("Another parent with less gsi would help, or wider bounds.")
    assert found["seconds_left"] == 0


def births(*values, first=1):
    return [{"id": first + k, "values": dict(one)} for k, one in enumerate(values)]


@pytest.mark.parametrize(
    ("wanted", "values", "text"),
    [
        (  # the bound that all births near the target break
            ({"name": "gsi", "target": 0.3}, {"name": "crumbs", "max": 5}),
            [{"gsi": 0.3, "crumbs": 9.0}] * 4 + [{"gsi": 0.6, "crumbs": 1.0}] * 4,
            "gsi 0.3: each of 4 births near it breaks a bound. All of them break the bound of",
        ),
        (  # a single birth near the target
            ({"name": "gsi", "target": 0.3}, {"name": "crumbs", "max": 5}),
            [{"gsi": 0.3, "crumbs": 9.0}] + [{"gsi": 0.6, "crumbs": 1.0}] * 7,
            "gsi 0.3: the only birth near it breaks a bound. It breaks the bound of crumbs.",
        ),
        (  # bounds that only exclude each other
            ({"name": "gsi", "max": 0.4}, {"name": "crumbs", "max": 5}),
            [{"gsi": 0.3, "crumbs": 9.0}] * 4 + [{"gsi": 0.6, "crumbs": 1.0}] * 4,
            "Each of 8 births breaks a bound. 4 of them break the bound of gsi.",
        ),
        (  # a target between the births
            ({"name": "gsi", "target": 0.45}, {"name": "crumbs", "max": 10}),
            [{"gsi": 0.3, "crumbs": 9.0}] * 4 + [{"gsi": 0.6, "crumbs": 1.0}] * 4,
            None,
        ),
        (  # too few births
            ({"name": "gsi", "max": 0.4}, {"name": "crumbs", "goal": "min"}),
            [{"gsi": 0.6, "crumbs": 9.0}] * 3,
            None,
        ),
        (  # a parent that keeps the bound
            ({"name": "gsi", "max": 0.4}, {"name": "crumbs", "goal": "min"}),
            [{"gsi": 0.6, "crumbs": 9.0}] * 4,
            "gsi (at most 0.4) was never below 0.6. A parent has 0.2. More generations would help, "
            "or wider bounds.",
        ),
    ],
)
def test_a_bound_that_excludes_the_target_has_a_name(tmp_path, wanted, values, text):
    source = {"id": 0, "operator": "source", "values": {"gsi": 0.2, "crumbs": 1.0}}
    run = written(tmp_path / "run", [[source], births(*values)], wanted=wanted)
    found = unreachable(run)
    assert len(found) == (text is not None)
    assert text is None or found[0].startswith(text)


class Logged:
    """As much of a run as a slope needs: the hypervolume of each generation of ten births."""

    def __init__(self, volumes, events=(), figures=()):
        self._events, self._volumes = list(events), volumes
        self.header = SimpleNamespace(figures=figures)

    def events(self):
        return self._events

    def history(self):
        return [
            {"generation": k, "births": 10 * (k + 1), "hypervolume": volume}
            for k, volume in enumerate(self._volumes)
        ]


def test_a_slope_tells_what_as_many_births_again_bring():
    volumes = [math.log2(10 * (k + 1)) for k in range(32)]
    text = more_births(Logged(volumes))
    assert text == (
        "The last 160 of 320 births raised the hypervolume from 7.32 to 8.32. By this slope, 320 "
        "more births would bring about 9.32 (+12 %)."
    )
    flat = more_births(Logged([1.0] * 32))
    assert flat.endswith("It hardly grows: 320 more births would bring little.")
    # the living may lose what they had: what was reached counts
    assert more_births(Logged([*volumes[:-1], 5.0])).startswith("The last 160 of 320")


def test_no_slope_where_little_is_known():
    rising = [1.0 + k for k in range(32)]
    assert more_births(Logged(rising[:5])) == ""
    assert more_births(Logged([0.0] * 32)) == ""
    assert more_births(Logged([None] * 16 + [math.inf] * 16)) == ""
    assert more_births(Logged(rising, figures=("coverage",))) == ""
    reweighted = {"event": "command", "command": "reweight", "generation": 12}
    assert "from" in more_births(Logged(rising, events=[reweighted]))
    late = reweighted | {"generation": 20}
    assert more_births(Logged(rising, events=[late])) == ""
    picked = {"event": "command", "command": "pick", "generation": 20}
    assert more_births(Logged(rising, events=[picked])) == more_births(Logged(rising))
