"""Writing a measure of one's own: it is tried, timed, and told what is wrong with it.

- `checking`: `check`, what is wrong with a measure
- `faults`, `findings`: what may be wrong, and what a trial showed
- `watching`: one call of a measure, on a `Case`; `touched`: what it did to the map
- `timing`: what measures cost
"""

from evocity.authoring.checking import check
from evocity.authoring.watching import Case

__all__ = ["Case", "check"]
