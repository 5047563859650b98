"""The page's own drawing in three dimensions beside three.js: benchmarks/axonometry.py [MAP …]

    npm install --prefix FOLDER three@0.187.0
    python benchmarks/axonometry.py --three FOLDER/node_modules/three

Draws a child of two cities (256²) and a grown fabric (1024²), or maps that you name, in chromium
without a window and without a graphics card (SwiftShader), 480 × 360 px, from the same 72 sides;
each frame is read back. From outside: studio's columns on a canvas, and three.js with one block for
each rectangle of one height, all blocks merged into one mesh, or as instances of one box. In
perspective with shadows of the sun: studio's walk, and three.js with both meshes and its own shadow
map. Prints frames a second by the clock, and processor milliseconds a frame of all processes of the
browser, the median of the turns. Pictures of one kind must cover the same pixels.
"""

import argparse
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np
import psutil
from _machine import description

import evocity
from evocity.coding import decode
from evocity.growth import grow
from evocity.operators import make

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "studio")]
from chromium import BROWSER, WITHOUT_CARD  # noqa: E402
from served_scene import PUT, picture_of, served_modules, told  # noqa: E402

TURNS, FRAMES = 5, 72
OUTSIDE = ("columns", "three, merged", "three, instances")
SHADED = ("walk", "three, merged, shadows", "three, instances, shadows")
PREPARED = """async () => {
  const canvas = () => document.body.appendChild(document.createElement("canvas"));
  const cameras = Array.from({ length: FRAMES }, (_, k) => (
    { azimuth: (360 * k) / FRAMES + 7, tilt: 40, zoom: 1, centre: [0, 0] }));
  const took = {}, timed = (name, act) => {
    const start = performance.now(), made = act();
    took[name] = performance.now() - start;
    return made;
  };
  const columns = new axonometry.Axonometry(canvas(), city);
  const own = timed("walk", () => new walk.Walk(canvas(), city));
  const THREE = await import("/three/build/three.module.js");

  // blocks of one height, without a floor: west, south, east, north, height, colour
  const { prismsOf, STRIDE: stride } = await import("/prisms.js");
  const { surfaces, indices } = prismsOf(city), blocks = [];
  for (let k = 0; k < indices.length / 6; k++) {
    if (surfaces.signed[4 * k * stride + 14] !== 127) continue; // a wall
    const [west, south, up] = surfaces.places.subarray(k * stride, k * stride + 3);
    const [east, north] = surfaces.places.subarray(k * stride + 12, k * stride + 14);
    blocks.push([west, south, east, north, up,
      [0, 1, 2].map((c) => surfaces.colours[4 * k * stride + 16 + c] / 255)]);
  }
  const material = () => new THREE.MeshLambertMaterial({ side: THREE.FrontSide });
  const merged = () => {
    const count = blocks.reduce((sum, [, , , , up]) => sum + (up > 0 ? 5 : 1), 0);
    const places = new Float32Array(12 * count), normals = new Float32Array(12 * count);
    const colours = new Float32Array(12 * count), order = new Uint32Array(6 * count);
    let at = 0;
    for (const [west, south, east, north, up, rgb] of blocks) {
      const sides = [[0, 0, 1, west, south, up, east, south, up, east, north, up, west, north, up]];
      if (up > 0) sides.push(
        [0, -1, 0, west, south, 0, east, south, 0, east, south, up, west, south, up],
        [0, 1, 0, east, north, 0, west, north, 0, west, north, up, east, north, up],
        [-1, 0, 0, west, north, 0, west, south, 0, west, south, up, west, north, up],
        [1, 0, 0, east, south, 0, east, north, 0, east, north, up, east, south, up]);
      for (const [x, y, z, ...corners] of sides) {
        places.set(corners, 12 * at);
        for (let one = 0; one < 4; one++) {
          normals.set([x, y, z], 12 * at + 3 * one);
          colours.set(rgb, 12 * at + 3 * one);
        }
        order.set([0, 1, 2, 0, 2, 3].map((one) => 4 * at + one), 6 * at);
        at++;
      }
    }
    const mesh = new THREE.BufferGeometry();
    const all = { position: places, normal: normals, color: colours };
    for (const name in all) mesh.setAttribute(name, new THREE.BufferAttribute(all[name], 3));
    mesh.setIndex(new THREE.BufferAttribute(order, 1));
    const paint = material();
    paint.vertexColors = true;
    return new THREE.Mesh(mesh, paint);
  };
  const instances = () => {
    const mesh = new THREE.InstancedMesh(new THREE.BoxGeometry(), material(), blocks.length);
    const matrix = new THREE.Matrix4(), colour = new THREE.Color();
    blocks.forEach(([west, south, east, north, up, rgb], k) => {
      matrix.makeScale(east - west, north - south, Math.max(up, 1e-3));
      matrix.setPosition((west + east) / 2, (south + north) / 2, up / 2);
      mesh.setMatrixAt(k, matrix);
      mesh.setColorAt(k, colour.setRGB(...rgb));
    });
    return mesh;
  };

  const reach = Math.hypot(city.columns, city.rows) * city.metresPerPixel;
  const scenes = {}, renderers = {};
  for (const [name, make, isShaded] of [["three, merged", merged, false],
    ["three, instances", instances, false], ["three, merged, shadows", merged, true],
    ["three, instances, shadows", instances, true]]) {
    const renderer = new THREE.WebGLRenderer({ canvas: canvas(), antialias: false });
    renderer.setSize(480, 360, false);
    const scene = new THREE.Scene(), light = new THREE.DirectionalLight(0xffffff, 2);
    scene.background = new THREE.Color(0xffffff);
    light.position.set(-2 * reach, -reach, 2 * reach);
    scene.add(light, new THREE.AmbientLight(0xffffff, 1));
    const mesh = timed(name, make);
    if (isShaded) {
      mesh.castShadow = mesh.receiveShadow = light.castShadow = true;
      Object.assign(renderer.shadowMap, { enabled: true, autoUpdate: false, needsUpdate: true });
      light.shadow.mapSize.set(2048, 2048); // drawn once, as that of the walk
      Object.assign(light.shadow.camera, { left: -reach / 1.4, right: reach / 1.4,
        top: reach / 1.4, bottom: -reach / 1.4, near: 1, far: 6 * reach });
      light.shadow.bias = -0.002;
    }
    scene.add(mesh);
    [scenes[name], renderers[name]] = [scene, renderer];
  }
  const flat = new THREE.OrthographicCamera();
  flat.up.set(0, 0, 1);
  const deep = new THREE.Camera(); // its matrix is that of the walk
  deep.matrixAutoUpdate = false;
  const pixel = new Uint8Array(4);
  const read = (gl) => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  window.ways = {
    columns(camera) {
      columns.draw(camera);
      columns.context.getImageData(0, 0, 1, 1);
    },
    walk(camera) {
      own.draw(camera);
      read(own.gl);
    },
  };
  for (const name in scenes) ways[name] = (camera) => {
    let eye = deep;
    if (name.endsWith("shadows")) {
      eye.projectionMatrix.fromArray(own.viewAbout(camera, 480, 360).onto);
    } else {
      const place = axonometry.placement(city, camera, 480, 360);
      const { sin, cos, steep, flat: low, scale, low: end } = place;
      Object.assign(eye = flat, { left: -240 / scale, right: 240 / scale, top: end / scale,
        bottom: (end - 360) / scale, near: 1, far: 4 * reach });
      eye.position.set(-2 * reach * low * sin, -2 * reach * low * cos, 2 * reach * steep);
      eye.lookAt(0, 0, 0);
      eye.updateProjectionMatrix();
    }
    renderers[name].render(scenes[name], eye);
    read(renderers[name].getContext());
  };
  window.turn = (name, count) => { for (const one of cameras.slice(0, count)) ways[name](one); };
  window.covered = (name) => {
    ways[name](cameras[3]);
    const shown = { columns: columns.canvas, walk: own.canvas }[name] ?? renderers[name].domElement;
    const canvas = new OffscreenCanvas(480, 360), context = canvas.getContext("2d");
    context.drawImage(shown, 0, 0);
    let text = "";
    for (const one of context.getImageData(0, 0, 480, 360).data) text += String.fromCharCode(one);
    return btoa(text);
  };
  return { blocks: blocks.length, walk: own.triangles, took };
}""".replace("FRAMES", str(FRAMES))


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


