"""Genomes: a city as an iterated function system with one gene, a lifs, for each range block.

- `genome`, `nucleotides`, `checks`: the chromosome, the fields of a gene, their bounds
- `roofs`: shapes of roofs of the source cities, and what their heights measure to
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
from evocity.genome.roofs import (
    RIDGE,
    ROOF_SHAPES,
    RoofTable,
    building_roofs,
    most_roofs,
    roof_codes,
)
from evocity.genome.split_merge import Pieces, laid, merged, refined, split
from evocity.genome.writer import SCHEMA_VERSIONS

__all__ = [
    "DOMAIN",
    "FIELDS",
    "MOST_PARENTS",
    "NEWER",
    "NUCLEOTIDES",
    "PROVENANCE",
    "RIDGE",
    "ROOF_SHAPES",
    "SCHEMA_VERSIONS",
    "VOID",
    "Genome",
    "Nucleotide",
    "Pieces",
    "RoofTable",
    "building_roofs",
    "descended",
    "joined",
    "laid",
    "merged",
    "merged_cities",
    "most_roofs",
    "packed",
    "read_genome",
    "refined",
    "roof_codes",
    "split",
    "unpacked",
]
