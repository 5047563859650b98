"""Births as solids with straight walls, for the walk: made when they are asked for, the last ones
kept."""

import threading
from collections import OrderedDict

import numpy as np

from evocity.analysis.individual import Individual
from evocity.errors import RunError
from evocity.studio.watched import Watched

#: Triangles of one birth, and births that are kept; at most.
MOST_TRIANGLES, MOST_KEPT = 400_000, 12


class Solids:
    """Of the births of one run that is ``watched``."""

    def __init__(self, watched: Watched):
        self._watched = watched
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[str, int], bytes] = OrderedDict()

    def of(self, identifier: int) -> bytes:
        """All triangles of a birth's scene, as `evocity.scene.Scene.triangles` has them: the
        corners of each, nine float32, then of each its colour, three bytes. Raises `RunError`
        where it has no map, and for more than `MOST_TRIANGLES`.

        The run can be read meanwhile; one is made at a time."""
        with self._watched.reading:
            moment = self._watched.moment
            one, key = Individual(moment.run.told, identifier), (moment.called, identifier)
            city, highest = one.city, moment.thumbnails.highest
        with self._lock:
            if key not in self._kept:
                from evocity.scene import scene

                corners, colours = scene(city).triangles(highest=highest)
                if len(corners) > MOST_TRIANGLES:
                    raise RunError(
                        f"birth {identifier} has {len(corners)} triangles",
                        f"at most {MOST_TRIANGLES} to walk through in a browser",
                        "save it as a scene and open that in a program of its own",
                    )
                content = np.ascontiguousarray(corners, "<f4").tobytes() + colours.tobytes()
                self._kept[key] = content
                while len(self._kept) > MOST_KEPT:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]


__all__ = ["MOST_KEPT", "MOST_TRIANGLES", "Solids"]
