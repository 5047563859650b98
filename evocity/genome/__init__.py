"""Genomes: a city as an iterated function system with one gene, a lifs, for each range block.

- `genome`, `nucleotides`, `checks`: the chromosome, the fields of a gene, their bounds
- `split_merge`: lifs split and merged without change of the decoded map
- `reader`, `writer`: genome files
"""

from evocity.genome.genome import Genome, descended, joined, merged_cities
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
from evocity.genome.reader import read_genome
from evocity.genome.split_merge import Pieces, laid, merged, refined, split
from evocity.genome.writer import SCHEMA_VERSIONS

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
