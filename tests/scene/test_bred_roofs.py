"""Roofs of source cities in genomes, in runs and in scenes of bred cities."""

import base64
import json
import zlib

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from toy_runs import forgotten  # noqa: F401

import evocity
from evocity.cli import main
from evocity.coding.source_roofs import roofs_of_map
from evocity.errors import GenomeError, MapError
from evocity.genome import ROOF_SHAPES, RoofTable, building_roofs, roof_codes, unpacked
from evocity.genome.roofs import read_roofs
from evocity.genome.writer import ROOFS_KEY
from evocity.growth import grow
from evocity.isometries import apply
from evocity.kinds import KINDS
from evocity.operators import PavementFusion
from evocity.scene.roofs import SHAPES

#: A degree of longitude and of latitude, metres, about the houses.
EAST, NORTH = 77_700.0, 111_150.0
#: What maps of the houses take.
READ = {"pixels": 128, "metres_per_pixel": 1.0, "center": (4.83, 45.76)}


def write_houses(path, shapes, size=(24, 12), apart=30, **properties):
    """A GeoJSON of houses that stand apart, 3 in a row, each with a shape or None."""
    features = []
    for k, shape in enumerate(shapes):
        x, y = (k % 3 - 1.4) * (apart + 8), (1 - k // 3) * apart
        corners = [(x, y), (x + size[0], y), (x + size[0], y + size[1]), (x, y + size[1]), (x, y)]
        ring = [[4.83 + a / EAST, 45.76 + b / NORTH] for a, b in corners]
        own = {"building": "yes", "height": 7, **properties}
        if shape is not None:
            own["roof:shape"] = shape
        geometry = {"type": "Polygon", "coordinates": [ring]}
        features.append({"type": "Feature", "geometry": geometry, "properties": own})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def expected_roofs(city, genome, maps):
    """The roofs of buildings, pixel by pixel: most pixels' shape and meaning in the maps."""
    names = {one.name: one for one in maps}
    rows, columns = unpacked(genome.source)
    codes = np.full(city.shape, -1)
    for k in range(len(genome)):
        (top, left), side = (c[k] for c in genome.pavement.corners), genome.pavement.side[k]
        own = names[genome.cities[genome.parent[k]]]
        raster = pixel_codes(own)[rows[k] : rows[k] + side, columns[k] : columns[k] + side]
        codes[top : top + side, left : left + side] = apply(int(genome.turn[k]), raster)
    found = []
    for number in range(1, len(city.buildings) + 1):
        there = codes[city.buildings.labels == number]
        found.append(np.bincount(there[there >= 0], minlength=16).argmax())
    return np.column_stack([np.array(found) % 8 - 1, np.array(found) // 8])


def pixel_codes(city):
    """The code of each built pixel, by the building whose footprint holds the point; -1 beside."""
    from evocity.scene.roofs import heights_are_ridges

    codes = np.where(city.labels > 0, 0, -1)
    for x, y, shape, _ in () if city.roof_shapes is None else city.roof_shapes:
        left, top = city.origin
        row, column = (
            int((top - y) / city.metres_per_pixel),
            int((x - left) / city.metres_per_pixel),
        )
        codes[city.building_labels == city.building_labels[row, column]] = shape + 1
    codes[codes >= 0] += 8 * heights_are_ridges(city.height_rules, city.attribution)
    return codes


def call(*words):
    result = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert result.exit_code == 0, result.output
    return result.stdout


def shapes_in(path):
    """The roofs and the heights of the eaves and of the ridges of a CityJSON file, by id."""
    document = json.loads(path.read_text(encoding="utf-8"))
    attributes = [one["attributes"] for one in document["CityObjects"].values()]
    return {
        one["id"]: (one["roof"], one["eavesHeight"], one["measuredHeight"])
        for one in attributes
        if one.get("roof") is not None
    }


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("houses")
    first = ["gabled", "flat", "hipped", "skillion", None, "gabled"]
    write_houses(folder / "left.geojson", first)
    write_houses(folder / "right.geojson", ["flat", "hipped", "pyramidal"], (30, 16), 34)
    return folder


@pytest.fixture(scope="module")
def maps(files):
    return [evocity.read_map(files / f"{name}.geojson", **READ) for name in ("left", "right")]


@pytest.fixture(scope="module")
def genomes(maps):
    return [evocity.encode(one, block=4).genome for one in maps]


def test_a_genome_file_keeps_the_shapes(maps, genomes, tmp_path):
    path = tmp_path / "left.parquet"
    genomes[0].write(path)
    assert evocity.read_genome(path).roofs == genomes[0].roofs
    call("scene", path, "-o", tmp_path / "bred.city.json", "--roofs")
    call("scene", path, "-o", tmp_path / "plain.city.json")
    made = [shape for shape, *_ in shapes_in(tmp_path / "bred.city.json").values()]
    city = evocity.decode(genomes[0]).city
    given = building_roofs(city, genomes[0])
    assert sorted(given[:, 0]) == [-1, 0, 1, 2, 2, 3]
    assert given[:, 1].all()  # `height` of OpenStreetMap
    assert [shape for shape, number in zip(made, given[:, 0], strict=True) if number >= 0] == [
        SHAPES[number] for number in given[:, 0] if number >= 0
    ]
    own = evocity.scene(maps[0], roofs=True).groups[-1].attributes["roof"]
    assert sorted(own) == sorted(made)
    assert len(SHAPES) == ROOF_SHAPES


def test_bred_buildings_have_the_roofs_of_their_stones(maps, genomes, tmp_path):
    sizes = {"size_min": 4, "size_max": 12, "tolerance": 50.0}
    mixed = 0
    for seed in range(6):
        child = PavementFusion(**sizes)(genomes, np.random.default_rng(seed))
        child.write(tmp_path / "child.parquet")
        child = evocity.read_genome(tmp_path / "child.parquet")
        assert child.roofs == genomes[0].roofs | genomes[1].roofs
        city = evocity.decode(child).city
        given = building_roofs(city, child)
        assert np.array_equal(given, expected_roofs(city, child, maps))
        mixed += len(set(given[:, 0].tolist())) > 3
        made = json.loads(
            call("scene", tmp_path / "child.parquet", "-o", tmp_path / "child.city.json",
                 "--roofs", "--json")
        )  # fmt: skip
        assert made["scenes"][0]["roofs"]["heights"] == "ridges"
        scene = evocity.scene(city, roofs=True, given_roofs=given)
        shown = {
            number: shape
            for group in scene.groups
            for number, shape in zip(
                group.attributes.get("id", []), group.attributes.get("roof", []), strict=True
            )
        }
        file = shapes_in(tmp_path / "child.city.json")
        assert {number: shape for number, (shape, *_) in file.items()} == {
            number: shape for number, shape in shown.items() if shape is not None
        }
        flat = {number for number, (shape, _) in enumerate(given.tolist(), 1) if shape == 0}
        assert all(shown[number] == "flat" for number in flat if shown.get(number))
    assert mixed


def test_isometries_turn_the_stones(genomes):
    for turn in range(8):
        turned = genomes[0].replace(turn=np.full(len(genomes[0]), turn, np.uint8))
        codes, own = roof_codes(turned), roof_codes(genomes[0])
        p = turned.pavement
        for k in range(0, len(p), 37):
            (top, left), side = (c[k] for c in p.corners), p.side[k]
            there = slice(top, top + side), slice(left, left + side)
            assert np.array_equal(codes[there], apply(turn, own[there]))


def test_heights_go_by_the_meaning_of_the_stone(files, maps, tmp_path):
    """Heights of BD TOPO are eaves, those of OpenStreetMap are ridges."""
    path = write_houses(tmp_path / "topo.geojson", ["gabled"] * 6)
    topo = evocity.read_map(path, **READ)
    topo = topo.replace(topo.heights, attribution="IGN - BD TOPO")
    assert not (roofs_of_map(topo).codes & 8).any()
    pair = [evocity.encode(one, block=4).genome for one in (topo, maps[1])]
    kinds = set()
    for seed in range(6):
        child = PavementFusion(size_min=4, size_max=12, tolerance=50.0)(
            pair, np.random.default_rng(seed)
        )
        city = evocity.decode(child).city
        given = building_roofs(city, child)
        assert np.array_equal(given, expected_roofs(city, child, [topo, maps[1]]))
        kinds |= set(given[:, 1].tolist())
        scene = evocity.scene(city, roofs=True, given_roofs=given)
        for group in (one for one in scene.groups if "roof" in one.attributes):
            for number, eaves, top in zip(
                group.attributes.get("id", []),
                group.attributes.get("eavesHeight", []),
                group.heights,
                strict=True,
            ):
                if eaves is not None:
                    own = top if given[number - 1, 1] else eaves
                    assert own == pytest.approx(city.buildings.height[number - 1], abs=1e-3)
        child.write(tmp_path / "child.parquet")
        said = call("scene", tmp_path / "child.parquet", "-o", tmp_path / "c.glb", "--roofs")
        if len(set(given[:, 1].tolist())) == 2:
            high = int(given[:, 1].sum())
            assert f"heights: {high} to the ridge, {len(given) - high} to the eaves" in said
    assert kinds == {0, 1}


RECIPE = """
[run]
name = "houses"
seed = 3
population = 4
generations = 1
[map]
pixels = 128
metres_per_pixel = 1.0
[genome]
block = 4
reach = 8
fit = false
[[parents]]
map = "{left}"
[[parents]]
map = "{right}"
[operators]
pavement_fusion = 2
mutation = 1
[[fitness]]
name = "alignment"
[evaluation]
workers = 0
"""


@pytest.mark.slow
def test_individuals_of_a_run_have_them_too(files, tmp_path):
    text = RECIPE.format(**{name: files / f"{name}.geojson" for name in ("left", "right")})
    (tmp_path / "houses.toml").write_text(text)
    call("run", tmp_path / "houses.toml", "--out", tmp_path / "run")
    opened = evocity.open_run(tmp_path / "run")
    sources = [one.city for one in opened.sources()]
    assert [one.roofs is not None for one in opened.sources()] == [True, True]
    maps = [
        evocity.read_map(files / f"{name}.geojson", pixels=128, metres_per_pixel=1.0)
        for name in ("left", "right")
    ]
    assert [one.name for one in sources] == [one.name for one in maps]
    last = opened.births(columns=["id"])["id"].to_pylist()[-1:]
    for number in last:
        genome = opened.genome(number)
        city = opened[number].city
        given = building_roofs(city, genome)
        assert np.array_equal(given, expected_roofs(city, genome, maps))
        call("scene", tmp_path / "run", "--id", number, "--roofs", "-o", tmp_path / "a.city.json")
        opened[number].scene(roofs=True).write(tmp_path / "b.city.json")
        assert shapes_in(tmp_path / "a.city.json") == shapes_in(tmp_path / "b.city.json")
        opened[number].save(tmp_path / "one.parquet")
        assert evocity.read_genome(tmp_path / "one.parquet").roofs == genome.roofs


def test_a_bred_city_passes_its_roofs_on_as_a_parent_of_a_run(genomes):
    child = PavementFusion(size_min=4, size_max=12, tolerance=50.0)(
        genomes, np.random.default_rng(1)
    )
    founder = KINDS["fabric"].founder(child, "founder", True)
    assert np.array_equal(roof_codes(founder), roof_codes(child))
    assert set(founder.roofs) == {"founder"}
    renamed = KINDS["fabric"].rename(genomes[0], "new")
    assert renamed.roofs == {"new": genomes[0].roofs["left"]}
    assert np.array_equal(roof_codes(renamed), roof_codes(genomes[0]))


def test_grown_fabrics_have_them_too(files, genomes, tmp_path):
    for name, genome in zip(("left", "right"), genomes, strict=True):
        genome.write(tmp_path / f"{name}.parquet")
    rng = np.random.default_rng(1)
    fabric = grow(genomes, 256, 256, rng)
    city = fabric.city()
    given = fabric.building_roofs(city)
    assert given[:, 1].all()
    assert len(set(given[:, 0].tolist())) > 3
    grown = fabric.genome()
    assert np.array_equal(given, building_roofs(city, grown))
    part = fabric.city(-64, 32, 128, 128)
    assert len(fabric.building_roofs(part, -64, 32)) == len(part.buildings)
    streets = grow(genomes, 256, 256, rng, streets=True)
    city = streets.city()
    assert len(streets.building_roofs(city)) == len(city.buildings)
    call("grow", tmp_path / "left.parquet", "--width", 256, "--height", 256, "--lod", "2.2",
         "-o", tmp_path / "grown.city.json")  # fmt: skip
    assert len({shape for shape, *_ in shapes_in(tmp_path / "grown.city.json").values()}) > 2


def test_nothing_is_stored_where_no_source_gives_roofs(tmp_path):
    genome = evocity.encode(evocity.read_map("lyon-1er", pixels=32)).genome
    genome.write(tmp_path / "lyon.parquet")
    assert genome.roofs == {}
    assert ROOFS_KEY not in pq.read_schema(tmp_path / "lyon.parquet").metadata
    assert building_roofs(evocity.decode(genome).city, genome) is None


def test_a_run_folder_stores_shapes_only(tmp_path):
    """The meaning of heights follows from the rules of heights of the stored map."""
    recipe = evocity.Recipe(
        parents=["lyon-1er", "new-york-west-village"],
        map={"pixels": 32, "metres_per_pixel": 16.0},
        fitness=["alignment"],
        run={"population": 4, "generations": 0, "name": "two"},
    )
    with evocity.Search(recipe, out=tmp_path / "run", workers=0) as search:
        list(search)
    stored = sorted((tmp_path / "run" / "sources").glob("*.parquet"))
    assert len(stored) == 2
    assert all(ROOFS_KEY not in pq.read_schema(path).metadata for path in stored)
    opened = evocity.open_run(tmp_path / "run")
    assert [one.roofs is None for one in opened.sources()] == [True, False]
    child = opened.genome(3)
    meaning = roof_codes(child)
    parent = child.pavement.raster(child.parent)
    assert np.array_equal(meaning > 0, parent == child.cities.index("new-york-west-village"))


def runs(*pairs):
    lengths, codes = np.array(pairs).T
    four = lengths.astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()
    return base64.b64encode(zlib.compress(four + codes.astype(np.uint8).tobytes())).decode()


WILD = [
    [],
    {"elsewhere": {"size": [128, 128], "runs": runs((128 * 128, 8))}},
    {"left": None},
    {"left": {"size": [128, 128]}},
    {"left": {"size": [128, 128], "runs": 3}},
    {"left": {"size": [128, 128], "runs": "é"}},
    {"left": {"size": [128, 128], "runs": "QUJD"}},
    {"left": {"size": [128, 128], "runs": runs((128, 8))}},
    {"left": {"size": [128, 128], "runs": runs((128 * 128, 7))}},
    {"left": {"size": [128, 128], "runs": runs((128 * 128, 200))}},
    {"left": {"size": [128, 128], "runs": runs((0, 8), (128 * 128, 8))}},
    {"left": {"size": [128, 128.0], "runs": runs((128 * 128, 8))}},
    {"left": {"size": [True, 1], "runs": runs((1, 8))}},
    {"left": {"size": [-128, -128], "runs": runs((128 * 128, 8))}},
    {"left": {"size": [1 << 40, 1], "runs": runs((1, 8))}},
    {"left": {"size": [4, 4], "runs": base64.b64encode(zlib.compress(bytes(10**8))).decode()}},
]


@pytest.mark.parametrize("wild", WILD, ids=range(len(WILD)))
def test_wild_roofs_of_a_strangers_file_are_refused(wild, genomes, tmp_path):
    genomes[0].write(tmp_path / "left.parquet")
    table = pq.read_table(tmp_path / "left.parquet")
    metadata = table.schema.metadata | {ROOFS_KEY: json.dumps(wild).encode()}
    for content in (metadata, table.schema.metadata | {ROOFS_KEY: b"{"}):
        pq.write_table(table.replace_schema_metadata(content), tmp_path / "strange.parquet")
        with pytest.raises(GenomeError) as refusal:
            evocity.read_genome(tmp_path / "strange.parquet")
        assert "strange.parquet" in str(refusal.value)
    pq.write_table(table.replace_schema_metadata(metadata), tmp_path / "strange.parquet")
    with pytest.raises(GenomeError, match=r"evocity\.roofs"):
        evocity.read_genome(tmp_path / "strange.parquet")


@pytest.mark.parametrize("seed", range(3))
def test_changed_tables_are_read_or_refused(seed, genomes):
    rng, document = np.random.default_rng(seed), genomes[0].roofs["left"].document
    outcomes = set()
    for number in range(200):
        content = bytearray(base64.b64decode(document["runs"]))
        if number % 2:
            content = bytearray(zlib.decompress(content))
        content[rng.integers(len(content))] ^= 1 << rng.integers(8)
        plain = zlib.compress(content) if number % 2 else bytes(content)
        changed = {"size": document["size"], "runs": base64.b64encode(plain).decode()}
        try:
            table = read_roofs({"left": changed}, ("left",))["left"]
            assert table.lengths.sum() == 128 * 128
            outcomes.add("read")
        except GenomeError as error:
            outcomes.add("refused" if "evocity.roofs" in str(error) else str(error))
    assert outcomes == {"read", "refused"}


def test_the_format_stays():
    """Two rows of three pixels: gabled under eaves, ridges without a shape, hipped under ridges."""
    document = {"size": [2, 3], "runs": "eNpjZmRigAFmDh4AAIkAHg=="}
    table = RoofTable.of_document(document)
    assert table.lengths.tolist() == [3, 1, 2]
    assert table.codes.tolist() == [3, 8, 12]


def test_a_file_without_a_seal_keeps_its_roofs(genomes, tmp_path):
    genomes[0].write(tmp_path / "left.parquet")
    pq.write_table(pq.read_table(tmp_path / "left.parquet"), tmp_path / "again.parquet")
    assert evocity.read_genome(tmp_path / "again.parquet").roofs == genomes[0].roofs


@pytest.mark.parametrize(
    "given", [[], [[0, 0]], [[5, 0]] * 6, [[0, 2]] * 6, "roofs", [[0.5, 1]] * 6]
)
def test_roofs_of_other_buildings_are_refused(maps, given):
    with pytest.raises(MapError, match="given_roofs"):
        evocity.scene(maps[0], roofs=True, given_roofs=given)


def test_tables_are_checked(genomes):
    with pytest.raises(GenomeError, match="roofs"):
        genomes[0].replace(roofs={"left": 3})
    with pytest.raises(GenomeError, match="unknown codes"):
        RoofTable((2, 2), np.array([4]), np.array([6], np.uint8))
    with pytest.raises(GenomeError, match="fill"):
        RoofTable((2, 2), np.array([3]), np.array([1], np.uint8))
    raster = np.random.default_rng(0).integers(0, 6, (9, 7)).astype(np.uint8)
    table = RoofTable.of_raster(raster)
    assert RoofTable.of_document(json.loads(json.dumps(table.document))) == table
    row, column = np.indices((12, 12)) - 2
    there = table.at(row, column)
    assert np.array_equal(there[2:11, 2:9], raster)
    assert not there[:2].any()
    assert not there[:, 9:].any()
    assert RoofTable.of_raster(np.zeros((3, 3), np.uint8)) is None
