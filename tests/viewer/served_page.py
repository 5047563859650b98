"""The page of a view in a browser without a window: a model of its own in place of Jupyter's."""

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import Any

from chromium import BROWSER as BROWSER

from evocity.viewer.module_bundle import files, module, text
from evocity.viewer.sheet import Sheet
from evocity.viewer.table import Table
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
    const bytes = await answer.arrayBuffer(), end = 4 + new DataView(bytes).getUint32(0, true);
    const about = JSON.parse(new TextDecoder().decode(bytes.slice(4, end)));
    call("msg:custom", about, [new DataView(bytes.slice(end))]);
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
    for name, content in files().items():  # one by one, as studio serves them
        if name.endswith(".js"):
            texts[f"/{name}"] = ("text/javascript", lambda content=content: content)

    answering = threading.Lock()  # a page may send two messages at once

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *_):
            pass

        def answer(self, kind: str, body: str | bytes) -> None:
            body = body.encode() if isinstance(body, str) else body
            self.send_response(200)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
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
            with answering:
                about, buffers = asked(widget, message)[0]
            head = json.dumps(about).encode()
            body = len(head).to_bytes(4, "little") + head + b"".join(map(bytes, buffers))
            self.answer("application/octet-stream", body)

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def page_of(table: Table, facts: dict, sheet: Callable[[list[int], int], Sheet], **parts: Any):
    """Births, facts and ``parts`` for a widget, in place of a page of a run."""
    return SimpleNamespace(
        table=table, about=facts | table.about, sheet=sheet, part=lambda name: parts[name]
    )


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
