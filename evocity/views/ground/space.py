"""Open space: the pieces of open ground, their areas, and the courtyards among them."""

from dataclasses import dataclass

import numpy as np

from evocity.views.connected_components import pieces
from evocity.views.ground._kernels import nest


@dataclass(frozen=True, eq=False)
class OpenSpace:
    """The ground components of a map, and the ground that built components enclose.

    Ground that touches at a corner is one component; built ground that does is two. So each ground
    component reaches the map's border, or lies within exactly one built component.

    labels : int32 ``(H, W)``: 0 on built pixels, 1…n on the n ground components, of pixels that
        touch by sides or corners (8 neighbours).
    area : float64 ``(n,)``, m².
    enclosed_by : int32 ``(n,)``: the innermost built component around each ground component
        (`CityMap.labels`, less 1), whose courtyard it is; −1 if the ground reaches the map's
        border.
    enclosed : float64 ``(number of built components,)``, m²: the area of the holes of each built
        component: its courtyards and the buildings that stand in them.
    """

    labels: np.ndarray
    area: np.ndarray
    enclosed_by: np.ndarray
    enclosed: np.ndarray


def open_space(
    labels: np.ndarray, metres_per_pixel: float, site: np.ndarray | None = None
) -> OpenSpace:
    """Compute the open space around built components.

    Parameters
    ----------
    labels : int32 ``(H, W)``: 0 on open ground, 1…n on built components of 4 neighbours.
    metres_per_pixel : side of a pixel, metres.
    site : bool ``(H, W)``: the map's own pixels, None for all. Its edge is a border like the
        map's; ``enclosed`` counts pixels beyond it as ground.

    About 0.4 ms at 256², labels given. All arrays are read-only.
    """
    grounds, count = pieces(labels == 0, corners=True)
    pixels = np.empty(count, np.int64)
    enclosed_by = np.empty(count, np.int32)
    enclosed = np.empty(labels.max(initial=0), np.int64)
    nest(grounds, labels, pixels, enclosed_by, enclosed)
    if site is not None:
        grounds, pixels, enclosed_by = _clip_to_site(grounds, enclosed_by, site)
    pixel = metres_per_pixel**2
    arrays = grounds, pixels * pixel, enclosed_by, enclosed * pixel
    for array in arrays:
        array.setflags(write=False)
    return OpenSpace(*arrays)


def _clip_to_site(
    grounds: np.ndarray, enclosed_by: np.ndarray, site: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Label the pieces of ground within the ``site``: labels, pixels, and ``enclosed_by``, −1 where
    the ground continues beyond."""
    own, count = pieces((grounds > 0) & site, corners=True)
    beyond = np.zeros(enclosed_by.size + 1, bool)
    beyond[grounds[~site]] = True
    whole = np.zeros(count, np.intp)
    whole[own[own > 0] - 1] = grounds[own > 0]
    by = np.where(beyond[whole], -1, enclosed_by[whole - 1]).astype(np.int32)
    return own, np.bincount(own.ravel(), minlength=count + 1)[1:], by
