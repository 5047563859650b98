"""Breed city fabrics: real districts coded as fractal genomes."""

__version__ = "0.1.0"
