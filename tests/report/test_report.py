"""The report of runs of many kinds, read as a browser would without script."""

import base64
import hashlib
import io
import json
import re
from html import escape, unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
from drawn_runs import BLOCK, HOSTILE, SIDE, make_run, told_run
from PIL import Image
from toy_runs import append_events

import evocity
from evocity import fitness
from evocity.analysis.export import caption
from evocity.analysis.failed_births import shortened
from evocity.analysis.goals import Aim, planned_generations
from evocity.analysis.likeness import Likeness
from evocity.analysis.page import Page as RunPage
from evocity.analysis.page.shortlist import best_of_last
from evocity.analysis.shortlist import choose_shortlist
from evocity.analysis.thumbnails import cities_of
from evocity.errors import RunError
from evocity.fitness.heredity import integrity_of
from evocity.operators.crossover import assemble
from evocity.pictures.picture import render
from evocity.report import contact_sheet, failures, html, sheet, write_report
from evocity.report.html import WORDS, html_of, measure_texts, other_measures, search_for
from evocity.store import RunLog
from evocity.templates import data_uri, of_few_colours


@pytest.fixture(autouse=True)
def _no_scenes(monkeypatch):
    """Plans stand in their place: to draw a scene takes longer than all else of a page. Pages of
    fixtures have scenes."""
    monkeypatch.setattr(html, "_scene", html._plan)


class Page(HTMLParser):
    """Tags, what they fetch, the cards of the gallery; raises on tags that do not match."""

    VOID = frozenset({"meta", "img", "input", "br", "link"})

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.open, self.fetched, self.scripts = [], [], 0
        self.cards: dict[str, list[str]] = {}
        self.images: dict[str, list[str]] = {}
        self.ids: set[str] = set()
        self.links: list[str] = []
        self._card = None
        self.words: list[str] = []
        self.json: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        self.scripts += tag == "script"
        self.fetched += [told[key] for key in ("src", "srcset", "data", "action") if key in told]
        if "id" in told:
            self.ids.add(told["id"])
        if tag == "figure":
            self._card = told.get("id")
            if self._card:
                self.cards[self._card] = []
        if tag == "img" and self._card:
            self.images.setdefault(self._card, []).append(told["src"])
        if tag in ("a", "link"):
            self.links.append(told["href"])

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without a beginning"
        assert self.open.pop() == tag

    @property
    def text(self) -> str:
        """All words, as they follow each other."""
        return " ".join("".join(self.words).split())

    def kept(self) -> list[str]:
        return [one for one in self.cards if one.startswith("keep-")]

    @property
    def data(self) -> dict:
        """The document, the births and the pictures in the page."""
        return json.loads("".join(self.json))

    def handle_data(self, data):
        if self.open[-1:] == ["script"] and data.startswith('{"document"'):
            self.json.append(data)
        elif self.open[-1:] not in (["style"], ["script"]):
            self.words.append(data)
            if self._card:
                self.cards[self._card].append(data)


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    folder = make_run(tmp_path_factory.mktemp("report") / "run")
    return folder, write_report(folder).read_text(encoding="utf-8")


def test_the_page_fetches_nothing(usual):
    page = Page(usual[1])
    assert page.fetched
    assert all(source.startswith("data:image/png;base64,") for source in page.fetched)
    assert page.links == []
    plain = re.sub(r"<script.*?</script>", "", usual[1], flags=re.S)
    assert not re.search(r"url\(|@import|https?://", plain)


