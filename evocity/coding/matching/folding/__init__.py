"""Blocks folded into D4 coordinates: by rows of a map, and wherever they lie."""

from evocity.coding.matching.folding._kernels import WIDTH, fold, fold_kernels

__all__ = ["WIDTH", "fold", "fold_kernels"]
