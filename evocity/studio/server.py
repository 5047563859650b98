"""The server of studio: a socket of this machine only, until Ctrl-C."""

import contextlib
import signal
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import uvicorn

from evocity.errors import EvocityError, reason_of, setting
from evocity.search.steering.signals import signals_raise
from evocity.studio.desk_routes import StudioOptions
from evocity.studio.guard import MOST_HEAD, MOST_QUERY, Guard
from evocity.studio.routes import Studio

HOST = "127.0.0.1"
# Requests at a time; seconds that a request may still take once the server ends.
_AT_ONCE, _PATIENCE = 256, 2


class Server(uvicorn.Server):
    """A server for the runs at ``paths`` and for the ``options`` of the command line, at `url`.
    Raises `RunError` as `Studio`, `EvocityError` if the ``port`` is not free; 0 is any port."""

    def __init__(self, paths: Iterable[str | Path], port: int, options: StudioOptions):
        self.studio = Studio(paths, options)
        self._socket = _open_socket(port)
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
        """The address to open first, with its token."""
        return f"http://{HOST}:{self.port}/?token={self._guard.token}"

    def run_until_stopped(self) -> None:
        """Answer until a signal, which is then raised again, or until `should_exit`."""
        with contextlib.closing(self._socket), contextlib.closing(self.studio):
            self.run(sockets=[self._socket])


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
) -> None:
    """Run a `Server` until Ctrl-C; ``announce`` gets the address before the first answer. SIGTERM
    and SIGHUP end the server too, and then raise `Signalled`."""
    with signals_raise():
        server = Server(paths, port, options)
        announce(server.url)
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
        opened.listen(_AT_ONCE)
    except (OSError, OverflowError) as error:
        opened.close()
        raise EvocityError(
            f"{setting('port', port)} is not free: {reason_of(error)}",
            "a free port of this machine, 1024 to 65535",
            "choose another port, or leave the port out to use any free port",
        ) from None
    return opened
