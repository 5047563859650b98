"""The start of a run: source cities with maps and genomes, reference cities, parts of the map,
locked heights, and files of the user's own measures. Nothing here executes them."""

import json
import math
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from pydantic import BaseModel, ConfigDict

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.genome import Genome, RoofTable
from evocity.kinds import Kind
from evocity.store.run_directory import RunDirectory

#: The folder of the user's own measures in a run.
MEASURES_FOLDER = "fitness"
#: The folder of the source cities, and the file of locked heights.
SOURCES, LOCKED = "sources", "sources/locked.npy"
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

    @property
    def roofs(self) -> RoofTable | None:
        """The roofs that the source gives, of the genome or, without them, of the map."""
        from evocity.coding.source_roofs import roofs_of_map  # slow to load

        own = getattr(self.genome, "roofs", {}).get(self.name)
        return roofs_of_map(self.city) if own is None else own

    @property
    def stored_genome(self) -> Genome:
        """The genome for the run's folder: without roofs that follow from the stored map."""
        from evocity.coding.source_roofs import roofs_of_map

        roofs = getattr(self.genome, "roofs", {})
        plain = self.city.replace(self.city.heights, roof_shapes=None)
        if not roofs or roofs.get(self.name) != roofs_of_map(plain):
            return self.genome
        return self.genome.replace(roofs={})


class _About(BaseModel):
    """The description of a map's heights; `CityMap` checks the numbers."""

    model_config = ConfigDict(strict=True, extra="forbid")

    name: str
    metres_per_pixel: float
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None
    height_rules: dict[str, int]


def write_sources(directory: RunDirectory, sources: Sequence[Source]) -> None:
    """Write the maps, see `write_maps`, and the genome of each source (Parquet)."""
    directory.make_folder(SOURCES, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:  # writers of genomes take a path
        for index, source in enumerate(sources):
            name = f"{_stem(index, source.city)}.genome.parquet"
            source.stored_genome.write(Path(folder, name))
            directory.write_bytes(f"{SOURCES}/{name}", Path(folder, name).read_bytes())
    write_maps(directory, SOURCES, [source.city for source in sources])


def write_maps(directory: RunDirectory, folder: str, cities: Sequence[CityMap]) -> None:
    """Write two files per city into a ``folder``: heights (NPY) and their description (JSON)."""
    directory.make_folder(folder, exist_ok=True)
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
        with directory.write(f"{folder}/{stem}.npy") as file:
            np.save(file, city.heights, allow_pickle=False)
        text = json.dumps(about, indent=1, ensure_ascii=False)
        directory.write_bytes(f"{folder}/{stem}.json", text.encode())


def _stem(index: int, city: CityMap) -> str:
    return f"{index:02d}-{re.sub(r'[^A-Za-z0-9_-]+', '-', city.name)[:80]}"


def read_sources(directory: RunDirectory, folder: str, kind: Kind) -> list[Source]:
    """Return the sources of a run of this ``kind``. Raises the errors of damaged files: OSError,
    ValueError, MemoryError, EvocityError."""
    sources = []
    for stem, city in _described(directory, folder):
        genome = f"{stem}.genome.parquet"
        directory.check_file(genome)
        sources.append(Source(city, kind.read(directory.root / genome)))
    return sources


def read_maps(directory: RunDirectory, folder: str) -> list[CityMap]:
    """Return the maps of `write_maps`. Raises as `read_sources`."""
    return [city for _, city in _described(directory, folder)]


def _described(directory: RunDirectory, folder: str) -> list[tuple[str, CityMap]]:
    cities = {}
    for name in directory.entries(folder):
        if match := _DESCRIBED.fullmatch(name):
            stem = f"{folder}/{name.removesuffix('.json')}"
            about = _About.model_validate_json(directory.read(f"{stem}.json"))
            heights = _array(directory, f"{stem}.npy")
            cities[int(match[1])] = stem, CityMap(heights, **about.model_dump())
    return [cities[number] for number in sorted(cities)]


def write_masks(directory: RunDirectory, folder: str, masks: Sequence[np.ndarray]) -> None:
    """Write an NPY file per mask into a ``folder``: bool ``(H, W)``."""
    directory.make_folder(folder, exist_ok=True)
    for index, mask in enumerate(masks):
        with directory.write(f"{folder}/{index:02d}.npy") as file:
            np.save(file, np.asarray(mask, bool), allow_pickle=False)


def read_masks(directory: RunDirectory, folder: str, shape: tuple[int, int]) -> list[np.ndarray]:
    """Return the masks of `write_masks`, of this ``shape``. Raises as `read_sources`."""
    masks = {}
    for name in directory.entries(folder):
        if match := _MASK.fullmatch(name):
            mask = _array(directory, f"{folder}/{name}")
            if mask.shape != shape or mask.dtype != bool:
                raise ValueError(f"{mask.dtype} of shape {mask.shape}")
            masks[int(match[1])] = mask
    return [masks[number] for number in sorted(masks)]


def write_condensation(directory: RunDirectory, condensation: Condensation) -> None:
    """Write one NPY file: float32 ``(H, W)``, metres, NaN where nothing is locked."""
    with directory.write(LOCKED) as file:
        np.save(file, condensation.raster, allow_pickle=False)


def read_condensation(directory: RunDirectory, digest: str) -> Condensation:
    """Return the layer with this ``digest``. Raises as `read_sources`, and for another layer."""
    raster = _array(directory, LOCKED)
    if raster.ndim != 2 or raster.dtype != np.float32:
        raise ValueError(f"{raster.dtype} of shape {raster.shape}")
    condensation = Condensation.from_raster(raster)
    if condensation.digest != digest:
        raise ValueError("another layer than the one the run began with")
    return condensation


def _array(directory: RunDirectory, part: str) -> np.ndarray:
    """The array in an NPY file that is as long as its header says, which may say terabytes."""
    with directory.open(part) as file:
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


def write_measures(directory: RunDirectory, files: Mapping[str, bytes]) -> None:
    """Write each of ``files``, place within the run folder -> content."""
    for place, content in files.items():
        part = _within(directory.root, place)
        directory.make_folder(str(part.parent), exist_ok=True)
        directory.write_bytes(str(part), content)


def measure_file(root: Path, place: str) -> Path:
    """Return the file at a ``place`` such as "fitness/my_measure.py" of the run folder ``root``.
    Raises FileNotFoundError if it is missing; `RunError` for a link, or a place outside."""
    part = _within(root, place)
    RunDirectory(root).check_file(str(part))
    return root / part


def _within(root: Path, place: str) -> PurePosixPath:
    parts = PurePosixPath(place).parts if isinstance(place, str) else ()
    if len(parts) < 2 or parts[0] != MEASURES_FOLDER or ".." in parts or "\\" in place:
        raise RunError(
            f"{root}: provenance.json names {place!r} as the source of a measure",
            f"a file in the folder {MEASURES_FOLDER}/ of the run",
            "restore provenance.json from a backup",
        )
    return PurePosixPath(*parts)
