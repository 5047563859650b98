"""The search: a recipe in, generations out, by ask, evaluate and tell.

- `engine`: `Search`, the loop, which writes every birth into the log
- `schedules`: whole generations, or an ordered window; replays of a few births meanwhile
- `toolbox`: DEAP's own algorithms on city genomes
- `preparation`: everything before the first birth
- `breeding`: plans and births
- `steering`: commands, observers, stop rules
- `record`: what a run's folder says of births
- `resume`: runs that go on, births that are repeated
- `calibration`: a first recipe for any cities
"""

from evocity.lazy_imports import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
