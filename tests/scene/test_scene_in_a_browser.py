"""A bred city as glTF in three.js, in a browser without a window."""

import contextlib
import dataclasses
import functools
import http.server
import json
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from towns import draw_town

import evocity
import evocity.scene
from evocity.formats.materials import materials_of
from evocity.operators import make

THREE = Path(__file__).parents[2] / ".venv" / "node" / "node_modules" / "three"
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")

PAGE = """<!doctype html><html><body style="margin:0"><script type="importmap">
{"imports": {"three": "/three/build/three.module.js"}}
</script><script type="module">
import * as THREE from "three";
import { GLTFLoader } from "/three/examples/jsm/loaders/GLTFLoader.js";
const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(800, 600);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xffffff);
const sun = new THREE.DirectionalLight(0xffffff, 2.5);
sun.position.set(-1, 2, 1);
scene.add(sun, new THREE.AmbientLight(0xffffff, 1));
const told = document.createElement("pre");
new GLTFLoader().load("/scene.glb", file => {
  scene.add(file.scene);
  const box = new THREE.Box3().setFromObject(file.scene);
  const middle = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3());
  const camera = new THREE.PerspectiveCamera(40, 4 / 3, 1, 1e4);
  camera.position.set(middle.x, size.x * .8, middle.z + size.z);
  camera.lookAt(middle);
  renderer.render(scene, camera);
  const triangles = {}, meshes = new Set();
  let mirrored = 0;
  file.scene.traverse(one => {
    if (one.isMesh) {
      const count = one.geometry.index.count / 3;
      const name = one.material.name;
      triangles[name] = (triangles[name] || 0) + count;
      meshes.add(one.geometry.uuid);
      mirrored += one.matrixWorld.determinant() < 0;
    }
  });
  told.textContent = JSON.stringify(
    { triangles, size: size.toArray(), meshes: meshes.size, mirrored });
  document.body.append(told);
}, undefined, error => { told.textContent = "failed: " + error; document.body.append(told); });
</script></body></html>"""


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    handler = functools.partial(_Quiet, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def opened(scene, folder: Path) -> tuple[dict, np.ndarray]:
    """What the page tells of a scene, and what is seen of it, int ``(600, 800, 3)``."""
    folder.mkdir()
    scene.write(folder / "scene.glb")
    (folder / "index.html").write_text(PAGE, encoding="utf-8")
    (folder / "three").symlink_to(THREE)
    with served(folder) as address:
        words = (BROWSER, "--headless=new", "--no-sandbox", "--use-angle=swiftshader")
        words += ("--enable-unsafe-swiftshader", f"--user-data-dir={folder / 'profile'}")
        words += ("--window-size=800,600", "--virtual-time-budget=10000", "--dump-dom")
        words += (f"--screenshot={folder / 'seen.png'}", address)
        page = subprocess.run(
            words, capture_output=True, check=True, timeout=120, cwd=folder
        ).stdout.decode()
    found = re.search(r"<pre>(.*?)</pre>", page)
    assert found, page
    return json.loads(found[1]), np.asarray(Image.open(folder / "seen.png").convert("RGB"), int)


in_browser = pytest.mark.skipif(
    BROWSER is None or not THREE.is_dir(),
    reason="chromium or npm's three is not there: make .venv/installed-node",
)


@pytest.mark.slow
@in_browser
def test_a_bred_city_opens_in_three_js(tmp_path):
    towns = [evocity.encode(draw_town(seed, side=96)).genome for seed in (11, 12)]
    child = make("quarter_fusion")(towns, np.random.default_rng(1))
    scene = evocity.scene(evocity.decode(child).city)
    told, seen = opened(scene, tmp_path / "bred")
    assert sum(told["triangles"].values()) == sum(len(g.mesh.triangles) for g in scene.groups)
    assert set(told["triangles"]) == {one.name for g in scene.groups for one in materials_of(g)}
    # walls and roofs of a building have a geometry each
    assert told["meshes"] == sum(len(g) * len(set(materials_of(g))) for g in scene.groups)
    wide, deep = scene.about.size
    assert told["size"] == pytest.approx([wide, scene.groups[-1].heights.max(), deep], abs=1e-3)
    colours = np.unique(seen.reshape(-1, 3) // 16, axis=0)
    assert len(colours) > 8  # ground, roofs and walls, in light and in shade


@pytest.mark.slow
@in_browser
def test_copies_of_objects_are_seen_as_if_each_were_its_own(tmp_path):
    library = evocity.scene.Library.of(draw_town(5, side=96), licence="CC0-1.0")
    city = draw_town(11, side=96)
    scene = evocity.scene(city, library=library.only(np.arange(12)), rng=np.random.default_rng(2))
    told, seen = opened(scene, tmp_path / "copies")
    assert told["mirrored"] > 0
    assert sum(told["triangles"].values()) == sum(len(g.mesh.triangles) for g in scene.groups)
    groups = tuple(dataclasses.replace(group, copies=None) for group in scene.groups)
    plain = dataclasses.replace(scene)
    plain.__dict__["groups"] = groups
    other, wanted = opened(plain, tmp_path / "plain")
    assert told["meshes"] < other["meshes"]
    assert other["mirrored"] == 0
    differ = (np.abs(seen - wanted) > 12).any(axis=2)
    assert differ.mean() < 1e-3
