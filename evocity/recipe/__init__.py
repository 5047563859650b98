"""The recipe: the TOML file that defines a search.

- `reader`: reads a TOML file, or a bundled recipe, into a `Recipe`
- `recipe`: the class `Recipe`; `sections`, `search_section`, `stop_and_notify`, `islands`,
  `mixture`, `measures`: the models of its sections
- `values`: values beyond their types: files, maps, cities, names, places
- `validation`: all faults of a recipe at once; `consistency`: faults between its tables
"""
