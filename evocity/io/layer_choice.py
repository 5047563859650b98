"""Choice of the layer of buildings among the layers of a file."""

from collections.abc import Collection, Mapping

from evocity.errors import MapError, keyword
from evocity.io.heights import is_building_name


def choose_layer(
    name: str, layers: Mapping[str, bool], requested: str | None, every: Collection[str]
) -> str:
    """Choose a layer of the file ``name``: the ``requested`` one, the only one with a name for
    buildings, the only one of buildings, or the only one with areas. Raises `MapError` if several
    layers fit or no layer fits.

    ``layers`` maps each layer with areas to whether its contents say that it holds buildings;
    ``every`` names all layers of the file.
    """
    if requested is not None:
        if requested in every:
            return requested
        raise layer_error(name, f"no layer {requested!r}", every)
    for candidates in (
        [layer for layer in layers if is_building_name(layer)],
        [layer for layer, of_buildings in layers.items() if of_buildings],
        list(layers),
    ):
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            raise layer_error(name, f"{len(candidates)} layers that may hold buildings", candidates)
    raise layer_error(name, "no layer of polygons", every)


def layer_error(name: str, problem: str, layers: Collection[str]) -> MapError:
    """Make the error for a file ``name`` whose ``layers`` have a ``problem``."""
    return MapError(
        f"{name} has {problem}",
        f"one layer of building footprints; the file has the layers: "
        f"{', '.join(layer or '(without a name)' for layer in layers) or 'none'}",
        f"name the layer with {keyword('layer')}",
    )
