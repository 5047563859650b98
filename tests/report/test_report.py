"""The report of runs of many kinds, read as a browser would."""

import base64
import hashlib
import io
import json
import re
import shutil
from html import escape, unescape
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
from codes import uniformly
from PIL import Image
from toy_runs import append_events, unsealed

import evocity
from evocity import fitness
from evocity.analysis.export import caption
from evocity.analysis.goals import Aim, planned_generations
from evocity.analysis.likeness import Likeness
from evocity.analysis.shortlist import choose_shortlist
from evocity.analysis.thumbnails import highest_of
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import RunError
from evocity.fitness.heredity import integrity_of
from evocity.genome import VOID
from evocity.operators.crossover import assemble
from evocity.pictures.picture import render
from evocity.report import contact_sheet, failures, tables, write_report
from evocity.report.failed_births import shortened
from evocity.report.front import pairs_to_show
from evocity.report.gallery import Galleries, city_key
from evocity.report.html import WORDS, measure_texts, page_of
from evocity.report.pictures import Pictures, data_uri
from evocity.report.plots import Axis, curve
from evocity.report.shortlist import best_of_last, search_for, shortlist_cards
from evocity.report.shown_births import MOST_SHOWN, ShownBirths
from evocity.report.summary import Summary, gain
from evocity.scene import scene
from evocity.search import archive
from evocity.store import Birth, Header, Member, RunLog, RunWriter, Source, environment
from evocity.templates import of_few_colours

SIDE, BLOCK = 32, 4
HOSTILE = '<script src="http://evil.example/x.js">alert(1)</script>&"\''


class Page(HTMLParser):
    """Tags, what they fetch, the cards of the gallery; raises on tags that do not match."""

    VOID = frozenset({"meta", "img", "input", "br", "link"})

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.open, self.fetched, self.scripts, self.svg = [], [], 0, 0
        self.cards: dict[str, list[str]] = {}
        self.told: dict[str, dict[str, str]] = {}
        self.images: dict[str, str] = {}
        self.ids: set[str] = set()
        self.links: list[str] = []
        self._card = None
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        self.scripts += tag == "script"
        self.svg += tag == "svg"
        self.fetched += [told[key] for key in ("src", "srcset", "data", "action") if key in told]
        if "id" in told:
            self.ids.add(told["id"])
        if tag == "figure":
            self._card = told.get("id")
            if self._card:
                self.cards[self._card] = []
                self.told[self._card] = told
        if tag == "img" and self._card:
            self.images.setdefault(self._card, told["src"])
        if tag in ("a", "link"):
            self.links.append(told["href"])

    def handle_startendtag(self, tag, attributes):
        self.svg += tag == "svg"

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without a beginning"
        assert self.open.pop() == tag

    @property
    def text(self) -> str:
        """All words, as they follow each other."""
        return " ".join("".join(self.words).split())

    def members(self) -> set[str]:
        """Cards of the galleries; those worth keeping have some of their own."""
        return {one for one in self.cards if one.startswith("i")}

    def kept(self) -> list[str]:
        return [one for one in self.cards if one.startswith("keep-")]

    def handle_data(self, data):
        if self.open[-1:] not in (["style"], ["script"]):
            self.words.append(data)
            if self._card:
                self.cards[self._card].append(data)


