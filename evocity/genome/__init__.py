"""A city as an iterated function system: one gene, a lifs, a range block.

- `nucleotides`: the one table of what a gene holds
- `genome`: `Genome`; `checks`: what its parts may be
- `descent`: what a child has of its parents besides their lifs
- `refining`: lifs split and merged without change, genomes laid of pieces of others
- `files`, `reading`: genome files, written and read
"""

from evocity.genome.descent import descended, joined, merged_cities
from evocity.genome.files import SCHEMA_VERSIONS
from evocity.genome.genome import Genome
from evocity.genome.nucleotides import (
    DOMAIN,
    FIELDS,
    MOST_PARENTS,
    NEWER,
    NUCLEOTIDES,
    PROVENANCE,
    VOID,
    Nucleotide,
    packed,
    unpacked,
)
from evocity.genome.reading import read_genome
from evocity.genome.refining import Pieces, laid, merged, refined, split

__all__ = [
    "DOMAIN",
    "FIELDS",
    "MOST_PARENTS",
    "NEWER",
    "NUCLEOTIDES",
    "PROVENANCE",
    "SCHEMA_VERSIONS",
    "VOID",
    "Genome",
    "Nucleotide",
    "Pieces",
    "descended",
    "joined",
    "laid",
    "merged",
    "merged_cities",
    "packed",
    "read_genome",
    "refined",
    "split",
    "unpacked",
]