def cities(names: list[str]):
    """The name and the map of each city: a child and a grown fabric, unless there are names."""
    if names:
        yield from ((name, evocity.read_map(name)) for name in names)
        return
    codes = [evocity.encode(evocity.read_map(name)).genome for name in evocity.cities()[:2]]
    child = make("quarter_fusion")(codes, np.random.default_rng(1))
    yield "a child, 256²", decode(child).city
    fabric = grow(codes[0], 1024, 1024, np.random.default_rng(7))
    yield "a grown fabric, 1024²", fabric.city()


def measured(name: str, city, three: Path, turns: int) -> None:
    from playwright.sync_api import sync_playwright

    with served_modules(three=three) as address, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=BROWSER, args=list(WITHOUT_CARD))
        page = browser.new_page(viewport={"width": 480, "height": 2160})
        page.goto(address)
        page.evaluate(PUT, told(city))
        about = page.evaluate(PREPARED)
        took = ", ".join(f"{one} {ms:.0f} ms" for one, ms in about["took"].items())
        print(f"{name}: {about['blocks']} blocks; walk.js: {about['walk']} triangles")
        print(f"prepared: {took}")
        for group in (OUTSIDE, SHADED):
            seen = [
                (picture_of(page.evaluate("(one) => covered(one)", one), 360, 480)[..., :3] < 244)
                for one in group
            ]
            alike = [(one.any(axis=2) == seen[0].any(axis=2)).mean() for one in seen[1:]]
            assert min(alike) > 0.97, f"they see the same city in only {alike} of the pixels"
            found: dict[str, list] = {one: [] for one in group}
            count = FRAMES if city.shape[0] <= 256 else FRAMES // 6
            for _ in range(turns):
                for one, times in found.items():
                    before, began = spent(), time.perf_counter()
                    page.evaluate("([name, count]) => turn(name, count)", [one, count])
                    long = time.perf_counter() - began
                    times.append((1e3 * (spent() - before) / count, count / long))
            for one, times in found.items():
                cost, rate = (median(values) for values in zip(*times, strict=True))
                ratio = median(b[0] / a[0] for a, b in zip(found[group[0]], times, strict=True))
                print(f"{one:26} {rate:7.1f} a second {cost:8.1f} ms {ratio:6.1f} x", flush=True)
        browser.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("map", nargs="*")
    own = ROOT / ".venv" / "node" / "node_modules" / "three"
    parser.add_argument("--three", type=Path, default=own, help="the folder of npm's three")
    parser.add_argument("--turns", type=int, default=TURNS)
    given = parser.parse_args()
    print(description())
    if BROWSER is None:
        sys.exit("chromium is not there")
    if not (given.three / "build" / "three.module.js").is_file():
        sys.exit(f"{given.three} has no three.js; install three with npm and name its folder")
    for name, city in cities(given.map):
        measured(name, city, given.three, given.turns)