def city(seed: int, name: str) -> CityMap:
    rng = np.random.default_rng(seed)
    heights = np.kron(rng.integers(0, 5, (SIDE // 8, SIDE // 8)) * 6.0, np.ones((8, 8)))
    return CityMap(heights, 2.0, name=name, attribution=f"© the people of {name}")


def make_run(
    folder, *, measures=("gsi", "fsi"), generations=3, population=6, names=("A", "B"), **o
):
    """A run folder with drawn values: what is tested is the telling, not the search."""
    rng = np.random.default_rng(7)
    maps = [city(seed, name) for seed, name in enumerate(names)]
    header = Header(
        SIDE, SIDE, 2.0, 0.9, (*names, *o.get("also", ())), "; ".join(m.attribution for m in maps),
        None, None, 7, population, "hash", tuple(measures),
    )  # fmt: skip
    genomes = [header.chromosome.adopt(uniformly(m).genome, header, None) for m in maps]
    sources = [Source(m, g) for m, g in zip(maps, genomes, strict=True)]
    recipe = o.get("recipe", '[run]\nname = "a run"\n')
    provenance = environment() | o.get("provenance", {})
    writer = RunWriter.create(folder, recipe, provenance, header, sources)
    for generation in range(generations):
        births = [
            _birth(generation, slot, population, genomes, measures, rng, o)
            for slot in range(population)
        ]
        alive = [birth for birth in births if birth.ok]
        members = [Member(n, b.id, n % 2, {"crowding": float(n)}) for n, b in enumerate(alive)]
        best = {m: max((b.values[m] for b in alive), default=0.0) for m in measures}
        writer.write_generation(
            generation,
            births,
            members,
            {
                "births": (generation + 1) * population,
                "failures": generation,
                "hypervolume": 1.0 + generation,
                "best": best,
                "evaluations_per_second": 5.0,
            },
        )
    writer.close()
    return folder


def _birth(generation, slot, population, genomes, measures, rng, options):
    first = generation == 0 and slot < len(genomes)
    values = {name: float(rng.uniform(0, 1)) for name in measures}
    fails = options.get("fails", lambda generation, slot: False)(generation, slot)
    return Birth(
        generation=generation,
        id=generation * population + slot,
        parents=() if first else (0, max(0, (generation - 1) * population)),
        operator="source" if first else options.get("operator", "mutation"),
        status="error" if fails else "ok",
        error=options.get("error", "gsi raised") if fails else None,
        seconds=0.1,
        values={} if fails else values,
        genome=options.get("bred", _source)(generation, slot, genomes),
    )


def _source(generation, slot, genomes):
    return genomes[slot % len(genomes)]


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    folder = make_run(tmp_path_factory.mktemp("report") / "run")
    return folder, write_report(folder).read_text(encoding="utf-8")


def test_the_page_fetches_nothing(usual):
    page = Page(usual[1])
    assert page.fetched
    assert all(source.startswith("data:image/png;base64,") for source in page.fetched)
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert not re.search(r"url\(|@import|https?://", usual[1])


def test_only_its_own_script_may_run(usual):
    (script,) = re.findall(r"<script>(.*?)</script>", usual[1], re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', usual[1])
    assert f"script-src 'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy
    assert not re.search(r"\son\w+=", usual[1])


def test_large_maps_become_small_pictures(town):
    large = town.replace(np.kron(town.heights, np.ones((8, 8), np.float32)))
    code = Pictures(30.0, [large]).of("large", large).partition(",")[2]
    assert max(Image.open(io.BytesIO(base64.b64decode(code))).size) < 300


def test_starts_and_ends_are_told(tmp_path):
    folder = make_run(tmp_path / "run")
    for event, day in (("start", "01"), ("retry", "02"), ("stop", "03")):
        append_events(folder, {"time": f"2031-05-{day}T07:08:09.123+00:00", "event": event})
    told = " ".join(Page(write_report(folder).read_text(encoding="utf-8")).words)
    assert "start 2031-05-01 07:08:09" in told
    assert "stop 2031-05-03 07:08:09" in told
    assert "2031-05-02" not in told


def test_it_lies_in_the_run_folder(usual):
    assert (usual[0] / "report.html").read_text(encoding="utf-8") == usual[1]
    assert not list(usual[0].glob(".*report*"))


def test_every_measure_that_was_logged_stands_under_each_picture(usual):
    folder, text = usual
    page, run = Page(text), RunLog(folder)
    members = run.members(2)["id"].to_pylist()
    assert page.members() == {f"i{one}" for one in members}
    for birth in run.individuals(members):
        words = page.cards[f"i{birth.id}"]
        for name, value in birth.values.items():
            assert f"{value:.4g}" == words[words.index(name) + 1]


def test_all_measures_stand_under_those_that_are_looked_at_closely(usual, tmp_path):
    """Worth keeping, or the best of a run without an archive."""
    for text, mark in (
        (usual[1], '<figure class="scene"'),
        (write_report(told_run(tmp_path / "run")).read_text("utf-8"), '<figure class="kept"'),
    ):
        closely = [part.split("</figure>")[0] for part in text.split(mark)[1:]]
        assert closely
        for part in closely:
            words = re.split(r"[<>\s,]+", part)
            assert {measure.name for measure in fitness.measures()} <= set(words)


def test_pictures_show_the_decoded_maps(usual):
    folder, text = usual
    images, run = Page(text).images, RunLog(folder)
    for identifier in run.members(2)["id"].to_pylist():
        code = images[f"i{identifier}"].partition(",")[2]
        picture = Image.open(io.BytesIO(base64.b64decode(code))).convert("L")
        heights = decode(run.genome(identifier)).city.heights
        assert picture.size == heights.shape[::-1]
        # the scale darkens with height: ground is pale, the highest roofs are the darkest
        ground = np.asarray(picture, float)[heights == 0]
        roofs = np.asarray(picture, float)[heights >= np.quantile(heights, 0.9)]
        assert np.median(ground) > np.median(roofs) + 60


def test_the_best_by_each_measure_are_drawn_in_three_dimensions(usual):
    folder, text = usual
    scenes = re.findall(r'<figure class="scene"><img src="data:[^,]*,([^"]*)" alt="(.*?) in', text)
    shown = ShownBirths(evocity.open_run(folder))
    best = shown.best(3)
    assert [name for _, name in scenes] == [f"individual {one.birth.id}" for one in best] != []
    for (code, _), one in zip(scenes, best, strict=True):
        assert len(code) < 150_000
        picture = Image.open(io.BytesIO(base64.b64decode(code))).convert("RGB")
        whole = scene(one.city).picture(
            width=picture.width, highest=highest_of(shown.births), legend=False
        )
        assert picture.size == whole.size
        assert np.abs(np.asarray(picture, int) - np.asarray(whole, int)).mean() < 2


def test_captions_tell_goals_from_constraints(usual, tmp_path):
    folder, text = usual
    shown = ShownBirths(evocity.open_run(folder))
    captions = re.findall(r"<figcaption><b>individual.*?</figcaption>", text)
    assert captions
    assert shown.births.sought == shown.births.aims
    assert not any("onstraint" in one for one in captions)
    bounded = tmp_path / "bounded"
    shutil.copytree(folder, bounded)
    name = shown.births.aims[-1].name
    provenance = unsealed(bounded / "provenance.json")
    provenance["fitness"] = [{"name": name, "min": -1e9, "max": 1e9}]
    (bounded / "provenance.json").write_text(json.dumps(provenance))
    told = best_of_last(ShownBirths(evocity.open_run(bounded)), 30.0)[0].caption
    assert f". Constraints: {name} " in told
    assert "(at least -1e+09" in told
    provenance["fitness"] = [{"name": name, "min": 1e9}]
    (bounded / "provenance.json").write_text(json.dumps(provenance))
    assert (
        f". Breaks a constraint: {name} "
        in best_of_last(ShownBirths(evocity.open_run(bounded)), 30.0)[0].caption
    )


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


def test_a_shared_palette_has_the_colours_of_pictures_that_it_was_not_made_of(town):
    """A child differs in its heights, on the same scale: no pixel is off by more than one step of
    colour that the eye tells from the next, and few by any."""
    pictures = Pictures(30.0, [town])
    child = town.replace(np.minimum(np.roll(town.heights, 3, axis=1) * 1.3, 30).astype(np.float32))
    code = pictures.of(1, child).partition(",")[2]
    kept = Image.open(io.BytesIO(base64.b64decode(code))).convert("RGB")
    off = np.abs(np.asarray(kept, int) - np.asarray(render(child, highest=30, legend=False), int))
    assert off.mean() < 1
    assert off.max() <= 16


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
    told = {
        one: {name: value for name, value, _ in others}
        for one, others in ShownBirths(run).unlogged([founder, second]).items()
    }
    cities = [source.city for source in run.sources()]
    expected = integrity_of(second.genome, cities)
    assert 0 < expected < integrity_of(founder.genome, cities) == 1
    assert told[second.id]["integrity"] == expected


def test_parents_settings_lineage_and_attributions_are_told(usual):
    folder, text = usual
    told = " ".join(Page(text).words)
    for part in ("© the people of A", "© the people of B", "[run]", "mutation", "numpy"):
        assert part in told
    for one in ShownBirths(evocity.open_run(folder)).shown:
        assert one.birth.genome.shares.sum() == pytest.approx(1)


def test_it_tells_whose_stones_the_buildings_of_the_kept_are(usual):
    folder, text = usual
    run, shown = evocity.open_run(folder), ShownBirths(evocity.open_run(folder))
    for kept in shown.shortlist:
        shares = run[kept.individual.id].ancestry(built=True)
        most = max(shares, key=shares.get)
        assert re.search(f"buildings: [^<]*{most} {shares[most]:.0%}", text)


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
    assert page.scripts == 1  # our own
    assert all(source.startswith("data:image/png") for source in page.fetched)
    assert HOSTILE in page.words


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7])
def test_any_number_of_measures(tmp_path, count):
    measures = [measure.name for measure in fitness.measures()][:count]
    folder = make_run(tmp_path / "run", measures=measures)
    page = Page(write_report(folder).read_text(encoding="utf-8"))
    pairs = {1: 1, 2: 1, 3: 3, 4: 6}.get(count, 6)
    assert page.svg == pairs + 1 + count  # the front; hypervolume; the best of each
    if count > 1:
        assert len(set(pairs_to_show(evocity.open_run(folder).columns))) == pairs


def test_pairs_of_goals_come_before_pairs_with_a_bound(tmp_path):
    measures = [measure.name for measure in fitness.measures()][:6]
    wanted = [{"name": name, "goal": "max"} for name in measures[3:]]
    bounds = [{"name": name, "goal": "bounds", "max": 9.0} for name in measures[:3]]
    folder = make_run(tmp_path / "run", measures=measures, provenance={"fitness": bounds + wanted})
    shown = ShownBirths(evocity.open_run(folder))
    assert [aim.sought for aim in shown.births.aims] == [False] * 3 + [True] * 3
    assert {(3, 4), (3, 5), (4, 5)} < set(pairs_to_show(shown.births))


def test_words_beside_an_axis_keep_clear_of_its_numbers():
    for values in ([0.1, 0.2], [0.352705, 0.352725], [-1e-300, 1e-300], [6.0009, 6.0013]):
        drawing = str(curve(values, Axis("best gsi")))
        sides = re.findall(r'class="tick side" x="([\d.]+)" y="[\d.]+">([^<]+)<', drawing)
        assert min(float(x) - 6.5 * len(text) for x, text in sides) > 20  # the words end there


def test_why_births_failed_stands_beside_their_number(tmp_path):
    fails = {"fails": lambda generation, slot: slot % 3 == 2, "error": "gsi is nan:\n  no houses"}
    folder = make_run(tmp_path / "run", **fails)
    words = Page(write_report(folder).read_text("utf-8")).words
    assert words[words.index("failed") + 1 :][:2] == ["2 ", "6 error: gsi is nan: no houses"]
    (kind,) = failures(RunLog(folder))
    assert (kind.status, kind.count, kind.error) == ("error", 6, "gsi is nan: no houses")
    assert failures(RunLog(make_run(tmp_path / "sound"))) == []


def test_a_long_reason_is_shortened():
    assert shortened("a " * 200, most=9) == "a a a a …"
    assert shortened("as it is") == "as it is"


def told_run(folder, **options):
    goals = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "goal": "min"}]
    return make_run(folder, provenance={"fitness": goals}, **options)


