"""Messages between the main process and a worker: a length, then as many bytes."""

import socket
import struct
from multiprocessing.reduction import ForkingPickler
from typing import Any

LENGTH = struct.Struct("<Q")
#: A longer message is none: something else wrote into the connection.
MOST_BYTES = 1 << 33


def framed(message: Any) -> bytes:
    """The bytes of a message; raises what pickling raises."""
    told = ForkingPickler.dumps(message)
    return LENGTH.pack(len(told)) + bytes(told)


def read_of(told: bytes | bytearray | memoryview) -> Any:
    """The message of such bytes, without the length."""
    return ForkingPickler.loads(told)


def receive(connection: socket.socket) -> Any:
    """The next message, waited for. Raises EOFError when the other side is gone."""
    (length,) = LENGTH.unpack(_exactly(connection, LENGTH.size))
    return read_of(_exactly(connection, length))


def _exactly(connection: socket.socket, count: int) -> bytearray:
    found = bytearray(count)
    view = memoryview(found)
    while view:
        got = connection.recv_into(view)
        if not got:
            raise EOFError
        view = view[got:]
    return found
