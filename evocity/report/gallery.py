"""The cards of the galleries: picture, measures, lineage; their orders and filters."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.individual import built_shares, share_text
from evocity.genome import VOID
from evocity.pictures import city_colours
from evocity.report.pictures import Pictures
from evocity.report.shown_births import Shown, ShownBirths
from evocity.store import Birth
from evocity.templates import number

#: The words for the share of no city: bare ground in place of buildings.
_OPEN_GROUND = "open ground added"


@dataclass(frozen=True)
class Row:
    """A measure, an individual's value of it, and what was wanted."""

    name: str
    value: str
    goal: str


@dataclass(frozen=True)
class Share:
    """A source city, its share in words and in percent, and its colour."""

    city: str
    text: str
    percent: float
    colour: str


def shares_of(cities: Sequence[str], shares: np.ndarray) -> list[Share]:
    """Return the `Share` of each of the ``cities`` that has one."""
    parts = zip(_labels(cities), shares.tolist(), city_colours(cities), strict=True)
    return [Share(c, share_text(share), 100 * share, colour) for c, share, colour in parts if share]


@dataclass(frozen=True)
class Lineage:
    """The shares of an individual's cities, its operator and its parents."""

    shown: ShownBirths
    birth: Birth

    @cached_property
    def _fabric(self):
        return self.shown.run.header.chromosome.fabric(self.birth.genome)

    @property
    def shares(self) -> list[Share]:
        """The shares of the map; empty for forms without stones of cities."""
        if self._fabric is None:
            return []
        return shares_of(self.shown.run.header.cities, self._fabric.shares)

    @property
    def built(self) -> list[Share]:
        """As `shares`, only of what is built."""
        if self._fabric is None:
            return []
        built = built_shares(self._fabric, self.shown.city(self.birth))
        return shares_of(self.shown.run.header.cities, built)

    @property
    def parents(self) -> list[tuple[int, bool]]:
        """Ids of the parents, and whether each has a card on the page."""
        return [(parent, parent in self.shown.carded) for parent in self.birth.parents]

    @property
    def made(self) -> str:
        return json.dumps(dict(self.birth.made), ensure_ascii=False, default=str)

    @property
    def born(self) -> str:
        """Generation and operator of its birth."""
        operator = self.birth.operator.replace("_", " ")
        return f"born in generation {self.birth.generation}, {operator}"


@dataclass(frozen=True)
class Card:
    """An individual of a gallery. ``place``: its number there."""

    shown: ShownBirths
    entry: Shown
    place: int
    picture: str

    @property
    def rows(self) -> list[Row]:
        return rows_of(self.shown.births, self.entry.birth.values)

    @property
    def breaks(self) -> bool:
        return self.entry.birth.id in self.shown.broken

    @property
    def alike(self) -> bool:
        """Whether it looks like one before it."""
        return self.entry.birth.id in self.shown.look_alikes

    @property
    def keys(self) -> list[float | None]:
        """The rising keys of each of `Galleries.orders`; None for no value."""
        birth, births, keys = self.entry.birth, self.shown.births, []
        for aim in births.sought:
            keys.append(aim.loss(birth.values.get(aim.name, math.nan)))
        for name in _without_goal(births):
            value = birth.values.get(name, math.nan)
            keys += [-value, value]
        return [self.place, -birth.id, *map(_finite, keys)]

    @property
    def values(self) -> list[float | None]:
        """Its value of each of `Galleries.measures`; None for no value."""
        values = self.entry.birth.values
        return [_finite(values.get(aim.name, math.nan)) for aim in self.shown.births.logged]

    @property
    def lineage(self) -> Lineage:
        return Lineage(self.shown, self.entry.birth)


@dataclass(frozen=True)
class Galleries:
    """The cards of the last generation, and of the archive's individuals that are not alive."""

    shown: ShownBirths
    pictures: Pictures

    @cached_property
    def living(self) -> list[Card]:
        return self._cards(self.shown.shown)

    @cached_property
    def gone(self) -> list[Card]:
        """Cards of the archive's individuals that are not alive."""
        return self._cards(self.shown.shown_gone)

    def _cards(self, shown: Sequence[Shown]) -> list[Card]:
        return [
            Card(self.shown, one, place, self.pictures.of(one.birth.id, one.city))
            for place, one in enumerate(shown)
        ]

    @property
    def orders(self) -> list[str]:
        """Names of the orders of cards, see `Card.keys`."""
        births, ends = self.shown.births, ("highest", "lowest")
        goals = [f"{aim.name}, best first" for aim in births.sought]
        others = [f"{name}, {first} first" for name in _without_goal(births) for first in ends]
        return ["as the search ranks them", "youngest first", *goals, *others]

    @property
    def measures(self) -> list[str]:
        """Names, with units, of the measures by which cards can be filtered, see `Card.values`."""
        return [aim.title for aim in self.shown.births.logged]


def _without_goal(births: Births) -> list[str]:
    """Measures that only have bounds, or are only recorded."""
    return [aim.name for aim in births.logged if aim not in births.sought]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def rows_of(births: Births, values: Mapping[str, float]) -> list[Row]:
    """Return a row of each measure that the run logged, those with a goal first."""
    return [
        Row(aim.name, number(values.get(aim.name), aim.unit), aim.wanted) for aim in births.logged
    ]


@dataclass(frozen=True)
class Parent:
    """A source city; ``rows`` are the measures of its own code."""

    name: str
    credit: str
    colour: str
    picture: str
    width: int
    rows: list[Row]


def parents(shown: ShownBirths, pictures: Pictures) -> list[Parent]:
    first = {birth.id: birth.values for birth in shown.source_births}
    colours = city_colours([source.name for source in shown.sources])
    return [
        Parent(
            source.name,
            source.city.attribution,
            colour,
            pictures.of(f"parent {index}", source.city),
            source.city.shape[1],
            rows_of(shown.births, first[index]) if index in first else [],
        )
        for index, (source, colour) in enumerate(zip(shown.sources, colours, strict=True))
    ]


def city_key(cities: Sequence[str]) -> list[tuple[str, str]]:
    """Return the colour and the name of each city, as a key of the bars of lineage."""
    return list(zip(city_colours(cities), _labels(cities), strict=True))


def _labels(cities: Sequence[str]) -> list[str]:
    return [_OPEN_GROUND if city == VOID else city for city in cities]