def test_the_archive_shows_those_that_no_longer_live(tmp_path, usual):
    folder = told_run(tmp_path / "run", generations=6)
    run = RunLog(folder)
    page, found = Page(write_report(folder).read_text("utf-8")), archive(run)
    rows = found.births.to_pylist()
    gone = {row["id"] for row in rows if not row["alive"]}
    living = set(run.members(5)["id"].to_pylist())
    assert gone
    assert page.members() == {f"i{one}" for one in gone | living}
    assert not gone & living
    for birth in run.individuals(sorted(gone)):
        words = page.cards[f"i{birth.id}"]
        assert "archive" in words
        assert f"born in generation {birth.generation}, " in " ".join(words)
        for name, value in birth.values.items():
            assert f"{value:.4g}" == words[words.index(name) + 1]
    told = page.text
    assert (
        f"{len(rows)} births. No birth of the run dominates a birth in the archive. "
        f"{len(rows) - len(gone)} births in the archive are alive in the last generation, "
        "and the gallery above shows these living births. The hypervolume is "
        f"{found.hypervolume:.4g} for the archive and "
        f"{found.hypervolume_alive:.4g} for the last generation."
    ) in told
    assert page.words[page.words.index("in the archive") + 1] == str(len(rows))
    assert "does not record the goals" in " ".join(Page(usual[1]).words)


