"""The last word on near-ties: domain blocks scored in float64."""

from evocity.coding.search.scoring._kernels import scoring_kernels

__all__ = ["scoring_kernels"]
