"""The start of a run: source cities with maps and genomes, reference cities, parts of the map,
locked heights, and files of the user's own measures. Nothing here executes them."""

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from pydantic import BaseModel, ConfigDict

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.files import whole_file
from evocity.genome import Genome
from evocity.kinds import Kind
from evocity.store.safe_open import open_to_read, plain_file, plain_folder, read_bytes

#: The folder of the user's own measures in a run.
MEASURES_FOLDER = "fitness"
_MASK = re.compile(r"(\d{2,3})\.npy", re.ASCII)
_DESCRIBED = re.compile(r"(\d{2,3})-[A-Za-z0-9_-]*\.json", re.ASCII)


@dataclass(frozen=True)
class Source:
    """A source city: its map as read, and its genome."""

    city: CityMap
    genome: Genome

    @property
    def name(self) -> str:
        return self.city.name


class _About(BaseModel):
    """The description of a map's heights; `CityMap` checks the numbers."""

    model_config = ConfigDict(strict=True, extra="forbid")

    name: str
    metres_per_pixel: float
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None
    height_rules: dict[str, int]


def write_sources(folder: Path, sources: Sequence[Source]) -> None:
    """Write the maps, see `write_maps`, and the genome of each source (Parquet)."""
    for index, source in enumerate(sources):
        source.genome.write(folder / f"{_stem(index, source.city)}.genome.parquet")
    write_maps(folder, [source.city for source in sources])


def write_maps(folder: Path, cities: Sequence[CityMap]) -> None:
    """Write two files per city: heights (NPY) and their description (JSON)."""
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
    """Return the sources of a run of this ``kind``. Raises the errors of damaged files: OSError,
    ValueError, MemoryError, EvocityError."""
    return [
        Source(city, kind.read(plain_file(path.with_suffix(".genome.parquet"))))
        for path, city in _described(folder)
    ]


def read_maps(folder: Path) -> list[CityMap]:
    """Return the maps of `write_maps`. Raises as `read_sources`."""
    return [city for _, city in _described(folder)]


def _described(folder: Path) -> list[tuple[Path, CityMap]]:
    """The cities of a folder in order, each with its description."""
    cities = {}
    for path in plain_folder(folder).iterdir():
        if match := _DESCRIBED.fullmatch(path.name):
            about = _About.model_validate_json(read_bytes(path))
            heights = _array(path.with_suffix(".npy"))
            cities[int(match[1])] = path, CityMap(heights, **about.model_dump())
    return [cities[number] for number in sorted(cities)]


def write_masks(folder: Path, masks: Sequence[np.ndarray]) -> None:
    """Write an NPY file per mask: bool ``(H, W)``."""
    for index, mask in enumerate(masks):
        with whole_file(folder / f"{index:02d}.npy") as temporary:
            np.save(temporary, np.asarray(mask, bool), allow_pickle=False)


def read_masks(folder: Path) -> list[np.ndarray]:
    """Return the masks of `write_masks`. Raises as `read_sources`."""
    masks = {}
    for path in plain_folder(folder).iterdir():
        if match := _MASK.fullmatch(path.name):
            mask = _array(path)
            if mask.ndim != 2 or mask.dtype != bool:
                raise ValueError(f"{mask.dtype} of shape {mask.shape}")
            masks[int(match[1])] = mask
    return [masks[number] for number in sorted(masks)]


def write_condensation(path: Path, condensation: Condensation) -> None:
    """Write one NPY file: float32 ``(H, W)``, metres, NaN where nothing is locked."""
    with whole_file(path) as temporary:
        np.save(temporary, condensation.raster, allow_pickle=False)


def read_condensation(path: Path, digest: str) -> Condensation:
    """Return the layer with this ``digest``. Raises as `read_sources`, and for another layer."""
    raster = _array(path)
    if raster.ndim != 2 or raster.dtype != np.float32:
        raise ValueError(f"{raster.dtype} of shape {raster.shape}")
    condensation = Condensation.from_raster(raster)
    if condensation.digest != digest:
        raise ValueError("another layer than the one the run began with")
    return condensation


def _array(path: Path) -> np.ndarray:
    """The array in an NPY file that is as long as its header says, which may say terabytes."""
    with open_to_read(path) as file:
        major, minor = np.lib.format.read_magic(file)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
        if major not in read:
            raise ValueError(f"NPY of version {major}.{minor}")
        try:
            shape, _, kind = read[major](file)
        except Exception as error:  # a damaged header raises whatever Python's parser does
            raise ValueError(f"no header of NPY: {str(error)[:80]}") from error
        there = os.fstat(file.fileno()).st_size - file.tell()
        if kind.hasobject or math.prod(shape) * kind.itemsize != there:
            raise ValueError(f"{there} bytes for {kind} of shape {shape}")
        file.seek(0)
        return np.load(file, allow_pickle=False)


def write_measures(root: Path, files: Mapping[str, bytes]) -> None:
    """Write each of ``files``, place within the run folder ``root`` -> content."""
    for place, content in files.items():
        path = _within(root, place)
        path.parent.mkdir(parents=True, exist_ok=True)
        for folder in path.relative_to(root).parents:
            plain_folder(root / folder)
        with whole_file(path) as temporary:
            temporary.write_bytes(content)


def measure_file(root: Path, place: str) -> Path:
    """Return the file at a ``place`` such as "fitness/my_measure.py" of the run folder ``root``.

    Raises FileNotFoundError if it is missing; `RunError` for a place outside the folder of the
    user's own measures, or through a link.
    """
    path = _within(root, place)
    for folder in list(path.relative_to(root).parents)[-2::-1]:  # from the outermost inwards
        plain_folder(root / folder)
    return plain_file(path)


def _within(root: Path, place: str) -> Path:
    parts = PurePosixPath(place).parts if isinstance(place, str) else ()
    if len(parts) < 2 or parts[0] != MEASURES_FOLDER or ".." in parts or "\\" in place:
        raise RunError(
            f"{root}: provenance.json names {place!r} as the source of a measure",
            f"a file in {MEASURES_FOLDER}/ of the run folder",
            "bring provenance.json back from a copy",
        )
    return root.joinpath(*parts)
