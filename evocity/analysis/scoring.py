"""Measures that a run did not log, of births that it did; what was measured once is kept.

In worker processes, with a deadline each. What is kept lies in the user's cache, never in the run:
a value is found again by its genome, the measure's source, what that compares with, and the
release of evocity.
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
from evocity.coding.matching import available_cores
from evocity.errors import EvocityError, FitnessError, keyword, shown
from evocity.files import whole_file
from evocity.fitness import Measure, Reference
from evocity.fitness.measure import Family
from evocity.fitness.part import own_name
from evocity.fitness.registry import file_of
from evocity.fitness.shipping import shipped
from evocity.genome import Genome
from evocity.pavement.levels import USUAL
from evocity.search import warm
from evocity.search.compiling import compile_once
from evocity.search.evaluation import Here, Workers
from evocity.search.evaluator import UNRECORDED, Setup
from evocity.store import Birth, Run, hash_of_map

# Births that are read at a time.
_AT_A_TIME = 256


def measures_of(told: object) -> list[Measure]:
    """The measures that are ``told``: names, files NAME.py or NAME.toml, which are executed or
    read, and measures themselves; one or many. Raises `FitnessError` for an unknown one."""
    many = told if isinstance(told, list | tuple) else [told]
    found: dict[str, Measure] = {}
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
                f"a measure {shown(one)}", "a name, a file NAME.py, or a measure", "name one"
            )
        found |= {measure.name: measure for measure in several}
    if not found:
        raise FitnessError("no measure", "one at least", 'for example "compactness"')
    return list(found.values())


def scored(
    run: Run,
    ids: np.ndarray,
    measures: Sequence[Measure],
    workers: int | None = None,
    timeout: float = 60.0,
) -> tuple[np.ndarray, list[str | None]]:
    """Float64 ``(n, measures)`` of the births ``ids``, NaN where a measure has no value, and of
    each birth why, None where all have one. ``workers``: processes; 0 for this one, without a
    deadline; one a core unless it is told. ``timeout``: seconds, of all measures of one birth.

    Raises `EvocityError` for workers or a deadline that are none.
    """
    workers = _checked(workers, timeout)
    sources = [source.city for source in run.sources()]
    asked = {one.name: _Asked.of(one, sources) for one in measures}
    found = np.full((len(ids), len(measures)), np.nan)
    reasons: list[str | None] = [None] * len(ids)
    jobs: list[tuple[int, Genome, tuple[Genome, ...]]] = []
    keys: dict[int, dict[str, str]] = {}
    for start in range(0, len(ids), _AT_A_TIME):
        births = run.individuals(ids[start : start + _AT_A_TIME].tolist())
        for place, (birth, parents) in enumerate(_bred_from(run, births, measures), start):
            if birth.genome is None:
                reasons[place] = "it was never bred"
                continue
            keys[place] = {name: one.key(birth.genome, parents) for name, one in asked.items()}
            known = [one.known(keys[place][name]) for name, one in asked.items()]
            found[place] = known
            if np.isnan(known).any():
                jobs.append((place, birth.genome, parents))
    if not jobs:
        return found, reasons
    setup = _setup(run, measures, asked, sources)
    compile_once(setup.sides, setup.parts, lambda text: None)
    count = min(workers, len(jobs))
    # a script is run again in workers only where its own measures may need that
    main = bool(setup.shipped)
    engine = Workers(setup, count, timeout, main=main) if count else Here(setup)
    with closing(engine):
        outcomes = engine.run("evaluate", [job[1:] for job in jobs])
    for (place, *_), outcome in zip(jobs, outcomes, strict=True):
        pairs = zip(asked, found[place].tolist(), strict=True)
        found[place] = [outcome.values.get(name, known) for name, known in pairs]
        for name, value in outcome.values.items():
            asked[name].keep(keys[place][name], value)
        if outcome.error:
            reasons[place] = outcome.error.removeprefix(UNRECORDED)
    for one in asked.values():
        one.write()
    return found, reasons


def _checked(workers: object, timeout: object) -> int:
    whole = isinstance(workers, int) and not isinstance(workers, bool) and workers >= 0
    if workers is not None and not whole:
        raise EvocityError(
            f"workers = {shown(workers)}",
            "a whole number, 0 or more",
            f"leave {keyword('workers')} out for one a core",
        )
    number = isinstance(timeout, int | float) and not isinstance(timeout, bool)
    if not (number and 0 < timeout < math.inf):
        raise EvocityError(
            f"timeout = {shown(timeout)}", "seconds, more than 0", "leave it out for a minute"
        )
    return available_cores() if workers is None else workers


def _bred_from(run: Run, births: Sequence[Birth], measures: Sequence[Measure]):
    """Each of ``births`` with the genomes it was bred from, where a measure takes them."""
    taken = any("parents" in one.takes for one in measures)
    bred = [one for one in births if one.genome is not None]
    parents = run.parents(bred) if taken else [()] * len(bred)
    of = dict(zip((one.id for one in bred), parents, strict=True))
    return [(one, of.get(one.id, ())) for one in births]


def _setup(run: Run, measures, asked: dict[str, "_Asked"], sources) -> Setup:
    fabric = run.header.chromosome.fabric(run.sources()[0].genome)
    sides = USUAL if fabric is None else fabric.pavement.ends
    own = [one for one in measures if one.origin != "evocity"]
    parts = [warm.DECODE, *(f"measure:{one.name}" for one in measures if one not in own)]
    return Setup(
        replace(run.header, measures=(), recorded=tuple(asked)),
        tuple((one.name, file_of(own_name(one.name))) for one in measures),
        run.condensation,
        shipped(measures),
        sides,
        tuple([*parts, warm.VIEWS] if own else parts),
        {name: one.reference for name, one in asked.items() if one.reference is not None},
        tuple(sources) if any("sources" in one.takes for one in measures) else (),
    )


# -- what is kept -----------------------------------------------------------------------------


def cache_folder() -> Path | None:
    """Where values are kept for this user; None where there is no such place."""
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
class _Asked:
    """A measure, what it compares with, and what is known of it: key of a birth -> value."""

    measure: Measure
    reference: Reference | None
    file: Path | None
    values: dict[str, float]
    new: bool = False

    @classmethod
    def of(cls, measure: Measure, sources) -> "_Asked":
        takes = "reference" in measure.takes
        reference = (measure.reference or Reference.sources(sources)) if takes else None
        folder = cache_folder()
        if folder is None or measure.origin == "this session":  # what it uses may change any time
            return cls(measure, reference, None, {})
        cities = [] if reference is None else list(reference.cities)
        cities += sources if "sources" in measure.takes else []
        told = [__version__, measure.name, measure.source_hash, *map(hash_of_map, cities)]
        told += [] if reference is None else [str(reference.weights), *(c.name for c in cities)]
        file = folder / f"{_digest(told)}.json"
        return cls(measure, reference, file, _read(file))

    def key(self, genome: Genome, parents: Sequence[Genome]) -> str:
        """What a value depends on of the birth itself."""
        takes = self.measure.takes
        whose = {"genome", "reference"} & set(takes)
        told = [genome.digest, *([_stones(_fabric(genome))] if whose else [])]
        if "parents" in takes:
            told += [part for one in parents for part in (one.digest, _stones(_fabric(one)))]
        return told[0] if len(told) == 1 else _digest(told)

    def known(self, key: str) -> float:
        return self.values.get(key, math.nan)

    def keep(self, key: str, value: float) -> None:
        self.values[key] = value
        self.new = True

    def write(self) -> None:
        """Keep what is new; nothing is lost but time where that cannot be."""
        if self.file is None or not self.new:
            return
        with contextlib.suppress(OSError):
            self.file.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps(_read(self.file) | self.values)  # another process may have written
            with whole_file(self.file) as temporary:
                temporary.write_text(text, encoding="utf-8")


def _read(file: Path) -> dict[str, float]:
    """The values in a ``file``, as far as they are some."""
    try:
        told = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    pairs = told.items() if isinstance(told, dict) else ()
    return {k: v for k, v in pairs if isinstance(v, float) and math.isfinite(v)}


def _fabric(genome) -> Genome | None:
    """What of a genome of any kind is fabric."""
    return genome if isinstance(genome, Genome) else getattr(genome, "fabric", None)


def _stones(genome: Genome | None) -> str:
    """What a genome's digest does not tell: whose stones it is made of; "" of one without any."""
    if genome is None:
        return ""
    arrays = (genome.parent, genome.source, genome.turn, genome.other, genome.part)
    parts = [hashlib.blake2b(np.ascontiguousarray(one).tobytes()).hexdigest() for one in arrays]
    return _digest([*parts, *genome.cities])


def _digest(told: Sequence[str]) -> str:
    return hashlib.blake2b(json.dumps(told).encode(), digest_size=16).hexdigest()


__all__ = ["cache_folder", "measures_of", "scored"]
