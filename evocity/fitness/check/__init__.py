"""Checks of your own measure: trials on maps, findings with remedies, and cost.

- `trial`: `check`, which tries a measure on maps
- `faults`: the faults of a measure as findings, and the report of its trials
- `observed_call`: one observed call of a measure on a `Case`, and its changes to the map
- `cost`: the time that measures take
"""

from evocity.fitness.check.observed_call import Case
from evocity.fitness.check.trial import check

__all__ = ["Case", "check"]
