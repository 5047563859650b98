"""What the cards of the galleries show: picture, measures, lineage; how they can be ordered."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.analysis.fabrics import built_shares, told_share
from evocity.genome import VOID
from evocity.pages import number
from evocity.pictures import city_colours
from evocity.report.facts import Facts, Shown
from evocity.report.pictures import Pictures
from evocity.store import Birth

#: What the void among the cities is.
_VOID = "bare ground, laid where buildings were left out"


@dataclass(frozen=True)
class Row:
    """A measure, what one has of it, and what was wanted."""

    name: str
    told: str
    wanted: str


def told_shares(cities: Sequence[str], shares: np.ndarray) -> list[tuple[str, str, float, str]]:
    """(city, share in words, share in percent, colour) of each that has one."""
    told = zip(cities, shares.tolist(), city_colours(cities), strict=True)
    return [
        (city, told_share(share), 100 * share, colour) for city, share, colour in told if share > 0
    ]


@dataclass(frozen=True)
class Lineage:
    """Whose stones an individual is made of, and of whom it was bred. ``shares``: `told_shares`;
    ``parents``: (number, whether it has a card)."""

    facts: Facts
    birth: Birth

    @property
    def shares(self) -> list[tuple[str, str, float, str]]:
        cities = self.facts.run.header.cities
        fabric = self.facts.run.header.chromosome.fabric(self.birth.genome)
        if fabric is None:
            return []
        return told_shares(cities, fabric.shares)

    @property
    def built(self) -> list[tuple[str, str, float, str]]:
        """As `shares`, of what is built alone."""
        header = self.facts.run.header
        fabric = header.chromosome.fabric(self.birth.genome)
        if fabric is None:
            return []
        return told_shares(header.cities, built_shares(fabric, self.facts.city(self.birth)))

    @property
    def parents(self) -> list[tuple[int, bool]]:
        return [(parent, parent in self.facts.carded) for parent in self.birth.parents]

    @property
    def made(self) -> str:
        """What its operator recorded."""
        return json.dumps(dict(self.birth.made), ensure_ascii=False, default=str)

    @property
    def born(self) -> str:
        operator = self.birth.operator.replace("_", " ")
        return f"born in generation {self.birth.generation}, {operator}"


@dataclass(frozen=True)
class Card:
    """An individual as a gallery shows it. ``keys``, of each of the orders what the card is sorted
    by, upwards; ``values``, of each measure what it has; None where there is none."""

    facts: Facts
    one: Shown
    place: int
    picture: str

    @property
    def rows(self) -> list[Row]:
        return rows_of(self.facts, self.one.birth.values)

    @property
    def breaks(self) -> bool:
        return self.one.birth.id in self.facts.broken

    @property
    def alike(self) -> bool:
        return self.one.birth.id in self.facts.look_alikes

    @property
    def keys(self) -> list[float | None]:
        birth, keys = self.one.birth, []
        for aim in self.facts.told.aims:
            keys += [aim.loss(birth.values.get(aim.name, math.nan))] if aim.sought else []
        for name in _unsought(self.facts):
            value = birth.values.get(name, math.nan)
            keys += [-value, value]
        return [self.place, -birth.id, *map(_finite, keys)]

    @property
    def values(self) -> list[float | None]:
        values = self.one.birth.values
        return [_finite(values.get(name, math.nan)) for name in measures_of(self.facts)]

    @property
    def lineage(self) -> Lineage:
        return Lineage(self.facts, self.one.birth)


@dataclass(frozen=True)
class Galleries:
    """The cards of the last generation, and of those of the archive that no longer live."""

    facts: Facts
    pictures: Pictures

    @cached_property
    def living(self) -> list[Card]:
        return self._cards(self.facts.shown)

    @cached_property
    def gone(self) -> list[Card]:
        return self._cards(self.facts.shown_gone)

    def _cards(self, shown: Sequence[Shown]) -> list[Card]:
        return [
            Card(self.facts, one, place, self.pictures.of(one.birth.id, one.city))
            for place, one in enumerate(shown)
        ]

    @property
    def orders(self) -> list[str]:
        """What the cards can be sorted by, see `Card.keys`."""
        sought = [f"{aim.name}, best first" for aim in self.facts.sought]
        others = (
            f"{name}, {first} first"
            for name in _unsought(self.facts)
            for first in ("highest", "lowest")
        )
        return ["as the search ranks them", "youngest first", *sought, *others]

    @property
    def measures(self) -> list[str]:
        """What the cards can be filtered by, see `Card.values`: names with units."""
        every = self.facts.told.logged
        return [aim.name + (f", {aim.unit}" if aim.unit else "") for aim in every]


def measures_of(facts: Facts) -> list[str]:
    return [aim.name for aim in facts.told.logged]


def _unsought(facts: Facts) -> list[str]:
    """Measures that are constraints alone, or recorded."""
    sought = {aim.name for aim in facts.sought}
    return [name for name in measures_of(facts) if name not in sought]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def rows_of(facts: Facts, values: Mapping[str, float]) -> list[Row]:
    """All that the run logged, the wanted first."""
    return [
        Row(aim.name, number(values.get(aim.name), aim.unit), aim.wanted)
        for aim in facts.told.logged
    ]


@dataclass(frozen=True)
class Parent:
    """A source city; its measures are those of its code, as far as the first population has
    them."""

    name: str
    credit: str
    colour: str
    picture: str
    width: int
    rows: list[Row]


def parents(facts: Facts, pictures: Pictures) -> list[Parent]:
    """The source cities."""
    first = {birth.id: birth.values for birth in facts.source_births}
    colours = city_colours([source.name for source in facts.sources])
    return [
        Parent(
            source.name,
            source.city.attribution,
            colour,
            pictures.of(f"parent {index}", source.city),
            source.city.shape[1],
            rows_of(facts, first[index]) if index in first else [],
        )
        for index, (source, colour) in enumerate(zip(facts.sources, colours, strict=True))
    ]


def city_key(cities: Sequence[str]) -> list[tuple[str, str]]:
    """(colour, which city it is) of the bars of lineage."""
    told = (f"{city}: {_VOID}" if city == VOID else city for city in cities)
    return list(zip(city_colours(cities), told, strict=True))


__all__ = ["Card", "Galleries", "Lineage", "Parent", "Row", "city_key", "parents", "rows_of"]
