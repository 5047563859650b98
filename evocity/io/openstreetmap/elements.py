"""Elements of OpenStreetMap that may belong to buildings, in memory, from any kind of file."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from evocity.io.account import DELETED, NO_POLYGON, Account
from evocity.io.heights import is_building

# The most ways of buildings, and nodes of these, in memory: about 2 GB.
_MOST_WAYS, _MOST_NODES = 1_000_000, 6_000_000

# A multipolygon with only these tags has those of its outer way: the custom before 2017.
_SILENT_TAGS = {"type", "source", "created_by", "note", "fixme"}

#: Longitude and latitude.
Place = tuple[float, float]
#: A node: its place where the element says it, otherwise its id.
Node = int | Place
Tags = Mapping[str, str]
#: A way or relation that is not deleted: nodes, or way id and role of each member; tags.
Way = tuple[Sequence[Node], Tags]
Relation = tuple[Sequence[tuple[int, str]], Tags]


@dataclass
class Extract:
    """Relations and ways that may belong to buildings, by their ids, and places of nodes.

    Give the relations first, then the ways, then the nodes. An element that comes again replaces
    the earlier one; Overpass gives members again without tags, so that tags stay. ``account``
    counts the features that cannot have an area: deleted ones, nodes, relations of other types.
    """

    relations: dict[int, Relation] = field(default_factory=dict)
    ways: dict[int, Way] = field(default_factory=dict)
    places: dict[int, Place] = field(default_factory=dict)
    members: set[int] = field(default_factory=set)
    account: Account = field(default_factory=Account)
    located: bool = False
    _count: int = 0
    _needed: set[Node] | None = None

    def take_relation(
        self, number: int, tags: Tags, members: Sequence[tuple[int, str]], deleted: bool = False
    ) -> None:
        """Keep a relation with the ids and roles of its ways, if it may be a building."""
        if deleted:
            self._delete(self.relations.pop(number, None), tags)
            return
        old = self.relations.get(number)
        tags = tags or (old[1] if old else {})
        relevant = is_building(tags) or _SILENT_TAGS.issuperset(tags)
        if relevant and tags.get("type") == "multipolygon":
            self.relations[number] = members, tags
            self.members.update(way for way, _ in members)
            self._check_room(len(members))
        elif is_building(tags) and tags.get("type") != "building":  # this type groups others
            self._leave_out(NO_POLYGON)

    def take_way(
        self, number: int, tags: Tags, nodes: Sequence[Node], deleted: bool = False
    ) -> None:
        """Keep a way, if it is a building or a member of a relation that may be one."""
        old = self.ways.get(number)
        if deleted:
            self._delete(self.ways.pop(number, None), tags)
        elif number in self.members or is_building(tags) or old:
            old_nodes, old_tags = old or ((), {})
            self.ways[number] = nodes or old_nodes, tags or old_tags
            self._check_room(len(nodes))

    def choose_nodes(self) -> None:
        """Restrict the nodes that follow to those of the ways."""
        self._needed = {node for nodes, _ in self.ways.values() for node in nodes}
        self.located = any(isinstance(node, tuple) for node in self._needed)

    def take_node(self, number: int, tags: Tags, deleted: bool, place: Callable[[], Place]) -> None:
        """Keep the ``place`` of a node, if a way needs it."""
        if tags and is_building(tags):
            self._leave_out(DELETED if deleted else NO_POLYGON)
        if not deleted:
            self.located = True
            if self._needed is None or number in self._needed:
                self.places[number] = place()

    def points(self, nodes: Iterable[Node]) -> list[Place] | None:
        """Return the places of the nodes of a way, without repetition; None if one is missing."""
        points: list[Place] = []
        for node in nodes:
            place = node if isinstance(node, tuple) else self.places.get(node)
            if place is None:
                return None
            if not points or points[-1] != place:
                points.append(place)
        return points

    def _delete(self, old: Way | Relation | None, tags: Tags) -> None:
        if is_building(tags) or (old and is_building(old[1])):
            self._leave_out(DELETED)

    def _leave_out(self, reason: str) -> None:
        self.account.features += 1
        self.account.drop(reason)

    def _check_room(self, more: int) -> None:
        """Raise ValueError for more ways or nodes than fit into memory."""
        self._count += more
        if len(self.ways) > _MOST_WAYS or self._count > _MOST_NODES:
            raise ValueError(
                f"its buildings have more than {_MOST_WAYS} outlines, or {_MOST_NODES} corners; "
                "cut it to the city: osmium extract --bbox"
            )