def test_a_report_of_a_run_that_goes_on_tells_of_one_generation(tmp_path, monkeypatch):
    run = evocity.open_run(told_run(tmp_path / "run", generations=6))
    whole, ends = run.generations, iter(range(1, 100))
    monkeypatch.setattr(  # one generation more each time the folder is looked at
        RunLog, "generations", property(lambda _: whole[: min(1 + next(ends), len(whole))])
    )
    shown = ShownBirths(run.refresh())
    assert shown.births.last < whole[-1]
    assert set(shown.archive.births["generation"].to_pylist()) <= set(range(shown.births.last + 1))
    assert not set(shown.gone) & {one for one, _ in shown.living}
    assert shown.births.generation.max() == shown.births.last
    assert shown.births.history[-1]["generation"] == shown.births.last


def test_an_archive_that_lives_is_one_sentence(tmp_path):
    page = Page(write_report(told_run(tmp_path / "run", generations=1)).read_text("utf-8"))
    assert len(page.members()) == 6
    assert "All births in the archive are alive in the last generation." in page.text


def test_of_a_large_archive_the_widest_apart_are_shown(tmp_path, monkeypatch):
    shown = ShownBirths(evocity.open_run(told_run(tmp_path / "run", generations=6)))
    crowding = {row["id"]: row["crowding"] for row in shown.archive.births.to_pylist()}
    spread = [crowding[one] for one in shown.gone]
    assert spread == sorted(spread, reverse=True)
    monkeypatch.setattr("evocity.report.shown_births.MOST_SHOWN", 1)
    assert [one.birth.id for one in shown.shown_gone] == shown.gone[:1]
    told = write_report(shown.run.path).read_text("utf-8")
    assert f"Among the {len(shown.gone)} births that are no longer alive, the page shows" in told