def test_only_its_own_script_may_run(usual):
    (script,) = re.findall(r'<script type="module">(.*?)</script>', usual[1], re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', usual[1])
    assert f"script-src 'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy
    assert "connect-src" not in policy
    assert not re.search(r"\son\w+=", re.sub(r"<script.*?</script>", "", usual[1], flags=re.S))


def test_the_page_holds_its_document_its_births_and_their_pictures(usual):
    folder, text = usual
    data, run = Page(text).data, evocity.open_run(folder)
    page = RunPage(run)
    assert data["document"] == json.loads(json.dumps(page.document))
    assert base64.b64decode(data["births"]) == page.table.buffer
    sheet = Image.open(io.BytesIO(base64.b64decode(data["pictures"]["image"])), formats=["WEBP"])
    ids = data["pictures"]["tiles"]
    assert set(run.members(2)["id"].to_pylist()) <= set(ids)
    pictures, _ = page.thumbnails.of(ids, 96)
    seen, wide, tall = np.asarray(sheet.convert("RGB")), data["pictures"]["width"], 32
    for place, one in enumerate(ids):
        top, left = divmod(place, data["pictures"]["across"])
        cell = seen[top * tall : (top + 1) * tall, left * wide : (left + 1) * wide]
        assert np.array_equal(cell, pictures[one])


def test_pictures_become_smaller_and_fewer_until_they_fit(usual, monkeypatch):
    page = RunPage(evocity.open_run(usual[0]))
    whole = html.picture_sheet(page)
    for most in (len(whole.image) - 1, len(whole.image) // 4, 200, 0):
        monkeypatch.setattr(html, "MOST_BYTES", most)
        sheet = html.picture_sheet(page)
        assert len(sheet.image) <= most
        assert sheet.ids == whole.ids[: len(sheet.ids)]  # the births to keep come first
        assert sheet.width <= whole.width


def test_it_lies_in_the_run_folder(usual):
    assert (usual[0] / "report.html").read_text(encoding="utf-8") == usual[1]
    assert not list(usual[0].glob(".*report*"))


def test_those_worth_keeping_stand_first_with_all_that_is_known_of_them(tmp_path):
    run = evocity.open_run(told_run(tmp_path / "run", generations=6, names="ABCDEF"))
    facts = RunPage(run)
    text = html_of(facts)
    page, kept = Page(text), run.keep()
    assert 1 < len(kept) <= 5
    assert page.kept() == [f"keep-{one.individual.id}" for one in kept]
    assert any(not one.individual.alive for one in kept)
    others = {measure.name for measure in fitness.measures()}
    for one in kept:
        birth = one.individual
        words = " ".join("".join(page.cards[f"keep-{birth.id}"]).split())
        assert one.why in words
        assert one.gave_up in words
        assert ("no longer alive" in words) == (not birth.alive)
        assert f"evocity decode RUN --id {birth.id} " in words
        assert others <= set(page.cards[f"keep-{birth.id}"])
        for value in birth.scores.values():
            assert f"{value:.4g}" in words
        shares = birth.ancestry(built=True)
        most = max(shares, key=shares.get)
        assert re.search(rf"{most}: \d+ % of the lifs, {100 * shares[most]:.0f} % of", words)
        assert len(page.images[f"keep-{birth.id}"]) == 2
    titles = re.findall("<h2>(.*?)</h2>", text)
    assert titles[0].endswith(" to keep")
    assert titles[1:3] == ["All births", "Parents"]


def test_without_an_archive_the_best_of_the_last_generation_stand_first(usual):
    folder, text = usual
    run = evocity.open_run(folder)
    assert Page(text).kept() == [f"keep-{one}" for one in best_of_last(run, 3)]
    assert "<h2>Best of the last generation</h2>" in text


def test_pictures_show_the_decoded_maps(usual):
    folder, text = usual
    images, run = Page(text).images, evocity.open_run(folder)
    for identifier in best_of_last(run, 3):
        code = images[f"keep-{identifier}"][0].partition(",")[2]
        picture = Image.open(io.BytesIO(base64.b64decode(code))).convert("L")
        heights = run[identifier].city.heights
        assert picture.size == heights.shape[::-1]
        # the scale darkens with height: ground is pale, the highest roofs are the darkest
        ground = np.asarray(picture, float)[heights == 0]
        roofs = np.asarray(picture, float)[heights >= np.quantile(heights, 0.9)]
        assert np.median(ground) > np.median(roofs) + 60


def test_measures_that_ask_for_sources_get_the_cities_of_the_run(tmp_path):
    owner = np.zeros((SIDE // BLOCK, SIDE // BLOCK), int)
    owner[:, 3:] = 1  # cuts the houses, which are two range blocks wide

    def bred(generation, slot, genomes):
        """Of generation 1 children of A and A, and of generation 2 of A and those."""
        if generation == 0 or slot:
            return genomes[slot % 2]
        pavement = genomes[0].pavement
        child = assemble(genomes, owner.ravel(), pavement)
        return (
            child if generation == 1 else assemble([genomes[0], child], owner.T.ravel(), pavement)
        )

    run = evocity.open_run(make_run(tmp_path / "run", bred=bred))
    founder, *_, second = run.individuals([0, 6, 12])
    assert run.parents([founder, second]) == [(founder.genome,), (founder.genome, run.genome(6))]
    told = other_measures(RunPage(run), cities_of(run.columns, [0, 12]))
    cities = [source.city for source in run.sources()]
    expected = integrity_of(second.genome, cities)
    assert 0 < expected < integrity_of(founder.genome, cities) == 1
    assert dict(told[12])["integrity"] == f"{expected:.4g}"


def test_parents_settings_and_attributions_are_told(usual):
    told = Page(usual[1]).text
    for part in ("© the people of A", "© the people of B", "[run]", "mutation", "numpy"):
        assert part in told


def test_a_strangers_text_is_text(tmp_path):
    folder = make_run(
        tmp_path / "run",
        names=(HOSTILE, "B"),
        measures=("gsi", HOSTILE),
        operator=HOSTILE,
        error=HOSTILE,
        fails=lambda generation, slot: slot == 3,
        recipe=f"[run]\nname = '''{HOSTILE}'''\n",
        provenance={HOSTILE: HOSTILE, "fitness": [1, {"name": "gsi", "target": HOSTILE}]},
    )
    page = Page(write_report(folder).read_text(encoding="utf-8"))
    assert page.scripts == 2  # our own, and the data
    assert all(source.startswith("data:image/png") for source in page.fetched)
    assert HOSTILE in page.words
    assert HOSTILE in page.data["document"]["about"]["cities"]


def test_failed_births_are_counted_and_never_shown(tmp_path):
    fails = {"fails": lambda generation, slot: slot % 3 == 2, "error": "gsi is nan:\n  no houses"}
    folder = make_run(tmp_path / "run", **fails)
    page = Page(write_report(folder).read_text("utf-8"))
    words = page.words
    assert words[words.index("failed") + 1 :][:2] == ["2 ", "6 error: gsi is nan: no houses"]
    assert words[words.index("error") + 1] == "6"
    assert not {one % 3 for one in page.data["pictures"]["tiles"]} & {2}
    (kind,) = failures(RunLog(folder))
    assert (kind.status, kind.count, kind.error) == ("error", 6, "gsi is nan: no houses")
    assert failures(RunLog(make_run(tmp_path / "sound"))) == []


def test_nobody_alive(tmp_path):
    folder = make_run(tmp_path / "run", fails=lambda generation, slot: True)
    page = Page(write_report(folder).read_text("utf-8"))
    assert (page.kept(), page.data["pictures"]["tiles"]) == ([], [])
    assert contact_sheet(evocity.open_run(folder)).size[0] > 0


def test_contact_sheet_shows_parents_and_best_on_one_scale(tmp_path):
    run = evocity.open_run(make_run(tmp_path / "run", names="ABCDEF"))  # nobody looks like another
    few, more = contact_sheet(run, best=1), contact_sheet(run, best=6)
    assert more.height > few.height
    living = run.individuals(run.members(2)["id"].to_pylist())
    values = np.array([[b.values[m] for m in ("gsi", "fsi")] for b in living])
    # gsi and fsi have no goal of their own: taken as more is better
    best = [run[one].scores for one in best_of_last(run, 2)]
    assert {values[:, 0].max()} <= {one["gsi"] for one in best}
    assert {values[:, 1].max()} <= {one["fsi"] for one in best}


def test_captions_of_the_contact_sheet_have_units(tmp_path):
    run = evocity.open_run(make_run(tmp_path / "run", measures=("mean_height", "gsi")))
    (best,) = best_of_last(run, 1)
    first, height, gsi = caption(run[best])
    assert first == f"individual {best}"
    assert height.startswith("mean_height ")
    assert height.endswith(" m")
    assert re.fullmatch(r"gsi [\d.]+", gsi)


def test_the_contact_sheet_marks_broken_bounds(tmp_path, monkeypatch):
    goals = [{"name": "gsi", "goal": "max", "max": 0.5}, {"name": "fsi", "min": 0.5}]
    run = evocity.open_run(make_run(tmp_path / "run", provenance={"fitness": goals}))
    seen = []
    monkeypatch.setattr(sheet, "sheet_of", lambda cells, *more: seen.append((cells, more[-1])))
    contact_sheet(run)
    (cells, note), marked = seen[0], 0
    assert note == "a cross marks a broken bound"
    for _, (first, *lines) in filter(None, cells):
        if first.startswith("individual"):
            one = run[int(first.split()[1])]
            broken = [one.scores["gsi"] > 0.5, one.scores["fsi"] < 0.5]
            assert [line.endswith(" ×") for line in lines] == broken
            assert first.endswith(" ×") == any(broken)
            marked += any(broken)
    assert marked > 0


def test_measures_say_what_they_measure(usual):
    own = Aim("of-ones-own", "km", "max", meaning="How far.")
    names = ("gsi", "alignment@old-town", "bare", "built_area_lost")
    logged, others = measure_texts([own, *(Aim(name, "", "max") for name in names)])
    gsi = evocity.fitness.get("gsi")
    assert logged["gsi"] == f"{gsi.summary} 0…1"
    assert logged["alignment@old-town"] == f"{evocity.fitness.get('alignment').summary} 0…1"
    assert (logged["of-ones-own"], logged["bare"]) == ("How far. km", "A measure of its own.")
    assert logged["built_area_lost"].endswith("0…1")
    assert set(others) == {one.name for one in evocity.fitness.measures()} - {"gsi", "alignment"}
    columns = evocity.open_run(usual[0]).columns.logged
    for name, text in measure_texts(columns)[0].items():
        assert f"<dt>{name}</dt><dd>{escape(text)}</dd>" in usual[1]


def test_parents_of_which_no_trace_is_left_are_told(tmp_path):
    run = evocity.open_run(told_run(tmp_path / "run", generations=3))
    page = RunPage(run)
    assert bool(page.shortlist.untraced) == ("None of these has more than" in html_of(page))
    founder = choose_shortlist(run.columns, np.array([0]), Likeness(run.columns), 1)
    assert founder.untraced
    page = RunPage(run)
    page.__dict__["shortlist"] = founder
    text = html_of(page)
    assert escape(founder.lacking) in text
    assert search_for(founder.untraced) in unescape(text)


def test_no_run_and_no_generation_are_said(tmp_path):
    with pytest.raises(RunError, match="no run at"):
        write_report(tmp_path)
    empty = make_run(tmp_path / "run", generations=0)
    with pytest.raises(RunError, match="generation"):
        write_report(empty)
    assert not (empty / "report.html").exists()


def test_starts_and_ends_are_told(tmp_path):
    folder = make_run(tmp_path / "run")
    for event, day in (("start", "01"), ("retry", "02"), ("stop", "03")):
        append_events(folder, {"time": f"2031-05-{day}T07:08:09.123+00:00", "event": event})
    told = " ".join(Page(write_report(folder).read_text(encoding="utf-8")).words)
    assert "start 2031-05-01 07:08:09" in told
    assert "stop 2031-05-03 07:08:09" in told
    assert "2031-05-02" not in told


def test_rare_colours_survive_the_palette(town):
    heights = town.heights.copy()
    heights[5:7, 5:7] = 90  # four pixels of the darkest colour
    picture = render(town.replace(heights), highest=90, legend=False)
    code = data_uri(picture).partition(",")[2]
    kept = Image.open(io.BytesIO(base64.b64decode(code))).convert("RGB")
    assert np.abs(np.asarray(kept, int) - np.asarray(picture, int)).max() <= 8


def test_few_colours_are_kept_and_many_are_as_near_as_pillow_has_them(town):
    few = Image.fromarray(np.arange(360).astype(np.uint8).reshape(10, 12, 3))
    assert np.array_equal(np.asarray(of_few_colours(few).convert("RGB")), np.asarray(few))
    picture = render(town, zoom=4, legend=False)
    assert len(picture.getcolors(picture.width * picture.height)) > 200
    own = picture.quantize(128, Image.Quantize.MAXCOVERAGE, 2, dither=Image.Dither.NONE)
    off = [
        np.square(np.asarray(one.convert("RGB"), float) - np.asarray(picture)).mean()
        for one in (of_few_colours(picture), own)
    ]
    assert off[0] <= 1.05 * off[1]


def test_a_long_reason_is_shortened():
    assert shortened("a " * 200, most=9) == "a a a a …"
    assert shortened("as it is") == "as it is"


@pytest.mark.parametrize(
    ("recipe", "planned"),
    [("[run]\ngenerations = 7\n", 7), ("[map]\n", 100), ("no toml", None), ("run = 3", 100)],
)
def test_generations_planned_are_the_recipes(tmp_path, recipe, planned):
    assert planned_generations(RunLog(make_run(tmp_path / "run", recipe=recipe))) == planned


@pytest.mark.parametrize(("population", "heading"), [(1, "One to keep"), (2, "Two to keep")])
def test_with_a_single_goal_living_births_stand_beside_the_best(tmp_path, population, heading):
    goals = {"provenance": {"fitness": [{"name": "gsi", "goal": "max"}]}, "measures": ("gsi",)}
    folder = make_run(tmp_path / "run", population=population, generations=1, **goals)
    page = Page(write_report(folder).read_text("utf-8"))
    assert len(page.kept()) == population
    assert heading in page.text
    run = evocity.open_run(folder)
    best, *others = run.keep()
    assert best.individual.id == run.archive.ids.tolist()[0]
    assert all(one.role == "of another kind" and one.individual.alive for one in others)
    assert len(run.keep(1)) == len(run.keep(of=run.archive.ids)) == 1


def test_words_are_explained_where_they_stand(usual):
    glossary = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text("utf-8").lower()
    for word, told in WORDS.items():
        assert re.search(rf"^\|[^|]*{word}", glossary.replace("-", " ").replace("`", ""), re.M)
        assert told.endswith(".")
    for word in ("front", "birth", "hypervolume", "lifs", "seed"):
        assert f'<abbr title="{WORDS[word]}">' in usual[1]


@pytest.mark.parametrize("name", ["plain", "it's & \\n", 'say "x"', "</pre>", "\u2028"])
def test_what_finds_them_is_python_whatever_they_are_called(name):
    shares = pandas.DataFrame({name: [0.5, 0.01], "other": [0.2, 0.9]}, [3, 4])
    run = SimpleNamespace(ancestry=lambda which: shares, keep=lambda n, of: list(of.index))
    said = []
    names = {"evocity": SimpleNamespace(open_run=lambda path: run), "print": said.append}
    exec(search_for([name, "other"]).removeprefix("import evocity\n"), names)
    assert said == [[3]]


def test_a_run_without_its_sources_is_said(tmp_path):
    folder = make_run(tmp_path / "run")
    for path in (folder / "sources").iterdir():
        path.unlink()
    with pytest.raises(RunError, match="is missing"):
        write_report(folder)
