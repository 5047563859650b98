"""Studio's views of one city in a browser without a window: its modules, and nothing else."""

import base64
import contextlib
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
from chromium import BROWSER as BROWSER

import evocity
from evocity import CityMap
from evocity.viewer.module_bundle import PAGE as VIEWER

PAGE = Path(evocity.__file__).parent / "studio" / "page"
POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:"
EMPTY = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>city</title>
<link rel="icon" href="data:,"><link rel="stylesheet" href="/page.css"></head>
<body></body></html>"""
STYLE = "body { margin: 0 } canvas { display: block; width: 480px; height: 360px }"


@contextlib.contextmanager
def served_modules(**folders: Path) -> Iterator[str]:
    """The address of an empty page beside all modules; ``folders`` are served below their names."""

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def do_GET(self):
            name = self.path.lstrip("/")
            first, _, rest = name.partition("/")
            found = [path for path in (PAGE / name, VIEWER / name) if path.suffix == ".js"]
            if first in folders:
                found = [folders[first] / rest]
            kind, body = "text/javascript", None
            if name in ("", "page.css"):
                kind, body = ("text/css", STYLE) if name else ("text/html", EMPTY)
            elif file := next((one for one in found if one.is_file()), None):
                body = file.read_text(encoding="utf-8")
            if body is None:
                return self.send_error(404)
            self.send_response(200)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Security-Policy", POLICY)
            self.end_headers()
            self.wfile.write(body.encode())

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def told(city: CityMap, colours: np.ndarray | None = None, highest: float | None = None) -> dict:
    """A city as `put` takes it."""
    heights = city.heights.astype("<f4")
    if city.site is not None:
        heights[~city.site] = np.nan
    found = {
        "heights": base64.b64encode(heights.tobytes()).decode(),
        "rows": city.shape[0],
        "columns": city.shape[1],
        "metresPerPixel": city.metres_per_pixel,
    }
    if colours is not None:
        found["colours"] = base64.b64encode(colours.astype(np.uint8).tobytes()).decode()
    if highest is not None:
        found["highest"] = highest
    return found


#: Makes `window.city` of what `told` tells.
PUT = """async (told) => {
  window.view?.dispose?.();
  document.body.replaceChildren();
  const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
  window.city = { ...told, heights: new Float32Array(bytes(told.heights).buffer) };
  if (told.colours) window.city.colours = bytes(told.colours);
  for (const name of ["axonometry", "camera", "walk", "sun", "ramp"]) {
    window[name] = await import(`/${name}.js`);
  }
}"""

#: Bytes of a picture as text.
BASE64 = """(bytes) => {
  let text = "";
  for (let k = 0; k < bytes.length; k += 8192) {
    text += String.fromCharCode(...bytes.subarray(k, k + 8192));
  }
  return btoa(text);
}"""


class Studio:
    """A browser and the modules, and what its pages said."""

    def __init__(self, browser, address: str):
        self.browser, self.address = browser, address
        self.said: list[str] = []
        self.kept = self.page()

    def page(self, script: str = "", **how):
        page = self.browser.new_page(viewport={"width": 980, "height": 400}, **how)
        page.on("console", lambda message: self.said.append(message.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        if script:
            page.add_init_script(script)
        page.goto(self.address)
        return page

    @contextlib.contextmanager
    def opener(self) -> Iterator:
        """What opens a page that has a city as `window.city`, and each module by its name; one of
        its own where it is to be another than the rest. Their consoles must stay silent."""
        pages = []

        def opened(city: CityMap, colours: np.ndarray | None = None, **how):
            if how:
                pages.append(self.page(**how))
            page = pages[-1] if how else self.kept
            page.evaluate(PUT, told(city, colours))
            return page

        yield opened
        for page in pages:
            page.close()
        # only tests read back what WebGL has drawn
        said = [one for one in self.said if "GPU stall due to ReadPixels" not in one]
        self.said = []
        assert not said, said


@contextlib.contextmanager
def studio(browser, address: str) -> Iterator[Studio]:
    found = Studio(browser, address)
    yield found
    found.kept.close()


def frames(page) -> None:
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def picture_of(text: str, tall: int, wide: int) -> np.ndarray:
    """(H, W, 4) of the bytes that `BASE64` told."""
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(tall, wide, 4)
