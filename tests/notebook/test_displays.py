"""What notebooks show: static, escaped, small, with alt texts and attributions."""

from html.parser import HTMLParser

import numpy as np
import pyarrow as pa
import pytest

import evocity
from evocity.errors import GenomeError
from evocity.notebook import html_of
from evocity.notebook.maps import fit_picture
from evocity.pictures import render
from evocity.search import Archive

HOSTILE = "<script>alert(1)</script>\"'&"
MOST = 150_000


class Seen(HTMLParser):
    """Elements, their attributes, and all text of a page."""

    def __init__(self, page: str):
        super().__init__()
        self.elements, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text += data


def hostile_city(side: int = 64) -> evocity.CityMap:
    heights = np.random.default_rng(1).integers(0, 30, (side, side)).astype(np.float32)
    return evocity.CityMap(heights, 2.0, name=HOSTILE, attribution=f"© {HOSTILE}")


@pytest.fixture(scope="module")
def genome():
    return evocity.encode(hostile_city(), block=8, fit=False).genome


def archive():
    rows = {
        "generation": [0, 1],
        "id": [3, 77],
        "fitness.gsi": [0.25, None],
        "crowding": [1.0, np.inf],
        "alive": [True, False],
    }
    return Archive(pa.table(rows), 0.5, 0.25)


def recipe():
    return evocity.Recipe(
        parents=["lyon-1er", {"map": "montpellier-pas-du-loup", "name": HOSTILE}],
        fitness=["alignment", {"name": "gsi", "min": 0.3, "max": 0.5}],
        run={"population": 32, "record": ["fsi"]},
    )


def shown(genome) -> dict[str, str]:
    things = {"map": hostile_city(), "genome": genome, "archive": archive(), "recipe": recipe()}
    return {name: thing._repr_html_() for name, thing in things.items()}


def test_displays_are_static_and_small(genome):
    for name, page in shown(genome).items():
        seen = Seen(page)
        tags = {tag for tag, _ in seen.elements}
        assert not tags & {"script", "iframe", "link", "object", "form", "svg"}, name
        assert len(page) <= MOST, name
        for tag, attributes in seen.elements:
            assert not any(key.startswith("on") for key in attributes), name
            assert tag != "img" or attributes["src"].startswith("data:image/png;base64,")
            assert tag != "img" or len(attributes["alt"]) > 10, name


def test_names_are_told_and_never_run(genome):
    told = {name: Seen(page).text for name, page in shown(genome).items()}
    for name in ("map", "genome", "recipe"):
        assert HOSTILE in told[name], name
    for name in ("map", "genome"):
        assert f"© {HOSTILE}" in told[name], name


def test_what_is_told(genome):
    told = {name: Seen(page).text for name, page in shown(genome).items()}
    assert "64 × 64 px of 2 m, 128 × 128 m" in told["map"]
    assert f"{len(genome)}, " in told["genome"]
    assert genome.digest[:12] in told["genome"]
    assert "2, 1 of them alive" in told["archive"]
    assert told["archive"].index("77") < told["archive"].index("0.25")  # further from the others
    assert "at least 0.3, at most 0.5" in told["recipe"]
    assert "recorded" in told["recipe"]
    assert "quarter fusion" in told["recipe"]


@pytest.mark.parametrize("side", [16, 700])
def test_any_picture_fits(side):
    noise = np.random.default_rng(2).uniform(0, 40, (side, side)).astype(np.float32)
    uri, width = fit_picture(render(evocity.CityMap(noise, 1.0)))
    assert len(uri) <= 110_000
    assert width >= 32


def test_a_fault_is_told_in_place_of_a_picture(genome, monkeypatch):
    def failing(thing):
        raise GenomeError(f"no map of {HOSTILE}", "a map", "try <b>again</b>")

    monkeypatch.setattr("evocity.notebook.maps.decode", failing)
    seen = Seen(genome._repr_html_())
    assert [tag for tag, _ in seen.elements] == ["pre"]
    assert HOSTILE in seen.text
    assert "try <b>again</b>" in seen.text


def test_only_what_is_known_is_shown():
    with pytest.raises(TypeError, match="no display of a int"):
        html_of(3)
