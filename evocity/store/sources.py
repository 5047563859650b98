"""What a run started from: the source cities, their maps and genomes, the maps of other cities that
measures compare with, and what is locked."""

import json
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.files import whole_file
from evocity.genome import Genome
from evocity.kinds import Kind
from evocity.store.parts import open_to_read, plain_file, plain_folder, read_bytes

_MASK = re.compile(r"(\d{2,3})\.npy", re.ASCII)
_DESCRIBED = re.compile(r"(\d{2,3})-[A-Za-z0-9_-]*\.json", re.ASCII)


@dataclass(frozen=True)
class Source:
    """A source city: its map as read, and the genome it was encoded to."""

    city: CityMap
    genome: Genome

    @property
    def name(self) -> str:
        return self.city.name


class _About(BaseModel):
    """What describes a map's heights; `CityMap` checks the numbers."""

    model_config = ConfigDict(strict=True, extra="forbid")

    name: str
    metres_per_pixel: float
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None
    height_rules: dict[str, int]


def write_sources(folder: Path, sources: Sequence[Source]) -> None:
    """Those of `write_maps`, and the genome of each source (Parquet)."""
    for index, source in enumerate(sources):
        source.genome.write(folder / f"{_stem(index, source.city)}.genome.parquet")
    write_maps(folder, [source.city for source in sources])


def write_maps(folder: Path, cities: Sequence[CityMap]) -> None:
    """Two files a city: heights (NPY), what describes them (JSON)."""
    for index, city in enumerate(cities):
        stem = _stem(index, city)
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
        with whole_file(folder / f"{stem}.json") as temporary:
            temporary.write_text(json.dumps(about, indent=1, ensure_ascii=False), encoding="utf-8")


def _stem(index: int, city: CityMap) -> str:
    return f"{index:02d}-{re.sub(r'[^A-Za-z0-9_-]+', '-', city.name)[:80]}"


def read_sources(folder: Path, kind: Kind) -> list[Source]:
    """The sources of a run of this ``kind``. Raises what reading damaged files raises:
    OSError, ValueError, MemoryError, EvocityError."""
    return [
        Source(city, kind.read(plain_file(path.with_suffix(".genome.parquet"))))
        for path, city in _described(folder)
    ]


def read_maps(folder: Path) -> list[CityMap]:
    """What `write_maps` wrote. Raises as `read_sources`."""
    return [city for _, city in _described(folder)]


def _described(folder: Path) -> list[tuple[Path, CityMap]]:
    """The cities of a folder in their order, each with the file that describes it."""
    found = {}
    for path in plain_folder(folder).iterdir():
        if match := _DESCRIBED.fullmatch(path.name):
            about = _About.model_validate_json(read_bytes(path))
            heights = _array(path.with_suffix(".npy"))
            found[int(match[1])] = path, CityMap(heights, **about.model_dump())
    return [found[number] for number in sorted(found)]


def write_masks(folder: Path, masks: Sequence[np.ndarray]) -> None:
    """An NPY file a mask: bool ``(H, W)``."""
    for index, mask in enumerate(masks):
        with whole_file(folder / f"{index:02d}.npy") as temporary:
            np.save(temporary, np.asarray(mask, bool), allow_pickle=False)


def read_masks(folder: Path) -> list[np.ndarray]:
    """What `write_masks` wrote. Raises as `read_sources`."""
    found = {}
    for path in plain_folder(folder).iterdir():
        if match := _MASK.fullmatch(path.name):
            mask = _array(path)
            if mask.ndim != 2 or mask.dtype != bool:
                raise ValueError(f"{mask.dtype} of shape {mask.shape}")
            found[int(match[1])] = mask
    return [found[number] for number in sorted(found)]


def write_condensation(path: Path, condensation: Condensation) -> None:
    """One NPY file: float32 ``(H, W)``, metres, NaN where nothing is locked."""
    with whole_file(path) as temporary:
        np.save(temporary, condensation.raster, allow_pickle=False)


def read_condensation(path: Path, digest: str) -> Condensation:
    """The layer of this ``digest``. Raises as `read_sources`; ValueError if it is another."""
    raster = _array(path)
    if raster.ndim != 2 or raster.dtype != np.float32:
        raise ValueError(f"{raster.dtype} of shape {raster.shape}")
    condensation = Condensation.from_raster(raster)
    if condensation.digest != digest:
        raise ValueError("another layer than the one the run began with")
    return condensation


def _array(path: Path) -> np.ndarray:
    """The array in an NPY file, once the file is as long as its header says: that may tell of
    terabytes."""
    with open_to_read(path) as file:
        major, minor = np.lib.format.read_magic(file)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        if major not in read:
            raise ValueError(f"NPY of version {major}.{minor}")
        try:
            shape, _, kind = read[major](file)
        except Exception as error:  # a damaged header raises whatever Python's parser does
            raise ValueError(f"no header of NPY: {str(error)[:80]}") from error
        told = math.prod(shape) * kind.itemsize
        there = os.fstat(file.fileno()).st_size - file.tell()
        if kind.hasobject or told != there:
            raise ValueError(f"{there} bytes for {kind} of shape {shape}")
        file.seek(0)
        return np.load(file, allow_pickle=False)
