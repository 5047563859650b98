"""What a block is, whatever it is compared with: D4 coordinates, norms of parts, kinds."""

from evocity.coding.search.blocks._kernels import (
    canonical,
    fold,
    fold_at,
    kinds,
    part_norms,
    relief_keys,
    z_order,
)

__all__ = ["canonical", "fold", "fold_at", "kinds", "part_norms", "relief_keys", "z_order"]
