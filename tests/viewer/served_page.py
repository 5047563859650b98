"""The page of a view in a browser without a window: a model of its own in place of Jupyter's."""

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from chromium import BROWSER as BROWSER

from evocity.viewer.module_bundle import MODULES, module, text
from evocity.viewer.widget import Widget

# What studio's page may do, and no more.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src blob: data:"
)
PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>view</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="/viewer.css">
<script type="module" src="/host.js"></script></head><body><main id="main"></main></body></html>"""

# As much of a widget's model as the page asks for; it speaks with the widget by messages.
HOST = """
import page from "/module.js";
const told = await (await fetch("/state")).json();
const values = { ...told, births: new DataView(await (await fetch("/births")).arrayBuffer()) };
const heard = {};
const call = (name, ...given) => { for (const act of heard[name] || []) act(...given); };
const model = {
  saved: [], sent: [],
  get: (name) => values[name],
  set(name, value) {
    if (JSON.stringify(values[name]) === JSON.stringify(value)) return;
    values[name] = value;
    this.changed = { ...this.changed, [name]: value };
    call(`change:${name}`);
  },
  save_changes() {
    if (this.changed) this.saved.push(this.changed);
    this.changed = null;
  },
  on: (name, act) => (heard[name] ||= []).push(act),
  off: (name, act) => { heard[name] = heard[name].filter((one) => one !== act); },
  async send(message) {
    this.sent.push(message);
    const answer = await fetch("/message", { method: "POST", body: JSON.stringify(message) });
    if (answer.status !== 200) return;
    const about = JSON.parse(decodeURIComponent(answer.headers.get("about")));
    call("msg:custom", about, [new DataView(await answer.arrayBuffer())]);
  },
  async renew() {
    Object.assign(values, await (await fetch("/state")).json());
    values.births = new DataView(await (await fetch("/births")).arrayBuffer());
    for (const name of ["about", "births", "chosen"]) call(`change:${name}`);
  },
};
const began = performance.now();
const end = page.render({ model, el: document.getElementById("main") });
window.view = { model, end, ready: performance.now() - began };
"""


@contextlib.contextmanager
def served(widget: Widget) -> Iterator[str]:
    """The address of a page that shows a ``widget``."""
    texts: dict[str, tuple[str, Callable[[], str | bytes]]] = {
        "/": ("text/html", lambda: PAGE),
        "/host.js": ("text/javascript", lambda: HOST),
        "/module.js": ("text/javascript", module),
        "/viewer.css": ("text/css", lambda: text("viewer.css")),
        "/state": ("application/json", lambda: json.dumps(state_of(widget))),
        "/births": ("application/octet-stream", lambda: widget.births),
    }
    for name in MODULES:  # one by one, as studio serves them
        texts[f"/{name}.js"] = ("text/javascript", partial(text, f"{name}.js"))

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def answer(self, kind: str, body: str | bytes, **headers: str) -> None:
            body = body.encode() if isinstance(body, str) else body
            self.send_response(200)
            for name, value in {"Content-Type": f"{kind}; charset=utf-8", **headers}.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Content-Security-Policy", POLICY)
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self):
            if self.path in texts:
                kind, made = texts[self.path]
                self.answer(kind, made())
            else:
                self.send_error(404)

        def do_POST(self):
            message = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            about, (image,) = asked(widget, message)[0]
            quoted = json.dumps(about).replace("%", "%25")
            self.answer("image/png", bytes(image), about=quoted)

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def state_of(widget: Widget) -> dict:
    names = ("about", "chosen", "brushes", "order", "axes")
    return {name: getattr(widget, name) for name in names}


def asked(widget: Widget, message: object) -> list[tuple[dict, list[bytes]]]:
    """What a ``widget`` sends in answer to a ``message`` of its page."""
    answers: list[tuple[dict, list[bytes]]] = []
    widget.send = lambda content, buffers=None: answers.append((content, buffers))
    try:
        widget._handle_custom_msg(message, [])
    finally:
        del widget.send
    return answers
