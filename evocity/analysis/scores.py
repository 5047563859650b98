"""Scores by measures that a run did not log, computed in workers and cached.

Worker processes measure with a deadline. The cache lies in the user's folder, never in the run. Its
keys are the genome, the measure's source, its reference cities, and the release of evocity.
"""

import contextlib
import hashlib
import json
import math
import os
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evocity import __version__, fitness
from evocity.analysis.births import NEVER_BRED
from evocity.coding.matching import available_cores
from evocity.errors import FitnessError, check_number, keyword, spell
from evocity.evaluation import Here, Workers, kernel_warmup
from evocity.evaluation.compilation import compile_once
from evocity.evaluation.evaluator import UNRECORDED, Setup
from evocity.files import whole_file
from evocity.fitness import Measure, Reference
from evocity.fitness.measure import Family
from evocity.fitness.part import own_name
from evocity.fitness.registry import file_of
from evocity.fitness.source_transfer import shipped
from evocity.genome import Genome
from evocity.pavement.levels import USUAL
from evocity.store import Birth, RunLog, hash_of_map

# Births that are read at a time.
_AT_A_TIME = 256


def measures_of(given: object) -> list[Measure]:
    """Return the measures that ``given`` names: names, files NAME.py or NAME.toml, and measures."""
    many = given if isinstance(given, list | tuple) else [given]
    chosen: dict[str, Measure] = {}
    for one in many:
        if isinstance(one, Measure):
            several = [one]
        elif isinstance(one, Family):
            several = list(one.measures)
        elif isinstance(one, str | os.PathLike):
            name = os.fspath(one)
            own = name.endswith((".py", ".toml"))
            several = fitness.load_file(name) if own else fitness.named(name)
        else:
            raise FitnessError(
                f"{spell(one)} is not a measure",
                "the name of a measure, a Python file with a measure, or a measure object",
                'give one of these, for example "compactness"',
            )
        chosen |= {measure.name: measure for measure in several}
    if not chosen:
        raise FitnessError(
            "no measure is given",
            "at least one measure",
            'give a measure, for example "compactness"',
        )
    return list(chosen.values())


def score_births(
    run: RunLog,
    ids: np.ndarray,
    measures: Sequence[Measure],
    workers: int | None = None,
    timeout: float = 60.0,
) -> tuple[np.ndarray, list[str | None]]:
    """Return scores, float64 ``(n, measures)``, of the births ``ids``, and reasons for NaN.
    ``workers``: 0 for this process, without a deadline. ``timeout``: seconds for one birth."""
    workers = _checked(workers, timeout)
    sources = [source.city for source in run.sources()]
    cached = {one.name: _CachedMeasure.of(one, sources) for one in measures}
    scores = np.full((len(ids), len(measures)), np.nan)
    reasons: list[str | None] = [None] * len(ids)
    jobs: list[tuple[int, Genome, tuple[Genome, ...]]] = []
    keys: dict[int, dict[str, str]] = {}
    for start in range(0, len(ids), _AT_A_TIME):
        births = run.individuals(ids[start : start + _AT_A_TIME].tolist())
        for place, (birth, parents) in enumerate(_with_parents(run, births, measures), start):
            if birth.genome is None:
                reasons[place] = NEVER_BRED
                continue
            keys[place] = {name: one.key(birth.genome, parents) for name, one in cached.items()}
            known = [one.known(keys[place][name]) for name, one in cached.items()]
            scores[place] = known
            if np.isnan(known).any():
                jobs.append((place, birth.genome, parents))
    if not jobs:
        return scores, reasons
    setup = _setup(run, measures, cached, sources)
    compile_once(setup.sides, setup.parts, lambda text: None)
    count = min(workers, len(jobs))
    # workers run the script again only where its own measures may need that
    main = bool(setup.shipped)
    engine = Workers(setup, count, timeout, main=main) if count else Here(setup)
    with closing(engine):
        outcomes = engine.run("evaluate", [job[1:] for job in jobs])
    for (place, *_), outcome in zip(jobs, outcomes, strict=True):
        pairs = zip(cached, scores[place].tolist(), strict=True)
        scores[place] = [outcome.values.get(name, known) for name, known in pairs]
        for name, value in outcome.values.items():
            cached[name].keep(keys[place][name], value)
        if outcome.error:
            reasons[place] = outcome.error.removeprefix(UNRECORDED)
    for one in cached.values():
        one.write()
    return scores, reasons


def _checked(workers: object, timeout: object) -> int:
    if workers is not None:
        expected = "a whole number of processes, 0 or more"
        remedy = f"leave {keyword('workers')} out to use one process per core"
        check_number("workers", workers, 0, math.inf, expected, remedy=remedy, whole=True)
    expected, remedy = (
        "a number of seconds above 0",
        "leave timeout out to allow one minute per birth",
    )
    check_number("timeout", timeout, math.ulp(0), math.inf, expected, remedy=remedy)
    return available_cores() if workers is None else workers


