"""Where breeding and evaluation run: in worker processes with a deadline each, or right here.

`Workers` (`workers.py`) hands out jobs and judges deadlines, memory and deaths. A `Seat`
(`seats.py`) is one worker as the main process sees it. Workers are started, and ended with all
processes that they began, by a nursery process on Linux (`nursery.py`), by the main process
elsewhere (`starting.py`). Inside a worker runs `evocity.search.worker`.
"""

from evocity.search.evaluation.here import Here
from evocity.search.evaluation.workers import Workers

__all__ = ["Here", "Workers"]
