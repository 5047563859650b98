"""What a view of many births costs: benchmarks/viewer.py [FOLDER]

The page in chromium without a window, 900 px wide, of 64 000 births that nobody bred: until it is
ready, a brush to redrawing, another order; milliseconds of the page's thread, the median of nine
and the worst, the canvases read back so that nothing is put off. With the FOLDER of a run
(benchmarks/soak.py --generations 1000 --drawn --keep FOLDER) what Python does for its view,
processor seconds.
"""

import argparse
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np
from _machine import description

import evocity
from evocity.viewer.sheet import Sheet
from evocity.viewer.table import Column, Table
from evocity.viewer.widget import Widget

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / one) for one in (".", "viewer")]
from served_page import BROWSER, page_of, served  # noqa: E402

BIRTHS, REPEATS = 64_000, 9
READ = 'for (const one of document.querySelectorAll(".evocity-view canvas")) '
READ += 'one.getContext("2d").getImageData(0, 0, 1, 1);'
#: What is done by hand, as changes of the model's state; ``k`` counts.
ACTS = {
    "a brush": "() => k => ({ brushes: { measure_1: [[-1 - k / 10, 1]] } })",
    "three brushes": "() => k => ({ brushes: { measure_1: [[-1 - k / 10, 1]], "
    "measure_2: [[-2, -1], [0, k / 5]] } })",
    "no brush": "() => k => ({ brushes: k % 2 ? {} : { operator: ['source', 'mutation'] } })",
    "an order": "() => k => ({ order: { name: `measure_${k % 4}`, reversed: k > 3 } })",
    "axes turned": "() => k => ({ axes: view.model.get('axes')"
    ".map((one) => ({ ...one, turned: k % 2 > 0 })) })",
}


def table(measures: int) -> Table:
    rng = np.random.default_rng(1)
    common = rng.normal(size=BIRTHS)
    values = (common * (k % 3 - 1) + rng.normal(size=BIRTHS) for k in range(measures))
    numbers = (
        Column(f"measure_{k}", v.astype(np.float32), goal="max") for k, v in enumerate(values)
    )
    words = Column.of_words("operator", rng.choice(["source", "mutation", "fusion"], BIRTHS))
    return Table(np.arange(BIRTHS), (*numbers, words))


def page(measures: int) -> None:
    from playwright.sync_api import sync_playwright

    told = {"title": "run", "credit": "", "highest": 30, "ratio": 1}
    axes = [{"name": f"measure_{k}", "turned": False} for k in range(measures)]
    order = {"name": "measure_0", "reversed": False}
    grey = np.full((64, 64, 3), 90, np.uint8)

    def pictures(ids: list[int], _: int) -> Sheet:
        return Sheet.of(dict.fromkeys(ids, grey), {})

    shown = Widget(page_of(table(measures), told, pictures), axes=axes, order=order)
    with served(shown) as address, sync_playwright() as started:
        browser = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        seen = browser.new_page(viewport={"width": 900, "height": 1000})
        talk = seen.context.new_cdp_session(seen)
        talk.send("Performance.enable")

        def spent() -> float:
            metrics = talk.send("Performance.getMetrics")["metrics"]
            return 1e3 * next(one["value"] for one in metrics if one["name"] == "ThreadTime")

        seen.goto(address)
        while not seen.evaluate("window.view !== undefined"):
            time.sleep(0.05)
        seen.wait_for_timeout(500)
        print(f"{BIRTHS} births × {measures} measures, {len(shown.births) / 1e6:.1f} MB")
        print(f"{'ready':15} {spent():7.1f} ms")
        for name, act in ACTS.items():
            found = []
            for k in range(REPEATS):
                before = spent()
                seen.evaluate(
                    f"(k) => {{ for (const [name, value] of Object.entries(({act})()(k))) "
                    f"view.model.set(name, value); {READ} }}",
                    k,
                )
                found.append(spent() - before)
            print(f"{name:15} {median(found):7.1f} ms {max(found):7.1f}", flush=True)
        heap = seen.evaluate("performance.memory.usedJSHeapSize") / 1e6
        print(f"{'heap':15} {heap:7.1f} MB")
        browser.close()


def python(path: Path) -> None:
    run = evocity.open_run(path)
    questions = {
        "view": lambda: evocity.open_run(path).view(),
        "view, asked before": lambda: run.view(),
        "shown": lambda: view._repr_mimebundle_(),
        "48 pictures": lambda: run.view()._sheet(list(range(48)), 96),
    }
    view = run.view()
    print(f"{len(run)} births, {len(view.widget.births) / 1e6:.1f} MB")
    for name, ask in questions.items():
        began = time.process_time()
        ask()
        print(f"{name:20} {time.process_time() - began:7.3f} s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("path", type=Path, nargs="?", metavar="FOLDER", help="a run")
    given = parser.parse_args()
    print(description())
    for measures in (4, 12):
        page(measures)
    if given.path:
        python(given.path)