def _with_parents(run: RunLog, births: Sequence[Birth], measures: Sequence[Measure]):
    """Each of ``births`` with its parents' genomes, where a measure takes them."""
    taken = any("parents" in one.takes for one in measures)
    bred = [one for one in births if one.genome is not None]
    parents = run.parents(bred) if taken else [()] * len(bred)
    of = dict(zip((one.id for one in bred), parents, strict=True))
    return [(one, of.get(one.id, ())) for one in births]


def _setup(run: RunLog, measures, cached: dict[str, "_CachedMeasure"], sources) -> Setup:
    fabric = run.header.chromosome.fabric(run.sources()[0].genome)
    sides = USUAL if fabric is None else fabric.pavement.ends
    own = [one for one in measures if one.origin != "evocity"]
    parts = [kernel_warmup.DECODE, *(f"measure:{one.name}" for one in measures if one not in own)]
    return Setup(
        replace(run.header, measures=(), recorded=tuple(cached)),
        tuple((one.name, file_of(own_name(one.name))) for one in measures),
        run.condensation,
        shipped(measures),
        sides,
        tuple([*parts, kernel_warmup.VIEWS] if own else parts),
        {name: one.reference for name, one in cached.items() if one.reference is not None},
        tuple(sources) if any("sources" in one.takes for one in measures) else (),
    )


# -- the cache --------------------------------------------------------------------------------


def cache_folder() -> Path | None:
    """Return the folder of this user's cached scores; None where there is no such place."""
    named = os.environ.get("XDG_CACHE_HOME")
    if named and os.path.isabs(named):
        return Path(named) / "evocity" / "scores"
    with contextlib.suppress(RuntimeError):  # a user without a home
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
            return Path(local) / "evocity" / "cache" / "scores"
        place = "Library/Caches" if sys.platform == "darwin" else ".cache"
        return Path.home() / place / "evocity" / "scores"
    return None


@dataclass
class _CachedMeasure:
    """A measure, its reference cities, and its known values by the key of a birth."""

    measure: Measure
    reference: Reference | None
    file: Path | None
    values: dict[str, float]
    new: bool = False

    @classmethod
    def of(cls, measure: Measure, sources) -> "_CachedMeasure":
        takes = "reference" in measure.takes
        reference = (measure.reference or Reference.sources(sources)) if takes else None
        folder = cache_folder()
        if folder is None or measure.origin == "this session":  # its code may change any time
            return cls(measure, reference, None, {})
        cities = [] if reference is None else list(reference.cities)
        cities += sources if "sources" in measure.takes else []
        parts = [__version__, measure.name, measure.source_hash, *map(hash_of_map, cities)]
        parts += [] if reference is None else [str(reference.weights), *(c.name for c in cities)]
        file = folder / f"{_digest(parts)}.json"
        return cls(measure, reference, file, _read(file))

    def key(self, genome: Genome, parents: Sequence[Genome]) -> str:
        """The key of a birth: all that a value of it depends on."""
        takes = self.measure.takes
        whose = {"genome", "reference"} & set(takes)
        parts = [genome.digest, *([_stones(_fabric(genome))] if whose else [])]
        if "parents" in takes:
            parts += [part for one in parents for part in (one.digest, _stones(_fabric(one)))]
        return parts[0] if len(parts) == 1 else _digest(parts)

    def known(self, key: str) -> float:
        return self.values.get(key, math.nan)

    def keep(self, key: str, value: float) -> None:
        self.values[key] = value
        self.new = True

    def write(self) -> None:
        """Write new values to the cache; a fault only costs time later."""
        if self.file is None or not self.new:
            return
        with contextlib.suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(_read(self.file) | self.values)  # another process may have written
            with whole_file(self.file) as temporary:
                temporary.write_text(text, encoding="utf-8")


def _read(file: Path) -> dict[str, float]:
    """The values in a ``file``, as far as they are values."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    pairs = content.items() if isinstance(content, dict) else ()
    return {k: v for k, v in pairs if isinstance(v, float) and math.isfinite(v)}


def _fabric(genome) -> Genome | None:
    return genome if isinstance(genome, Genome) else getattr(genome, "fabric", None)


def _stones(genome: Genome | None) -> str:
    """A digest of the stones of a genome, which its own digest leaves out; "" without stones."""
    if genome is None:
        return ""
    arrays = (genome.parent, genome.source, genome.turn, genome.other, genome.part)
    parts = [hashlib.blake2b(np.ascontiguousarray(one).tobytes()).hexdigest() for one in arrays]
    return _digest([*parts, *genome.cities])


def _digest(parts: Sequence[str]) -> str:
    return hashlib.blake2b(json.dumps(parts).encode(), digest_size=16).hexdigest()
