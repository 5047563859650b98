"""The smallest convex shapes about each building: hull, rectangle, circle."""

from evocity.views.buildings.hulls._kernels import hulls

__all__ = ["hulls"]
