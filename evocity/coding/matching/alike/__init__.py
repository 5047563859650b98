"""Which blocks are alike: domain blocks of one kind, shapes of range blocks, and an order."""

from evocity.coding.matching.alike._kernels import canonical, grouped, kind_kernels, uneven, z_order

__all__ = ["canonical", "grouped", "kind_kernels", "uneven", "z_order"]
