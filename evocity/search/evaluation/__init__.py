"""Where breeding and evaluation run: in worker processes with a deadline each, or right here.

An `Engine` (`protocol.py`) carries out jobs: `Here` in the calling process, `Workers` in others.
`Workers` (`workers.py`) hands out jobs and judges deadlines, memory and deaths. A `Seat`
(`seats.py`) is one worker as the main process sees it. Workers are started, and ended with all
processes that they began, by a nursery process on Linux (`nursery.py`), by the main process
elsewhere (`starting.py`). Inside a worker runs `evocity.search.worker`.
"""

from evocity.search.evaluation.here import Here
from evocity.search.evaluation.protocol import Engine
from evocity.search.evaluation.workers import Workers

__all__ = ["Engine", "Here", "Workers"]
