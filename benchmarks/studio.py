"""What studio costs: benchmarks/studio.py FOLDER/run [OTHER]

    python benchmarks/soak.py --generations 999 --drawn --keep FOLDER  # 64 000 births of 64²
    evocity run --generations 5 --out OTHER  # maps of 256²
    python benchmarks/studio.py FOLDER/run OTHER

Of the first run what the server does for a page, processor seconds of all its threads, and the page
in chromium without a window: until it is ready, a brush and an order until all canvases are drawn
(milliseconds of the page's thread, median and worst of nine), and its heap. Of the other 70 small
pictures, cold in a drawn order and warm, and twelve children, by the clock: the first picture, and
all measured.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from _machine import description

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studio"))
from asking import Client

from evocity.studio.server import running_server

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
BROODS, REPEATS = 5, 9
READ = 'for (const one of document.querySelectorAll(".evocity-view canvas")) if (one.offsetParent) '
READ += 'one.getContext("2d").getImageData(0, 0, 1, 1);'
#: What is done by hand; ``k`` counts, ``names`` are those of the axes.
ACTS = {
    "a brush, until all is drawn": "const one = studio.run.viewer.births.byName"
    ".get(names[0]); studio.run.viewer.change({ brushes: "
    "{ [names[0]]: [[one.low, one.value((k + 1) / 10)]] } })",
    "another order": "studio.run.viewer.change({ brushes: {}, order: "
    "{ name: names[k % names.length], reversed: k % 2 > 0 } })",
}


def told(name: str, act: Callable[[], object], repeats: int = 3) -> None:
    """The least processor seconds of some repeats."""
    found = []
    for _ in range(repeats):
        began = time.process_time()
        act()
        found.append(time.process_time() - began)
    print(f"{name:30} {min(found):7.3f} s", flush=True)


def large(path: Path) -> None:
    began = time.process_time()
    with running_server(path) as server:
        client = Client(server)
        client.open()
        about, content = client.get("/api/0/births").framed
        print(f"{about['count']} births, {len(content) / 1e6:.1f} MB")
        print(f"{'opened, first births told':30} {time.process_time() - began:7.3f} s")
        last = about["count"] - 1
        told("nothing new", lambda: (time.sleep(0.6), client.get("/api/0/changes?after=9999")))
        told("births again", lambda: client.get("/api/0/births"))
        told("one birth", lambda: client.get(f"/api/0/one?id={last}"))
        told("parents of all births", lambda: client.get("/api/0/part?name=lineage"))
        if BROWSER:
            page(server)


def page(server) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        seen = browser.new_page(viewport={"width": 1400, "height": 900})
        talk = seen.context.new_cdp_session(seen)
        talk.send("Performance.enable")

        def spent() -> float:
            metrics = talk.send("Performance.getMetrics")["metrics"]
            return next(one["value"] for one in metrics if one["name"] == "ThreadTime")

        began = time.monotonic()
        seen.goto(server.url)
        while not seen.evaluate("() => Boolean(studio.run?.viewer)"):
            time.sleep(0.02)
        print(f"{'page ready, its own thread':30} {spent():7.3f} s")
        print(f"{'page ready, by the clock':30} {time.monotonic() - began:7.3f} s")
        seen.wait_for_load_state("networkidle")  # the births to keep are there
        seen.evaluate("() => studio.run.viewer.change({ view: 'axes' })")
        seen.wait_for_timeout(1000)
        names = [one["name"] for one in seen.evaluate("() => studio.run.state.axes")]
        for name, act in ACTS.items():
            found = []
            for k in range(REPEATS):
                before = spent()
                seen.evaluate(f"([k, names]) => {{ {act}; {READ} }}", [k, names])
                found.append(1e3 * (spent() - before))
            print(f"{name:30} {np.median(found):7.1f} ms, the worst {max(found):.1f}", flush=True)
        heap = seen.evaluate("() => performance.memory.usedJSHeapSize") / 1e6
        print(f"{'heap':30} {heap:7.1f} MB")
        browser.close()


def small(path: Path) -> None:
    with running_server(path) as server:
        client = Client(server)
        client.open()
        about, content = client.get("/api/0/births").framed
        ids = np.frombuffer(content, "<i4", about["count"])
        drawn = np.random.default_rng(1).permutation(ids)[:70].tolist()

        def tiles() -> None:
            client.get(f"/api/0/tiles?ids={','.join(map(str, drawn))}&side=96")  # as the page asks

        client.get(f"/api/0/tiles?ids={int(ids[0])}&side=192")  # what draws is loaded
        told("70 pictures of 256², cold", tiles, 1)
        told("warm", tiles)
        client.post("/api/0/ready", {"parents": ids[:4].tolist()})
        while client.get("/api/0/brood").json["busy"]:
            time.sleep(0.01)
        for seed in range(BROODS):
            asked = {"operators": ["quarter_fusion", "mutation"], "parents": ids[:4].tolist()}
            began, first = time.monotonic(), None
            client.post("/api/0/breed", asked | {"count": 12, "seed": seed, "vary": True})
            while (state := client.get("/api/0/brood").json)["busy"]:
                done = any(one["stage"] != "waiting" for one in state["children"])
                first = first or (time.monotonic() - began if done else None)
                time.sleep(0.005)
            print(
                f"twelve children, seed {seed}: the first after {first or 0:.3f} s, "
                f"all measured after {time.monotonic() - began:.3f} s"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("path", type=Path, metavar="RUN", help="a run of many births")
    parser.add_argument("other", type=Path, nargs="?", metavar="OTHER", help="a run to breed from")
    given = parser.parse_args()
    print(description())
    with tempfile.TemporaryDirectory() as cache:
        os.environ["XDG_CACHE_HOME"] = cache
        large(given.path)
        if given.other:
            small(given.other)
