"""What a turned city costs in the page: benchmarks/axonometry.py [MAP]

Studio's columns on a canvas beside three.js with all blocks merged into one mesh, and beside its
own perspective with shadows, in chromium without a window and without a graphics card
(SwiftShader), 480 × 360 px, from the same 72 sides; each frame is read back. Processor milliseconds
a frame, of all processes of the browser, the median of five turns that each takes. Columns and
three.js must cover the same pixels. three.js is npm's, of `make .venv/installed-node` or a
temporary folder.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import psutil
from _machine import description

import evocity

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "studio")]
from served_scene import BROWSER, PUT, WITHOUT_CARD, picture_of, served_modules, told  # noqa: E402

TURNS, FRAMES = 5, 72
VERSION = "three@0.187.0"
PREPARED = """async () => {
  const canvas = () => document.body.appendChild(document.createElement("canvas"));
  const cameras = Array.from({ length: FRAMES }, (_, k) => (
    { azimuth: (360 * k) / FRAMES + 7, tilt: 40, zoom: 1, centre: [0, 0] }));
  const columns = new axonometry.Axonometry(canvas(), city), own = new walk.Walk(canvas(), city);
  const THREE = await import("/three/three.module.js");
  const renderer = new THREE.WebGLRenderer({ canvas: canvas() });
  renderer.setSize(480, 360, false);
  const scene = new THREE.Scene(), light = new THREE.DirectionalLight(0xffffff, 2);
  scene.background = new THREE.Color(0xffffff);
  light.position.set(-2, -1, 2);
  scene.add(light, new THREE.AmbientLight(0xffffff, 1));
  // blocks of one height, without a floor, as one mesh
  const places = [], normals = [], colours = [], order = [];
  const { prismsOf, STRIDE: stride } = await import("/prisms.js");
  const { surfaces, indices } = prismsOf(city), count = indices.length / 6;
  let blocks = 0;
  for (let k = 0; k < count; k++) {
    const at = (4 * k * stride) / 4;
    if (surfaces.signed[4 * k * stride + 14] !== 127) continue; // a roof
    const [west, south, up] = surfaces.places.subarray(at, at + 3);
    const [east, north] = surfaces.places.subarray(at + 12, at + 14);
    const rgb = [0, 1, 2].map((c) => surfaces.colours[4 * k * stride + 16 + c] / 255);
    const sides = [[0, 0, 1, west, south, up, east, south, up, east, north, up, west, north, up]];
    if (up > 0) sides.push(
      [0, -1, 0, west, south, 0, east, south, 0, east, south, up, west, south, up],
      [0, 1, 0, east, north, 0, west, north, 0, west, north, up, east, north, up],
      [-1, 0, 0, west, north, 0, west, south, 0, west, south, up, west, north, up],
      [1, 0, 0, east, south, 0, east, north, 0, east, north, up, east, south, up]);
    blocks++;
    for (const [x, y, z, ...corners] of sides) {
      const first = places.length / 3;
      places.push(...corners);
      for (let one = 0; one < 4; one++) normals.push(x, y, z), colours.push(...rgb);
      order.push(...[0, 1, 2, 0, 2, 3].map((one) => first + one));
    }
  }
  const mesh = new THREE.BufferGeometry();
  const all = { position: places, normal: normals, color: colours };
  for (const name in all) mesh.setAttribute(name, new THREE.Float32BufferAttribute(all[name], 3));
  mesh.setIndex(order);
  scene.add(new THREE.Mesh(mesh, new THREE.MeshLambertMaterial({ vertexColors: true })));
  const eye = new THREE.OrthographicCamera();
  eye.up.set(0, 0, 1);
  const pixel = new Uint8Array(4);
  const read = (gl) => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  window.ways = {
    columns(camera) {
      columns.draw(camera);
      columns.context.getImageData(0, 0, 1, 1);
    },
    three(camera) {
      const { sin, cos, steep, flat, scale, low } = axonometry.placement(city, camera, 480, 360);
      Object.assign(eye, { left: -240 / scale, right: 240 / scale, top: low / scale,
        bottom: (low - 360) / scale, near: 1, far: 4000 });
      eye.position.set(-2000 * flat * sin, -2000 * flat * cos, 2000 * steep);
      eye.lookAt(0, 0, 0);
      eye.updateProjectionMatrix();
      renderer.render(scene, eye);
      read(renderer.getContext());
    },
    walk(camera) {
      own.draw(camera);
      read(own.gl);
    },
  };
  window.turn = (name) => { for (const one of cameras) ways[name](one); };
  window.covered = (name) => {
    ways[name](cameras[3]);
    const canvas = new OffscreenCanvas(480, 360), context = canvas.getContext("2d");
    context.drawImage(name === "three" ? renderer.domElement : columns.canvas, 0, 0);
    return context.getImageData(0, 0, 480, 360).data;
  };
  return { blocks, triangles: order.length / 3, walk: own.triangles };
}""".replace("FRAMES", str(FRAMES))
COVERED = """(name) => {
  let text = "";
  for (const one of covered(name)) text += String.fromCharCode(one);
  return btoa(text);
}"""


def spent() -> float:
    """Processor seconds of all processes that this one has started."""
    found = 0.0
    for one in psutil.Process().children(recursive=True):
        try:
            times = one.cpu_times()
        except psutil.Error:
            continue
        found += times.user + times.system
    return found


def measured(name: str, three: Path) -> None:
    from playwright.sync_api import sync_playwright

    city = evocity.read_map(name)
    with served_modules(three=three) as address, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=BROWSER, args=list(WITHOUT_CARD))
        page = browser.new_page(viewport={"width": 480, "height": 1080})
        page.goto(address)
        page.evaluate(PUT, told(city))
        about = page.evaluate(PREPARED)
        print(f"{name}, {city.shape[0]}²; three.js: {about['blocks']} blocks, ", end="")
        print(f"{about['triangles']} triangles; walk.js: {about['walk']} triangles")
        ours, theirs = (
            (picture_of(page.evaluate(COVERED, one), 360, 480)[..., :3] < (250, 248, 244)).any(
                axis=2
            )
            for one in ("columns", "three")
        )
        alike = (ours == theirs).mean()
        assert alike > 0.99, f"they see the same city in {alike:.1%} of pixels alone"
        found: dict[str, list[float]] = {"columns": [], "three": [], "walk": []}
        for one in found:
            page.evaluate("(name) => turn(name)", one)
        for _ in range(TURNS):
            for one, times in found.items():
                before = spent()
                page.evaluate("(name) => turn(name)", one)
                times.append(1e3 * (spent() - before) / FRAMES)
        for one, times in found.items():
            ratio = median(b / a for a, b in zip(found["columns"], times, strict=True))
            print(f"{one:10} {median(times):8.1f} ms   {ratio:6.1f} x", flush=True)
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("map", nargs="*", default=["lyon-1er", "new-york-west-village"])
    given = parser.parse_args()
    print(description())
    own = ROOT / ".venv" / "node" / "node_modules" / "three" / "build"
    if BROWSER is None:
        sys.exit("chromium is not there")
    with tempfile.TemporaryDirectory() as folder:
        if not own.is_dir():
            if shutil.which("npm") is None:
                sys.exit("three.js is not there, nor npm to fetch it")
            words = ("npm", "install", "--silent", "--no-save", "--prefix", folder, VERSION)
            subprocess.run(words, check=True)
            own = Path(folder) / "node_modules" / "three" / "build"
        for name in given.map:
            measured(name, own)
