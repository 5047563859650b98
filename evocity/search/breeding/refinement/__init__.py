"""Refinement: an optimiser, NLopt's, improves one individual.

- `variables`: the numbers that are tuned, and the operator that has them as parameters
- `climb`: the optimiser's loop, and the one number that it minimises
- `step`: refinements as births of a search (the memetic step)

`evocity.search.resume.refine` improves an individual of a run, outside the search.
"""
