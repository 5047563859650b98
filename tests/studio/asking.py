"""Requests to studio as a program of one's own sends them: any header, any line, any body."""

import http.client
import json
from dataclasses import dataclass
from pathlib import Path

from evocity.studio.guard import HEADER
from evocity.studio.server import Server

OLD = Path(__file__).parent.parent / "old"
HOSTILE = "<img src=x onerror='window.hacked=1'><script>window.hacked=1</script>\"'&${1}"


def contents(folder: Path) -> dict[str, bytes | None]:
    """All that is in a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@dataclass
class Told:
    """An answer."""

    status: int
    headers: dict[str, str]
    content: bytes

    @property
    def json(self):
        return json.loads(self.content)

    @property
    def framed(self) -> tuple[dict, bytes]:
        size = int.from_bytes(self.content[:4], "little")
        return json.loads(self.content[4 : 4 + size]), self.content[4 + size :]


class Client:
    """Asks a ``server``; with its cookie once it has opened the address."""

    def __init__(self, server: Server):
        self.server, self.cookie = server, None

    def open(self) -> Told:
        told = self.ask("GET", self.server.url.removeprefix(self.origin))
        self.cookie = told.headers["set-cookie"].partition(";")[0]
        return told

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self.server.port}"

    def ask(self, method: str, path: str, headers=(), body: bytes = b"", host=None) -> Told:
        """``headers``: pairs; ``host``: another than its own, or several."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=120)
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        hosts = [self.origin.removeprefix("http://")] if host is None else host
        pairs = [("Host", one) for one in hosts] + list(headers)
        given = {name.lower() for name, _ in pairs}
        if self.cookie and "cookie" not in given:
            pairs.append(("Cookie", self.cookie))
        if body and not given & {"content-length", "transfer-encoding"}:
            pairs.append(("Content-Length", str(len(body))))
        for name, value in pairs:
            connection.putheader(name, value)
        connection.endheaders()
        try:
            if body:
                connection.send(body)
        except (BrokenPipeError, ConnectionResetError):
            pass  # it has said no already
        answer = connection.getresponse()
        try:
            content = answer.read()
        except ConnectionResetError:
            content = b""  # it said no, and closed before it had read all that was sent
        connection.close()
        return Told(answer.status, {k.lower(): v for k, v in answer.getheaders()}, content)

    def get(self, path: str) -> Told:
        return self.ask("GET", path)

    def post(self, path: str, body: object) -> Told:
        headers = [("Content-Type", "application/json"), HEADER]
        return self.ask("POST", path, headers, json.dumps(body).encode())