@pytest.mark.parametrize(
    ("volumes", "failed", "said"),
    [
        ([1.0, 3.0], 0, "+200% over the first population"),
        ([0.02, 3.0], 0, "0.02 in the first population"),
        ([0.0, 3.0], 0, "0 in the first population"),
        ([1.0, 3.0], 4, "1 in the first population"),
        ([1.0, None], 0, ""),
        ([1.0], 0, ""),
    ],
)
def test_the_gain_is_a_share_where_a_share_tells(tmp_path, volumes, failed, said):
    fails = {"fails": lambda generation, slot: generation == 0 and slot < failed}
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "run", **fails)))
    shown.births.__dict__["history"] = [{"hypervolume": volume} for volume in volumes]
    assert gain(shown.births) == said


def test_what_replaced_the_recipe_stands_beside_it(tmp_path, usual):
    noted = {"recipe": {"overrides": {"run.seed": 8, "run.generations": 40}}}
    folder = make_run(tmp_path / "second", provenance=noted)
    shown = ShownBirths(evocity.open_run(folder))
    assert planned_generations(shown.run) == 40
    page = Page(write_report(folder).read_text("utf-8"))
    assert page.words[page.words.index("run.seed") + 1] == "8"
    assert "replaced on the command line" in page.words
    assert "replaced on the command line" not in Page(usual[1]).words


def test_a_report_is_called_as_its_folder(tmp_path):
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "a run-2")))
    assert shown.run.name == "a run-2"
    assert "a run-2" in Page(write_report(shown.run.path).read_text("utf-8")).words


@pytest.mark.parametrize(
    ("recipe", "planned"),
    [("[run]\ngenerations = 7\n", 7), ("[map]\n", 100), ("no toml", None), ("run = 3", 100)],
)
def test_generations_planned_are_the_recipes(tmp_path, recipe, planned):
    assert planned_generations(RunLog(make_run(tmp_path / "run", recipe=recipe))) == planned


def test_captions_of_the_contact_sheet_have_units(tmp_path):
    shown = ShownBirths(
        evocity.open_run(make_run(tmp_path / "run", measures=("mean_height", "gsi")))
    )
    (best,) = shown.best(1)
    first, height, gsi = caption(best.birth.id, shown.births.logged, best.birth.values)
    assert first.startswith("individual ")
    assert height.startswith("mean_height ")
    assert height.endswith(" m")
    assert re.fullmatch(r"gsi [\d.]+", gsi)


