"""Choice of the buildings among a file's polygons, with the account of the others."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.io.account import DEGENERATE, EMPTY, UNDERGROUND, UNTAGGED, Account
from evocity.io.heights import height_of, is_building
from evocity.io.polygon_repair import are_degenerate
from evocity.io.reader_types import Footprints
from evocity.io.underground import is_underground

# Tags of areas that are no buildings, whatever their height.
_OTHER = ("landuse", "leisure", "natural", "waterway", "highway", "barrier", "boundary")
_TAGS = ("building", "building:part")


def choose_buildings(
    footprints: Footprints, name: str, or_none: bool
) -> tuple[np.ndarray, Sequence[Mapping], Account]:
    """Choose the polygons of buildings above ground, and count the others by their reasons.

    If the file tags some polygons as buildings, polygons without the tag count as buildings only
    if they have a height of their own, or the file is a layer of buildings. Raises `MapError` if
    no polygon is a building, unless ``or_none``.
    """
    polygons, tags = footprints.polygons, footprints.tags
    account = _copy(footprints.account, len(polygons))
    kept = np.ones(len(polygons), dtype=bool)

    def drop(which: np.ndarray, reason: str) -> None:
        account.drop(reason, int((kept & which).sum()))
        kept[which] = False

    drop(shapely.is_empty(polygons), EMPTY)
    drop(are_degenerate(polygons), DEGENERATE)
    drop(np.fromiter(map(is_underground, tags), bool, len(tags)), UNDERGROUND)
    tagged = np.fromiter(map(is_building, tags), bool, len(tags))
    if tagged.any():
        untagged = kept & ~tagged
        like = [
            _is_like_building(tags[i], footprints.of_buildings)
            for i in np.flatnonzero(untagged).tolist()
        ]
        untagged[untagged] = ~np.array(like, dtype=bool)
        drop(untagged, UNTAGGED)
        account.remark("without a value of 'building'", int((kept & ~tagged).sum()))
    if not kept.any() and not or_none:
        raise no_building(name, account)
    if not kept.all():
        polygons, tags = polygons[kept], [tags[i] for i in np.flatnonzero(kept).tolist()]
    return polygons, tags, account


def no_building(name: str, account: Account) -> MapError:
    """Make the error for a file ``name`` without a building."""
    found = f"{name} has no building"
    if account.features:
        found += f"; its {account.features} features: {account.note}"
    expected = "polygons of building footprints"
    return MapError(found, expected, "check that the right file or layer was exported")


def _copy(account: Account | None, count: int) -> Account:
    if account is None:
        return Account(count)
    return Account(account.features, Counter(account.dropped), Counter(account.remarks))


def _is_like_building(tags: Mapping[str, object], of_buildings: bool) -> bool:
    """Tell whether a polygon without a tag for buildings counts as one of them."""
    if any(_is_set(tags.get(key)) for key in _OTHER) or any(_is_set(tags.get(k)) for k in _TAGS):
        return False
    return of_buildings or height_of(tags, 0.0)[1] != "default"


def _is_set(value: object) -> bool:
    return value is not None and value != "" and value == value
