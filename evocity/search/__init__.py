"""A recipe in, generations out: ask, evaluate, tell.

- `reading`, `recipe`, `sections`, `values`, `checking`, `agreement`: a TOML file, or what Python
  gives, becomes a `Recipe` without faults
- `preparation`: maps are read and encoded, targets measured
- `founding`: parents that were bred before, of files and of other runs
- `guarding`: which constraints the parents keep, before the first birth
- `calibration`, `recipe_text`: a recipe to begin from, its guard calibrated on the parents
- `breeding`: who is bred from whom, each birth from its own generator
- `births`: plans become births, in one job each or by those who evaluate elsewhere
- `door`: what an operator returned is checked before it is a birth of the run
- `evaluator`: one individual bred and evaluated, whatever an operator or a measure does
- `evaluation`, `worker`, `warm`: worker processes with a deadline for each individual
- `algorithms`: who lives on and who breeds, an algorithm a file
- `cells`: a grid over measures, and how well it is filled
- `fronts`, `looks`: who dominates whom, how good many are together, which cities look alike
- `borrowed`: what of that comes from DEAP and moocore, a file each
- `individual`, `population`: the living, generation by generation; `island`, `archipelago`: all
  of a search, and what decides their births
- `beginning`: the folder and the workers of a search
- `engine`: `Search`, the loop, which writes every birth down; `generation`: where it is
- `leaving`, `opening`: which genomes its log leaves out; how these are had
- `signals`: what ends it from outside; `observers`: who watches it, its log first
- `credit`: which operators earn their births
- `commands`, `steering`: what may be asked of it while it goes on, and how that is carried out
- `rereading`, `resuming`, `keeping`: what a run was prepared with; taking it up again, with the
  files of the user's own that it kept
- `replaying`, `repeating`: how births of a run came about; whether they are the same once more;
  `differing`: what differs; `rechecking`: a few are replayed while the search goes on
- `refinement`: one individual made better by an optimiser, by itself or as a step of a search
- `toolbox`: DEAP's own algorithms on city genomes
- `judging`: what a log tells of births: values, losses, constraints
- `archiving`, `binning`: of all births ever, those that no other dominates; the best of each cell
"""

from evocity.rooms import lazily

__getattr__, __dir__, __all__ = lazily(__name__, __file__)
