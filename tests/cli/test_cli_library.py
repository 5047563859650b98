"""`evocity library`: objects of real maps, in a folder."""

import json

import numpy as np
from cli_tools import AT_2_M, call, refused, write_town
from towns import draw_town

import evocity
from evocity.io import attribution_of
from evocity.scene.library import Library
from evocity.scene.library_table import TABLE

READING = ("--pixels", 160, "--metres-per-pixel", 2)


def test_the_command_makes_a_library_of_maps(tmp_path):
    folder = tmp_path / "objects"
    maps = ("montpellier-pas-du-loup", "cape-town-salt-river")
    told = json.loads(call("library", "new", *maps, *READING, "--json", "-o", folder).stdout)
    library = Library.read(folder)
    assert told["objects"] == len(library) == sum(told["maps"].values())
    assert told["isolated"] == np.count_nonzero(~library.attached)
    assert sum(told["classes"].values()) == len(library)
    assert len(set(library.licences)) == 2
    assert any("BD TOPO" in line for line in library.attributions)
    words = ("--isolated", "--licence", "own", "--atmosphere", "slabs", "--attribution", "me")
    text = call("library", "new", maps[0], *READING, *words, "-o", folder).stdout
    assert f"wrote {folder / TABLE}" in text
    again = Library.read(folder)
    assert not again.attached.any()
    for column, value in (("licences", "own"), ("atmospheres", "slabs")):
        assert set(getattr(again, column)) == {value}
    assert set(again.attributions) == {attribution_of(maps[0])}  # a bundled district keeps its own
    town = write_town(tmp_path / "town.npy", side=64)
    call("library", "new", town, *AT_2_M, *words[1:], "-o", folder)
    assert set(Library.read(folder).attributions) == {"me"}


def test_what_a_licence_asks_for_goes_with_a_genome_and_its_child(tmp_path):
    """A bundled parent beside the file keeps its own line."""
    town = write_town(tmp_path / "town.npy", side=32)
    genome, child = tmp_path / "town.parquet", tmp_path / "child.parquet"
    call("encode", town, *AT_2_M, "--attribution", "© the town", "-o", genome)
    assert evocity.read_genome(genome).attribution == "© the town"
    words = ("lyon-1er", town, "--pixels", 32, *AT_2_M, "--attribution", "© the town", "-o", child)
    call("breed", "direct_fusion", *words)
    credit = evocity.read_genome(child).attribution
    assert "© the town" in credit
    assert attribution_of("lyon-1er") in credit


def test_the_command_takes_a_table_of_classes(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[[class]]\nname = "thing"\n[colours]\nthing = "#112233"\n')
    call("library", "new", "lyon-1er", *READING, "--classes", path, "-o", tmp_path / "own")
    assert set(Library.read(tmp_path / "own").classes) == {"thing"}


def test_the_command_refuses_what_is_at_fault(tmp_path):
    np.save(tmp_path / "town.npy", draw_town(1).heights)
    np.save(tmp_path / "bare.npy", np.zeros((32, 32), np.float32))
    (tmp_path / "file").write_text("")
    bare = (tmp_path / "bare.npy", "--metres-per-pixel", 2, "--licence", "CC0-1.0")
    out = ("-o", tmp_path / "own")
    at = ("--metres-per-pixel", 2)
    refused(tmp_path, "library", "new", tmp_path / "town.npy", *at, *out, says="has no licence")
    refused(tmp_path, "library", "new", *bare, *out, says="no whole building of 24 m²")
    refused(tmp_path, "library", "new", "lyon-1er", "-o", tmp_path / "file", says="a file has")
    refused(
        tmp_path,
        "library",
        "new",
        "lyon-1er",
        "-o",
        tmp_path / "a" / "b",
        says="its parent folder does not exist",
    )
    refused(tmp_path, "library", "new", "lyon-1er", "lyon-1er", *READING, *out, says="twice")
    refused(tmp_path, "library", "new", "lyon-2e", *out, says="lyon-2e")
    words = ("lyon-1er", "--classes", tmp_path / "none.toml")
    refused(tmp_path, "library", "new", *words, *out, says="none.toml")
