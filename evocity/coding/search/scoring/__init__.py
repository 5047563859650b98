"""The last word on near-ties: domain blocks scored in float64."""

from evocity.coding.search.scoring._kernels import rank, settle

__all__ = ["rank", "settle"]