def test_one_generation(tmp_path):
    page = Page(write_report(make_run(tmp_path / "run", generations=1)).read_text("utf-8"))
    assert page.svg == 1
    assert len(page.members()) == 6


def test_failed_births_are_counted_and_never_shown(tmp_path):
    folder = make_run(tmp_path / "run", fails=lambda generation, slot: slot % 3 == 2)
    page = Page(write_report(folder).read_text("utf-8"))
    words = page.words
    assert words[words.index("error") + 1] == "6"
    assert words[words.index("gsi raised") + 1] == "6"
    assert len(page.members()) == 4


def test_nobody_alive(tmp_path):
    folder = make_run(tmp_path / "run", fails=lambda generation, slot: True)
    page = Page(write_report(folder).read_text("utf-8"))
    assert page.members() == set()
    assert contact_sheet(evocity.open_run(folder)).size[0] > 0


def test_a_large_population_stays_a_page(tmp_path):
    folder = make_run(tmp_path / "run", population=150, generations=1)
    text = write_report(folder).read_text("utf-8")
    assert len(Page(text).members()) == MOST_SHOWN
    assert f"the {MOST_SHOWN} best of 150 individuals" in text


def test_targets_of_the_recipe_are_told(tmp_path):
    recipe = '[[fitness]]\nname = "gsi"\ntarget = 0.35\n[[fitness]]\nname = "fsi"\ngoal = "min"\n'
    folder = make_run(tmp_path / "run", recipe=recipe)
    gsi, fsi = ShownBirths(evocity.open_run(folder)).births.aims
    assert (gsi.target, gsi.wanted) == (0.35, "0.35 is wanted")
    assert gsi.loss(0.25) == pytest.approx(0.1)
    assert (fsi.wanted, fsi.loss(3.0)) == ("less is better", 3.0)


def test_the_target_found_for_a_city_to_be_like_is_told(tmp_path):
    recipe = '[[fitness]]\nname = "gsi"\nlike = "lyon-1er"\n'
    found = {"fitness": [{"name": "gsi", "goal": "like", "target": 0.6}]}
    folder = make_run(tmp_path / "run", recipe=recipe, provenance=found)
    assert ShownBirths(evocity.open_run(folder)).births.aims[0].wanted == "0.6 is wanted"
    assert "0.6 is wanted" in write_report(folder).read_text("utf-8")


def test_contact_sheet_shows_parents_and_best_on_one_scale(tmp_path):
    run = evocity.open_run(make_run(tmp_path / "run", names="ABCDEF"))  # nobody looks like another
    few, more = contact_sheet(run, best=1), contact_sheet(run, best=6)
    assert more.height > few.height
    best = ShownBirths(run).best(2)
    values = np.array([[b.values[m] for m in ("gsi", "fsi")] for b in _alive(run)])
    # gsi and fsi have no goal of their own: taken as more is better
    assert best[0].birth.values["gsi"] == values[:, 0].max()
    assert best[1].birth.values["fsi"] == values[:, 1].max()


def test_the_best_that_are_shown_differ(tmp_path):
    """Of twins the better is shown; where too few differ, the best of the others are."""
    folder = make_run(tmp_path / "run", measures=("gsi",), population=8)
    shown = ShownBirths(evocity.open_run(folder))
    alive = sorted(_alive(shown.run), key=lambda birth: -birth.values["gsi"])
    of = [birth.id % 2 for birth in alive]  # there are two cities, and their copies
    first = [0, of.index(1 - of[0])]
    assert [one.birth.id for one in shown.best(2)] == [alive[place].id for place in first]
    three = sorted([*first, next(n for n in range(8) if n not in first)])
    assert [one.birth.id for one in shown.best(3)] == [alive[place].id for place in three]


def test_the_gallery_knows_who_looks_like_another(usual):
    """Of two cities and their copies, the first of each looks like nobody before it."""
    shown = ShownBirths(evocity.open_run(usual[0]))
    ids = [one.birth.id for one in shown.shown]
    first = {next(one for one in ids if one % 2 == odd) for odd in (0, 1)}
    assert shown.look_alikes == set(ids) - first
    marked = {one for one, told in Page(usual[1]).told.items() if "data-alike" in told}
    assert marked == {f"i{one}" for one in shown.look_alikes}


