"""The server's life: a socket of this machine alone, until Ctrl-C."""

import contextlib
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import uvicorn

from evocity.errors import EvocityError, setting
from evocity.search.signals import signals_raise
from evocity.studio.answers import Studio
from evocity.studio.begins import Begins
from evocity.studio.guard import MOST_HEAD, MOST_QUERY, Guard

HOST = "127.0.0.1"
#: Requests at a time; seconds that one may still take once the server ends.
_AT_ONCE, _PATIENCE = 256, 2


class Server(uvicorn.Server):
    """Answers of the runs at ``paths``, and of those within ``folder``, at `url`, once it ``run``s;
    ``begins`` tells what its desk offers. Raises `RunError` if there is none, `EvocityError` if the
    ``port`` cannot be had; 0 takes any that is free."""

    def __init__(
        self,
        paths: Iterable[str | Path],
        port: int = 0,
        folder: str | Path | None = None,
        begins: Begins | None = None,
    ):
        self.studio = Studio(paths, folder, begins)
        self._socket = _bound(port)
        self.port = self._socket.getsockname()[1]
        self._guard = Guard(self.studio.app, self.port)
        super().__init__(
            uvicorn.Config(
                self._guard,
                http="h11",
                ws="none",
                lifespan="off",
                log_level="error",
                access_log=False,
                server_header=False,
                proxy_headers=False,
                limit_concurrency=_AT_ONCE,
                timeout_graceful_shutdown=_PATIENCE,
                h11_max_incomplete_event_size=MOST_QUERY + MOST_HEAD,
            )
        )

    @property
    def url(self) -> str:
        """The address that is opened first, with its token."""
        return f"http://{HOST}:{self.port}/?token={self._guard.token}"

    def run_until_stopped(self) -> None:
        """Answer until a signal, which is raised again then, or until `should_exit`."""
        with contextlib.closing(self._socket), contextlib.closing(self.studio):
            self.run(sockets=[self._socket])


@contextlib.contextmanager
def served(
    *paths: str | Path,
    port: int = 0,
    folder: str | Path | None = None,
    begins: Begins | None = None,
) -> Iterator[Server]:
    """A `Server` in a thread, for as long as the block takes."""
    server = Server(paths, port, folder, begins)
    thread = threading.Thread(target=server.run_until_stopped, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.should_exit = True
        thread.join()


def serve(
    paths: Iterable[str | Path],
    port: int,
    folder: str | Path | None,
    began: Callable[[str], None],
    begins: Begins | None = None,
) -> None:
    """A `Server` until Ctrl-C; ``began`` is told the address once it can be opened. SIGTERM and
    SIGHUP end it as well, and raise `Signalled` then."""
    with signals_raise():
        server = Server(paths, port, folder, begins)
        began(server.url)
        with _hangup_ends(server):
            server.run_until_stopped()


@contextlib.contextmanager
def _hangup_ends(server: Server) -> Iterator[None]:
    """Within, SIGHUP ends the ``server`` between two answers, as uvicorn has it of SIGTERM, and is
    raised afterwards: in the middle of an answer it would be taken for a fault of that."""
    number = getattr(signal, "SIGHUP", None)
    before = None if number is None else signal.getsignal(number)
    if not callable(before):  # it is ignored, or there is none
        yield
        return
    came = []

    def ended(*told) -> None:
        came.append(told)
        server.should_exit = True

    signal.signal(number, ended)
    try:
        yield
    finally:
        signal.signal(number, before)
    for told in came[:1]:
        before(*told)


def _bound(port: int) -> socket.socket:
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((HOST, port))
        found.listen(_AT_ONCE)
    except (OSError, OverflowError) as error:
        found.close()
        raise EvocityError(
            f"{setting('port', port)} cannot be had: {getattr(error, 'strerror', None) or error}",
            "a port of this machine that is free, 1024 to 65535",
            "choose another, or leave it out for any that is free",
        ) from None
    return found


__all__ = ["HOST", "Server", "serve", "served"]
