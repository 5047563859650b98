"""Links of lines with the frame of the map, by lines and over places."""

from evocity.views.streets.links._kernels import reach_frame

__all__ = ["reach_frame"]
