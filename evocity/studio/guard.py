"""The guard of every request, and the headers of every answer.

Any page of the web can have a browser send requests to this machine. By a host name that leads here
it could even read the answers. So each request must name this server by a name of its own and come
from its own page. It must also bring the cookie that studio gave for the token in the address. No
form and no link can send a change: it is JSON of limited length, or, at one address, a file of
limited length. Only the address with its token may be opened from elsewhere: by a file of
`evocity.studio.browser`, or a link. The answer then is a page that leads on to studio's own.
"""

import re
import secrets
import threading
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response

from evocity.errors import MapError, format_bytes
from evocity.studio.request_fields import fault_of

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

#: Bytes of a body, of a query and of all headers, at most.
MOST_BODY, MOST_QUERY, MOST_HEAD = 1 << 20, 4096, 1 << 15
#: The address that takes a file, the kind of the file, and its bytes at most.
FILE, FILE_KIND, MOST_FILE = "/api/desk-file", "application/octet-stream", 256_000_000
#: The header of every change; a page of another origin cannot send it without permission.
HEADER = ("x-evocity", "studio")
#: Random bytes of the token, and of the cookie.
SECRET = 32

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-embedder-policy": "require-corp",
    "x-frame-options": "DENY",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}
#: The page that a browser gets which another page, or a file, has led here.
_ONWARD = (
    '<!doctype html><meta charset="utf-8"><title>evocity studio</title>'
    '<meta http-equiv="refresh" content="0; url=/">'
)
# All addresses have only these characters.
_PLAIN = re.compile(rb"(?:/[a-z0-9][a-z0-9_-]*(?:\.[a-z0-9]+)*)+|/", re.ASCII)


class FileTooLong(MapError):
    """A file has more bytes than allowed, whatever its declared length."""

    def __init__(self) -> None:
        super().__init__(
            f"the file has more than {format_bytes(MOST_FILE)}",
            f"{format_bytes(MOST_FILE)} at most",
            "cut a part out of it, or save it as GeoPackage",
        )

    @property
    def answer(self) -> Response:
        # the rest of the file stays unread, as in `_refuse`
        return JSONResponse({"error": fault_of(self)}, 413, {"connection": "close"})


