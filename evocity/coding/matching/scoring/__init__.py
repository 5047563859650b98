"""The last word on near-ties: domain blocks scored in float64."""

from evocity.coding.matching.scoring._kernels import rank, settle

__all__ = ["rank", "settle"]
