"""The open connections to studio, each counted as its user's own or as a stranger's.

Any program of this machine can open connections and leave them idle. Those that have not brought
the cookie or the token have few places, and the oldest leaves its place to the next. The user's own
connections have other places.
"""

from typing import Protocol

#: Connections that have not brought the cookie or the token, and those that have; at most.
MOST_STRANGERS, MOST_OWN = 128, 256


class Connection(Protocol):
    """What `Connections` needs of a connection."""

    @property
    def is_idle(self) -> bool:
        """Whether no request of it is being answered."""

    def drop(self) -> None:
        """Close it now."""


class Connections:
    """The open connections, the oldest first."""

    def __init__(self) -> None:
        self._strangers: dict[Connection, None] = {}
        self._own: dict[Connection, None] = {}

    def add(self, connection: Connection) -> None:
        """Add a connection that has brought nothing yet; drop the oldest of them, if needed."""
        self._strangers[connection] = None
        while len(self._strangers) > MOST_STRANGERS:
            oldest = next(iter(self._strangers))
            del self._strangers[oldest]
            oldest.drop()

    def trust(self, connection: Connection) -> None:
        """Count a connection as the user's own; drop the oldest of them that is idle, if needed."""
        if self._strangers.pop(connection, self) is self:  # it counts already, or is dropped
            return
        self._own[connection] = None
        idle = [one for one in self._own if one.is_idle and one is not connection]
        for oldest in idle[: max(0, len(self._own) - MOST_OWN)]:
            del self._own[oldest]
            oldest.drop()

    def remove(self, connection: Connection) -> None:
        """Forget a closed connection."""
        self._strangers.pop(connection, None)
        self._own.pop(connection, None)
