"""The slope of a run's hypervolume: what more births would bring."""

import numpy as np

from evocity.search.record.commands import REVISED
from evocity.store import RunLog

#: Generations that a slope needs.
FEWEST = 10
#: A hypervolume that grew by a smaller share hardly grew.
_HARDLY = 0.01


def more_births(run: RunLog) -> str:
    """Say by the slope of the hypervolume what as many births again would bring to a ``run``. A
    hypervolume grows by about as much whenever the births double. The text is empty for runs of few
    generations, and for grids, whose cells say more."""
    if run.header.figures:
        return ""
    changed = [
        event["generation"]
        for event in run.events()
        if (event.get("event") == REVISED or event.get("command") == "reweight")
        and isinstance(event.get("generation"), int)
    ]
    counted = [
        (entry["births"], entry["hypervolume"])
        for entry in run.history()
        if entry["generation"] >= max(changed, default=0)  # earlier ones may have another unit
        and isinstance(entry.get("hypervolume"), int | float)
        and np.isfinite(entry["hypervolume"])
    ]
    if len(counted) < FEWEST:
        return ""
    births, volumes = np.array(counted, float).T
    best, total = np.maximum.accumulate(volumes), births[-1]
    if best[-1] <= 0 or births[0] > total / 2:
        return ""
    half = float(np.interp(total / 2, births, best))
    gained = best[-1] - half
    text = (
        f"The last {total / 2:.0f} of {total:.0f} births raised the hypervolume from {half:.3g} to "
        f"{best[-1]:.3g}. "
    )
    if gained < _HARDLY * best[-1]:
        return f"{text}It hardly grows: {total:.0f} more births would bring little."
    return (
        f"{text}By this slope, {total:.0f} more births would bring about {best[-1] + gained:.3g} "
        f"({100 * gained / best[-1]:+.0f} %)."
    )