class Guard:
    """An application that passes to ``app`` only requests of its own page, at the ``port``."""

    def __init__(self, app: App, port: int):
        self._app = app
        self._hosts = {f"127.0.0.1:{port}", f"[::1]:{port}", f"localhost:{port}"}
        #: The token in the address that is opened first.
        self.token = secrets.token_urlsafe(SECRET)
        self._cookie, self._secret = f"evocity-{port}", secrets.token_urlsafe(SECRET)
        #: Set once a request has brought the token.
        self.opened = threading.Event()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":  # no websockets; the start and the end need no act
            return
        headers, body = Headers(scope=scope), None
        refused = self._refusal(scope, headers)
        if refused is None and scope["path"] == FILE and scope["method"] == "POST":
            receive = _limited(receive)
        elif refused is None and scope["method"] == "POST":
            body = await _read_body(receive)
            refused = None if body is not None else _refuse(413, "the body is too long")
        has_token = refused is None and self._has_token(scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                kept = [
                    pair for pair in message["headers"] if pair[0].decode().lower() not in _HEADERS
                ]
                added = [(name.encode(), value.encode()) for name, value in _HEADERS.items()]
                if has_token and message["status"] == 200:
                    self.opened.set()
                    cookie = f"{self._cookie}={self._secret}; HttpOnly; SameSite=Strict; Path=/"
                    added.append((b"set-cookie", cookie.encode()))
                message = {**message, "headers": kept + added}
            await send(message)

        if refused is not None:
            await refused(scope, receive, send_with_headers)
        elif has_token and not _is_own_site(headers):
            # a browser withholds the cookie from a page that another one has opened
            await HTMLResponse(_ONWARD)(scope, receive, send_with_headers)
        else:
            await self._app(scope, receive if body is None else _replay(body), send_with_headers)

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        """Return the answer to a request that may not pass, None for one that may."""
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _refuse(421, "studio has another name; open the address that it printed")
        origins = headers.getlist("origin")
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            return _refuse(403, "the request comes from a page of another site")
        if not _is_own_site(headers) and not (_is_opening(headers) and self._has_token(scope)):
            text = "the request comes from another site; paste the address of studio into a new tab"
            return _refuse(403, text)
        raw = scope.get("raw_path", b"")
        if _PLAIN.fullmatch(raw) is None or raw.decode() != scope["path"]:
            return _refuse(404, "there is nothing here")
        if len(scope["query_string"]) > MOST_QUERY:
            return _refuse(414, "the address is too long")
        if sum(len(name) + len(value) for name, value in headers.raw) > MOST_HEAD:
            return _refuse(431, "the headers are too long")
        if not (self._has_token(scope) or self._has_cookie(headers)):
            text = "open the whole address that `evocity studio` printed, with its token"
            return _refuse(403, text)
        if scope["method"] == "POST":
            if scope["path"] == FILE:
                return _refused_change(headers, FILE_KIND, MOST_FILE)
            return _refused_change(headers, "application/json", MOST_BODY)
        if scope["method"] not in ("GET", "HEAD"):
            return _refuse(405, "send GET, or POST with JSON", allow="GET, HEAD, POST")
        if headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
            return _refuse(400, "GET has no body")
        return None

    def admits(self, scope: Scope) -> bool:
        """Whether a request brings the token or the cookie."""
        return self._has_token(scope) or self._has_cookie(Headers(scope=scope))

    def _has_token(self, scope: Scope) -> bool:
        if scope["path"] != "/" or scope["method"] not in ("GET", "HEAD"):
            return False
        tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        return len(tokens) == 1 and _is_same(tokens[0], self.token)

    def _has_cookie(self, headers: Headers) -> bool:
        values = []
        for line in headers.getlist("cookie"):
            try:
                cookie = SimpleCookie(line).get(self._cookie)
            except CookieError:
                continue
            values += [] if cookie is None else [cookie.value]
        return len(values) == 1 and _is_same(values[0], self._secret)


def _is_own_site(headers: Headers) -> bool:
    """Whether a request comes from studio's own page, or from the browser's address bar."""
    sites = headers.getlist("sec-fetch-site")
    return all(site in ("same-origin", "none") for site in sites)


def _is_opening(headers: Headers) -> bool:
    """Whether a browser opens a page of its own window, as by the file of `opened_browser`."""
    modes, kinds = headers.getlist("sec-fetch-mode"), headers.getlist("sec-fetch-dest")
    return (modes, kinds) == (["navigate"], ["document"])


def _is_same(value: str, secret: str) -> bool:
    return secrets.compare_digest(value.encode(), secret.encode())


def _refused_change(headers: Headers, kind: str, most: int) -> Response | None:
    if headers.getlist(HEADER[0]) != [HEADER[1]]:
        return _refuse(403, f"a change needs the header {HEADER[0]}: {HEADER[1]}")
    kinds = headers.getlist("content-type")
    if len(kinds) != 1 or kinds[0].partition(";")[0].strip().lower() != kind:
        return _refuse(415, f"a change at this address needs the type {kind}")
    length = headers.get("content-length", "0")
    if not length.isdecimal() or len(length) > 12 or int(length) > most:
        if kind == FILE_KIND and length.isdecimal():
            return FileTooLong().answer
        return _refuse(413, f"a body has at most {most} bytes")
    return None


def _refuse(status: int, text: str, **headers: str) -> Response:
    # the rest of the request stays unread, so no other request may follow on this connection
    return PlainTextResponse(text + "\n", status, {"connection": "close", **headers})


async def _read_body(receive: Receive) -> bytes | None:
    """Return the whole body; None if it is too long, whatever its declared length."""
    parts, size = [], 0
    while True:
        message = await receive()
        if message["type"] != "http.request":  # the browser is gone
            return b"".join(parts)
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > MOST_BODY:
            return None
        if not message.get("more_body"):
            return b"".join(parts)


def _limited(receive: Receive) -> Receive:
    """Return ``receive`` for a file, in parts; it raises `FileTooLong` beyond `MOST_FILE`."""
    size = 0

    async def receive_limited() -> Message:
        nonlocal size
        message = await receive()
        size += len(message.get("body", b""))
        if size > MOST_FILE:
            raise FileTooLong
        return message

    return receive_limited


def _replay(body: bytes) -> Receive:
    async def receive() -> Message:
        return {"type": "http.request", "body": body, "more_body": False}

    return receive
