"""Checks of your own measure: trials on maps, findings with remedies, and cost.

- `trial`: `check`, which tries a measure on maps
- `faults`, `findings`: the faults of a measure, and the report of its trials
- `observed_call`: one observed call of a measure on a `Case`
- `side_effects`: changes to the map by a call
- `cost`: the time that measures take
"""

from evocity.fitness.check.observed_call import Case
from evocity.fitness.check.trial import check

__all__ = ["Case", "check"]
