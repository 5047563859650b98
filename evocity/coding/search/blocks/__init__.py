"""What a block is, whatever it is compared with: D4 coordinates, norms of parts, kinds."""

from evocity.coding.search.blocks._kernels import canonical, fold, kinds, part_norms

__all__ = ["canonical", "fold", "kinds", "part_norms"]