@pytest.mark.parametrize(
    ("stated", "apart"),
    [({"apart": 0.4}, 0.4), ({}, 0.25), ({"apart": -1}, 0.25), ({"apart": "x"}, 0.25), (3, 0.25)],
)
def test_what_looks_alike_is_what_the_recipe_says(tmp_path, monkeypatch, stated, apart):
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "run", generations=1)))
    monkeypatch.setattr("evocity.report.shown_births.recipe_of", lambda run: {"search": stated})
    assert shown.apart == apart


# -- which to keep -----------------------------------------------------------------------------


def test_those_worth_keeping_stand_first_with_their_reasons(tmp_path):
    shown = ShownBirths(evocity.open_run(told_run(tmp_path / "run", generations=6, names="ABCDEF")))
    text = page_of(shown)
    page, kept = Page(text), shown.shortlist
    assert 1 < len(kept) <= 5
    assert page.kept() == [f"keep-{one.individual.id}" for one in kept]
    assert any(not one.individual.alive for one in kept)
    for one in kept:
        words = " ".join("".join(page.cards[f"keep-{one.individual.id}"]).split())
        assert one.why in words
        assert one.gave_up in words
        assert ("no longer alive" in words) == (not one.individual.alive)
    titles = re.findall("<h2>(.*?)</h2>", text)
    assert titles[0].endswith(" to keep")
    assert titles[1] == "Parents"
    assert "In three dimensions" not in titles


def test_those_worth_keeping_stand_beside_archive_and_parents(tmp_path):
    shown = ShownBirths(evocity.open_run(told_run(tmp_path / "run", generations=6)))
    gsi = [row["fitness.gsi"] for row in shown.archive.births.to_pylist()]
    for one in shortlist_cards(shown, Pictures(30.0, ())):
        (row,) = (row for row in one.rows if row.name == "gsi")
        low, high = map(float, row.archive.split(" to "))
        assert (low, high) == (float(f"{min(gsi):.4g}"), float(f"{max(gsi):.4g}"))
        assert low <= float(row.value) <= high
        assert row.parents == ", ".join(f"{b.values['gsi']:.4g}" for b in shown.source_births)


def test_no_near_duplicate_fills_up_those_worth_keeping(tmp_path):
    """There are two cities and their copies: beside the best by number, one of each at most."""
    shown = ShownBirths(evocity.open_run(told_run(tmp_path / "run", generations=20)))
    assert len(shown.archive) > 5
    kinds = [one.individual.id % 2 for one in shown.shortlist if one.role == "of another kind"]
    best = [one.individual.id % 2 for one in shown.shortlist if one.role != "of another kind"]
    assert len(kinds) == len({0, 1} - set(best))


@pytest.mark.parametrize("population", [1, 2])
def test_of_a_single_birth_or_goal_there_is_one_to_keep(tmp_path, population):
    goals = {"provenance": {"fitness": [{"name": "gsi", "goal": "max"}]}, "measures": ("gsi",)}
    folder = make_run(tmp_path / "run", population=population, generations=1, **goals)
    page = Page(write_report(folder).read_text("utf-8"))
    assert len(page.kept()) == 1
    assert "One to keep" in page.text


# -- apart, in order, in full ------------------------------------------------------------------


def test_those_that_break_a_constraint_are_crosses(tmp_path, usual):
    goals = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "min": 0.5}]
    folder = make_run(tmp_path / "run", provenance={"fitness": goals})
    shown, text = ShownBirths(evocity.open_run(folder)), write_report(folder).read_text("utf-8")
    broken = int((shown.births.ok & ~shown.births.feasible).sum())
    assert 0 < broken < len(shown.births.feasible)
    assert text.count('<path d="') == broken
    assert (
        text.count("<circle ") - text.count('<circle class="front"')
        == len(shown.births.feasible) - broken
    )
    key = '<i class="cross">'
    assert key in text
    assert "<path " not in usual[1]
    assert key not in usual[1]


def test_cards_can_be_ordered_and_filtered_by_every_measure(tmp_path):
    goals = [{"name": "gsi", "goal": "min"}, {"name": "fsi", "min": 0.5}]
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "run", provenance={"fitness": goals})))
    galleries = Galleries(shown, Pictures(30.0, ()))
    assert galleries.orders[2:] == ["gsi, best first", "fsi, highest first", "fsi, lowest first"]
    told = Page(page_of(shown)).told
    for one in shown.shown:
        gsi, fsi = (one.birth.values[name] for name in ("gsi", "fsi"))
        attributes = told[f"i{one.birth.id}"]
        assert json.loads(attributes["data-values"]) == [gsi, fsi]
        assert json.loads(attributes["data-keys"])[1:] == [-one.birth.id, gsi, -fsi, fsi]
        assert ("data-breaks" in attributes) == (fsi < 0.5)


