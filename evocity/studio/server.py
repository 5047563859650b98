"""The server of studio: a socket of this machine only, until Ctrl-C."""

import contextlib
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from evocity.errors import EvocityError, reason_of, setting
from evocity.search.steering.stop_rules import signals_raise
from evocity.studio.browser import opened_browser
from evocity.studio.connections import MOST_OWN, MOST_STRANGERS, Connections
from evocity.studio.desk_routes import StudioOptions
from evocity.studio.guard import MOST_HEAD, MOST_QUERY, Guard
from evocity.studio.routes import Studio

HOST = "127.0.0.1"
# Connections that may wait, and those of them that are accepted at once, before `Connections` drops
# any; seconds that a request may still take once the server ends.
_WAITING, _AT_ONCE, _PATIENCE = 1024, 64, 1


class Server(uvicorn.Server):
    """A server for the runs at ``paths`` and the ``options`` of the command line; port 0 is any."""

    def __init__(self, paths: Iterable[str | Path], port: int, options: StudioOptions):
        self.studio = Studio(paths, options)
        self._socket = _open_socket(port)
        self.port = self._socket.getsockname()[1]
        self._guard = Guard(self.studio.app, self.port)
        super().__init__(
            uvicorn.Config(
                self._guard,
                http=_connection_of(self._guard),
                ws="none",
                lifespan="off",
                log_level="error",
                access_log=False,
                server_header=False,
                proxy_headers=False,
                backlog=_AT_ONCE,
                limit_concurrency=MOST_STRANGERS + 2 * MOST_OWN,
                timeout_graceful_shutdown=_PATIENCE,
                h11_max_incomplete_event_size=MOST_QUERY + MOST_HEAD,
            )
        )

    @property
    def url(self) -> str:
        """The address to open first, with its token."""
        return f"http://{HOST}:{self.port}/?token={self._guard.token}"

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen, as uvicorn calls it."""
        await super().startup(sockets)
        self._socket.listen(_WAITING)

    @property
    def opened(self) -> threading.Event:
        """Set once a browser has opened `url`."""
        return self._guard.opened

    def run_until_stopped(self) -> None:
        """Answer until a signal, which is then raised again, or until `should_exit`."""
        with contextlib.closing(self._socket), contextlib.closing(self.studio):
            self.run(sockets=[self._socket])


def _connection_of(guard: Guard) -> type[H11Protocol]:
    """Return the kind of connections of one server, which `Connections` counts."""
    connections = Connections()

    class Connection(H11Protocol):
        trusted = False

        @property
        def is_idle(self) -> bool:
            return self.cycle is None or self.cycle.response_complete

        def drop(self) -> None:
            self.transport.abort()

        def connection_made(self, transport) -> None:
            super().connection_made(transport)
            connections.add(self)

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if not self.trusted and self.scope is not None and guard.admits(self.scope):
                self.trusted = True
                connections.trust(self)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.remove(self)
            super().connection_lost(exc)

    return Connection


@contextlib.contextmanager
def running_server(*paths: str | Path, port: int = 0, **options) -> Iterator[Server]:
    """Run a `Server` with `StudioOptions` in a thread for the duration of the block."""
    server = Server(paths, port, StudioOptions(**options))
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
    announce: Callable[[str], None],
    options: StudioOptions,
    browse: bool = False,
) -> None:
    """Run a `Server` until Ctrl-C, SIGTERM or SIGHUP; ``announce`` gets the address. ``browse``:
    also open a browser there."""
    with signals_raise(), contextlib.ExitStack() as stack:
        server = Server(paths, port, options)
        announce(server.url)
        if browse:
            stack.enter_context(opened_browser(server.url, server.opened))
        with _hangup_ends(server):
            server.run_until_stopped()


@contextlib.contextmanager
def _hangup_ends(server: Server) -> Iterator[None]:
    """Within the block, SIGHUP ends the ``server`` between two answers, as uvicorn does for
    SIGTERM, and is raised afterwards: within an answer it would count as a fault of that answer."""
    number = getattr(signal, "SIGHUP", None)
    before = None if number is None else signal.getsignal(number)
    if not callable(before):  # the signal is ignored, or does not exist
        yield
        return
    signals = []

    def end(*arguments) -> None:
        signals.append(arguments)
        server.should_exit = True

    signal.signal(number, end)
    try:
        yield
    finally:
        signal.signal(number, before)
    for arguments in signals[:1]:
        before(*arguments)


def _open_socket(port: int) -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((HOST, port))
        opened.listen(_WAITING)
    except (OSError, OverflowError) as error:
        opened.close()
        raise EvocityError(
            f"{setting('port', port)} is not free: {reason_of(error)}",
            "a free port of this machine, from 1024 to 65535",
            "choose another port, or leave the port out to use any free port",
        ) from None
    return opened
