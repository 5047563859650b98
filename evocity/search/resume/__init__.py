"""Runs that go on, and births that are repeated.

- `resume`: goes on with a stopped run; `prepared_run`: the recipe and sources of its preparation
- `recipe_changes`: what a resumed run may change of its recipe; `rescore`: old births scored by
  new measures
- `replay`: breeds logged births a second time and compares every bit; `logged_plans`: their plans
- `refine`: improves one individual by an optimiser
"""
