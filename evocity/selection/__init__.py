"""Selection: which births survive and which individuals become parents.

- `algorithms`: one algorithm a file: NSGA-II, NSGA-III, hypervolume contribution, MAP-Elites, CMA
- `individual`, `population`: the living individuals, generation by generation
- `fronts`: dominance and hypervolume; `cells`: a grid over measures; `thumbprints`: cities that
  look alike; `niches`: places for plans of streets, twins
- `backends`: DEAP and moocore, one file each
"""
