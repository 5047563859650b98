"""Preparation: everything a run needs before its first birth.

- `preparation`: maps are read and encoded, targets measured
- `founders`: parents that are genomes of files or individuals of other runs
- `masks`: locked pixels, and the parts of the map that measures look at
- `constraints`: which constraints the parents keep
- `provenance`, `changes`: hashes of maps and measures, copies of the user's own measure files, and
  what changed since
- `trust`: which run folders may execute the measures they bring
- `startup`: the folder and the workers of a search
"""
