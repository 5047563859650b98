"""Breeding: parents, operators and generators of births, and the births made from them.

- `birth_plans`: one plan a birth, drawn from the birth's own generator
- `births`: births bred and measured by plans, at once or elsewhere
- `island`, `archipelago`: one population, and all populations of a search
- `credit`: operator weights that follow success
- `levers`: operators that move a measure towards its target
- `omitted_genomes`: genomes that the log leaves out
- `redraws`: other plans for births whose children equal a parent
- `refinement`: births that an optimiser improves
"""
