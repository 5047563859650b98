"""A first recipe for any cities, with bounds that their own codes keep.

- `calibration`: goals and bounds, measured on the parents
- `guard`: the bounds that the parents decide
- `recipe_notes`: what the user may want to change
- `recipe_text`: the recipe as a commented TOML file
"""
