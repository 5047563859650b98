"""Messages to a worker: a length, then as many pickled bytes. `evocity.evaluation.answers` are the
messages from it, which are never unpickled."""

import socket
import struct
from multiprocessing.reduction import ForkingPickler
from typing import Any

LENGTH = struct.Struct("<Q")
#: The longest message; a greater length means that something else wrote into the connection.
MOST_BYTES = 1 << 31
#: The method of a message that asks for the digest of the canary.
CHECK = "check"


def write_frame(message: Any) -> bytes:
    """Return the bytes of a message; raises the errors of pickling."""
    pickled = ForkingPickler.dumps(message)
    return LENGTH.pack(len(pickled)) + bytes(pickled)


def unpickle(pickled: bytes | bytearray | memoryview) -> Any:
    """Return the message of these bytes, given without the length."""
    return ForkingPickler.loads(pickled)


def receive(connection: socket.socket) -> Any:
    """Wait for the next message. Raises EOFError if the other side is gone."""
    (length,) = LENGTH.unpack(_receive_exactly(connection, LENGTH.size))
    return unpickle(_receive_exactly(connection, length))


def _receive_exactly(connection: socket.socket, count: int) -> bytearray:
    received = bytearray(count)
    view = memoryview(received)
    while view:
        size = connection.recv_into(view)
        if not size:
            raise EOFError
        view = view[size:]
    return received
