"""Who is answered at all, and what every answer says.

Any page of the web can have a browser send requests to this machine, and by a name that its owner
has lead here even read the answers. So a request must name this server by one of its own names,
come from its own page, and bring the cookie that the address with the token was traded for;
whatever changes something must besides be what no form and no link can send: JSON of bounded
length, or, at one address, a file of bounded length.
"""

import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, PlainTextResponse, Response

from evocity.errors import MapError, told_bytes
from evocity.studio.one import fault_of

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

#: Bytes of a body, of a query and of all headers, at most.
MOST_BODY, MOST_QUERY, MOST_HEAD = 1 << 20, 4096, 1 << 15
#: Where a file is taken, its kind, and its bytes at most.
FILE, FILE_KIND, MOST_FILE = "/api/desk-file", "application/octet-stream", 256_000_000
#: The header that changes need, and its value; a page of another origin cannot send it unasked.
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
_SAID = {
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
# Addresses that are answered have no other characters; what is written another way is no address.
_PLAIN = re.compile(rb"(?:/[a-z0-9][a-z0-9_-]*(?:\.[a-z0-9]+)*)+|/", re.ASCII)


class TooLong(MapError):
    """A file has more bytes than it may, whatever its length was said to be."""

    def __init__(self) -> None:
        super().__init__(
            f"the file has more than {told_bytes(MOST_FILE)}",
            f"{told_bytes(MOST_FILE)} at most",
            "cut a part out of it, or save it as GeoPackage",
        )

    @property
    def answer(self) -> Response:
        """What is answered, in three parts as any fault."""
        # as in `_no`, the rest of the file is not read
        return JSONResponse({"error": fault_of(self)}, 413, {"connection": "close"})


class Guard:
    """Lets to an ``app`` what comes from its own page, at the loopback ``port``."""

    def __init__(self, app: App, port: int):
        self._app = app
        self._hosts = {f"127.0.0.1:{port}", f"[::1]:{port}", f"localhost:{port}"}
        #: Of the address that is opened first.
        self.token = secrets.token_urlsafe(SECRET)
        self._cookie, self._secret = f"evocity-{port}", secrets.token_urlsafe(SECRET)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":  # no websockets; there is nothing to do at begin and end
            return
        headers, brings = Headers(scope=scope), None
        refused = self._refusal(scope, headers)
        if refused is None and scope["path"] == FILE and scope["method"] == "POST":
            receive = _counted(receive)
        elif refused is None and scope["method"] == "POST":
            brings = await _body(receive)
            refused = None if brings is not None else _no(413, "the body is too long")
        has_token = refused is None and self._has_token(scope)

        async def told(message: Message) -> None:
            if message["type"] == "http.response.start":
                kept = [
                    pair for pair in message["headers"] if pair[0].decode().lower() not in _SAID
                ]
                said = [(name.encode(), value.encode()) for name, value in _SAID.items()]
                if has_token and message["status"] == 200:
                    said.append((b"set-cookie", self._traded.encode()))
                message = {**message, "headers": kept + said}
            await send(message)

        if refused is not None:
            await refused(scope, receive, told)
        else:
            await self._app(scope, receive if brings is None else _again(brings), told)

    @property
    def _traded(self) -> str:
        return f"{self._cookie}={self._secret}; HttpOnly; SameSite=Strict; Path=/"

    def _refusal(self, scope: Scope, headers: Headers) -> Response | None:
        """The answer to a request that is not let through."""
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _no(421, "this is no name of studio's; open the address that it printed")
        origins = headers.getlist("origin")
        if any(one != f"http://{hosts[0]}" for one in origins):
            return _no(403, "asked for by a page that is not studio's")
        if any(one not in ("same-origin", "none") for one in headers.getlist("sec-fetch-site")):
            return _no(403, "asked for by another site; paste studio's address into a new tab")
        raw = scope.get("raw_path", b"")
        if _PLAIN.fullmatch(raw) is None or raw.decode() != scope["path"]:
            return _no(404, "there is nothing here")
        if len(scope["query_string"]) > MOST_QUERY:
            return _no(414, "the address is too long")
        if sum(len(name) + len(value) for name, value in headers.raw) > MOST_HEAD:
            return _no(431, "the headers are too long")
        if not (self._has_token(scope) or self._has_cookie(headers)):
            return _no(403, "open the whole address that `evocity studio` printed, token and all")
        if scope["method"] == "POST":
            if scope["path"] == FILE:
                return _refused_change(headers, FILE_KIND, MOST_FILE)
            return _refused_change(headers, "application/json", MOST_BODY)
        if scope["method"] not in ("GET", "HEAD"):
            return _no(405, "GET, or POST of JSON", allow="GET, HEAD, POST")
        if headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
            return _no(400, "a question has no body")
        return None

    def _has_token(self, scope: Scope) -> bool:
        if scope["path"] != "/" or scope["method"] not in ("GET", "HEAD"):
            return False
        told = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        return len(told) == 1 and _same(told[0], self.token)

    def _has_cookie(self, headers: Headers) -> bool:
        told = []
        for line in headers.getlist("cookie"):
            try:
                found = SimpleCookie(line).get(self._cookie)
            except CookieError:
                continue
            told += [] if found is None else [found.value]
        return len(told) == 1 and _same(told[0], self._secret)


def _same(told: str, secret: str) -> bool:
    return secrets.compare_digest(told.encode(), secret.encode())


def _refused_change(headers: Headers, kind: str, most: int) -> Response | None:
    if headers.getlist(HEADER[0]) != [HEADER[1]]:
        return _no(403, f"changes have a header {HEADER[0]}: {HEADER[1]}")
    kinds = headers.getlist("content-type")
    if len(kinds) != 1 or kinds[0].partition(";")[0].strip().lower() != kind:
        return _no(415, f"here a change is {kind}")
    length = headers.get("content-length", "0")
    if not length.isdecimal() or len(length) > 12 or int(length) > most:
        if kind == FILE_KIND and length.isdecimal():
            return TooLong().answer
        return _no(413, f"a body has {most} bytes at most")
    return None


def _no(status: int, text: str, **headers: str) -> Response:
    # what is left of the request is not read, so nothing may follow it on this connection
    return PlainTextResponse(text + "\n", status, {"connection": "close", **headers})


async def _body(receive: Receive) -> bytes | None:
    """The whole body; None for one that is too long, whatever its length was said to be."""
    parts, size = [], 0
    while True:
        message = await receive()
        if message["type"] != "http.request":  # who asked is gone
            return b"".join(parts)
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > MOST_BODY:
            return None
        if not message.get("more_body"):
            return b"".join(parts)


def _counted(receive: Receive) -> Receive:
    """The same, not held in memory; raises `TooLong` where it goes on too long."""
    size = 0

    async def counting() -> Message:
        nonlocal size
        message = await receive()
        size += len(message.get("body", b""))
        if size > MOST_FILE:
            raise TooLong
        return message

    return counting


def _again(body: bytes) -> Receive:
    async def receive() -> Message:
        return {"type": "http.request", "body": body, "more_body": False}

    return receive


__all__ = [
    "FILE",
    "HEADER",
    "MOST_BODY",
    "MOST_FILE",
    "MOST_HEAD",
    "MOST_QUERY",
    "POLICY",
    "Guard",
    "TooLong",
]
