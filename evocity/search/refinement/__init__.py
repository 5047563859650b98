"""One individual made better by an optimiser, NLopt's: a memetic step, or by itself.

- `tuning`: what is tuned, as numbers and the operator that they are parameters of
- `score`: what makes one number of all goals
- `climbing`: the optimiser asks, children are bred and measured
- `offering`: whose fabric is offered, round by round
- `refine`: an individual of a run, the run left as it is
- `step`: within a search, where the result is a birth like any other
"""
