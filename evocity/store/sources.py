"""The source cities of a run: their maps and genomes, as the run started from them."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evocity.citymap import CityMap
from evocity.files import whole_file
from evocity.genome import Genome, read_genome


@dataclass(frozen=True)
class Source:
    """A source city: its map as read, and the genome it was encoded to."""

    city: CityMap
    genome: Genome

    @property
    def name(self) -> str:
        return self.city.name


def write_sources(folder: Path, sources: list[Source]) -> None:
    """Three files a source: heights (NPY), what describes them (JSON), genome (Parquet)."""
    for index, source in enumerate(sources):
        city = source.city
        stem = f"{index:02d}-{re.sub(r'[^A-Za-z0-9_-]+', '-', city.name)[:80]}"
        about = {
            "name": city.name,
            "metres_per_pixel": city.metres_per_pixel,
            "attribution": city.attribution,
            "origin": city.origin,
            "crs": city.crs,
            "height_rules": city.height_rules,
        }
        with whole_file(folder / f"{stem}.npy") as temporary:
            np.save(temporary, city.heights, allow_pickle=False)
        source.genome.write(folder / f"{stem}.genome.parquet")
        with whole_file(folder / f"{stem}.json") as temporary:
            temporary.write_text(json.dumps(about, indent=1, ensure_ascii=False), encoding="utf-8")


def read_sources(folder: Path) -> list[Source]:
    """Raises what reading damaged files raises: OSError, ValueError, KeyError, EvocityError."""
    sources = []
    for described in sorted(folder.glob("[0-9][0-9]-*.json")):
        about = json.loads(described.read_text(encoding="utf-8"))
        heights = np.load(described.with_suffix(".npy"), allow_pickle=False)
        genome = read_genome(described.with_suffix(".genome.parquet"))
        sources.append(Source(CityMap(heights, about.pop("metres_per_pixel"), **about), genome))
    return sources