def test_every_birth_has_its_numbers_while_they_fit(tmp_path, monkeypatch):
    folder = make_run(tmp_path / "run", fails=lambda generation, slot: slot == 4)
    every = tables.every_birth(evocity.open_run(folder).columns)
    births = RunLog(folder).births().to_pylist()
    assert [row[0] for row in every.rows] == [one["id"] for one in births]
    for row, one in zip(every.rows, births, strict=True):
        gsi = one["fitness.gsi"]
        assert row[every.headings.index("gsi")] == ("–" if gsi is None else f"{gsi:.4g}")
        assert (row[3] == "error") == (one["status"] == "error")
    monkeypatch.setattr(tables, "MOST_BIRTHS", 5)
    page = Page(write_report(folder).read_text("utf-8"))
    assert "The last 5 of 18 births" in page.text
    assert "evocity.open_run('RUN').to_csv('births.csv')" in page.text


def test_words_are_explained_where_they_stand(usual):
    glossary = (Path(__file__).parents[2] / "docs" / "glossary.md").read_text("utf-8").lower()
    for word, told in WORDS.items():
        assert re.search(rf"^\|[^|]*{word}", glossary.replace("-", " ").replace("`", ""), re.M)
        assert told.endswith(".")
    for word in ("front", "birth", "hypervolume", "lifs", "seed", "rank", "crowding"):
        assert f'<abbr title="{WORDS[word]}">' in usual[1]


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
    columns = ShownBirths(evocity.open_run(usual[0])).births.logged
    for name, text in measure_texts(columns)[0].items():
        assert f"<dt>{name}</dt><dd>{escape(text)}</dd>" in usual[1]


def test_parents_of_which_no_trace_is_left_are_told(tmp_path):
    shown = ShownBirths(evocity.open_run(told_run(tmp_path / "run", generations=3)))
    assert bool(shown.shortlist.untraced) == ("None of these has more than" in page_of(shown))
    founder = choose_shortlist(shown.births, np.array([0]), Likeness(shown.births), 1)
    assert founder.untraced
    shown.__dict__["shortlist"] = founder
    page = page_of(shown)
    assert escape(founder.lacking) in page
    assert search_for(founder.untraced) in unescape(page)


@pytest.mark.parametrize("name", ["plain", "it's & \\n", 'say "x"', "</pre>", "\u2028"])
def test_what_finds_them_is_python_whatever_they_are_called(name):
    shares = pandas.DataFrame({name: [0.5, 0.01], "other": [0.2, 0.9]}, [3, 4])
    run = SimpleNamespace(ancestry=lambda which: shares, keep=lambda n, of: list(of.index))
    said = []
    names = {"evocity": SimpleNamespace(open_run=lambda path: run), "print": said.append}
    exec(search_for([name, "other"]).removeprefix("import evocity\n"), names)
    assert said == [[3]]


def test_the_void_is_no_parent(tmp_path):
    """It stands in the key with what it is, and neither in the title nor among the parents."""
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "run", generations=1, also=(VOID,))))
    assert Summary(shown).cities == "A × B"
    assert "<p>A × B, " in page_of(shown)
    assert city_key(shown.run.header.cities)[2][1] == "open ground added"
    assert [birth.id for birth in shown.source_births] == [0, 1]


def _alive(run):
    return run.individuals(run.members(run.generations[-1])["id"].to_pylist())


def test_no_run_and_no_generation_are_said(tmp_path):
    with pytest.raises(RunError, match="no run at"):
        write_report(tmp_path)
    empty = make_run(tmp_path / "run", generations=0)
    with pytest.raises(RunError, match="generation"):
        write_report(empty)
    assert not (empty / "report.html").exists()


def test_a_run_without_its_sources_is_said(tmp_path):
    folder = make_run(tmp_path / "run")
    for path in (folder / "sources").iterdir():
        path.unlink()
    with pytest.raises(RunError, match="is missing"):
        write_report(folder)
