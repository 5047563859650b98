"""`Search`: from a recipe to generations, one after the other."""

import contextlib
import dataclasses
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from evocity.errors import RecipeError, RunError
from evocity.fitness.shipping import shipped
from evocity.genome import Genome
from evocity.search import resuming
from evocity.search.births import Born, born, bred, outcome_of
from evocity.search.breeding import Plan, first_population, generator, next_population
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Here, Workers
from evocity.search.evaluator import Outcome
from evocity.search.guarding import told_of_parents
from evocity.search.individual import Individual
from evocity.search.keeping import kept_by
from evocity.search.noting import provenance_of
from evocity.search.population import Population
from evocity.search.preparation import Prepared, prepare
from evocity.search.recipe import Recipe
from evocity.store import Birth, RunWriter, refuse_existing


@dataclass(frozen=True)
class Generation:
    """State of a search after a generation.

    ``births`` and ``failures`` count from the start of the run, ``feasible`` how many of the
    living keep all constraints; ``best`` maps each measure that is more than a constraint to the
    raw value of the best living individual, ``hypervolume`` is in units of the first population's
    ranges. ``algorithm`` is what the algorithm tells of all the living, such as the coverage of
    `map_elites`. ``seconds_left`` is an estimate.
    """

    number: int
    births: int
    failures: int
    hypervolume: float
    best: dict[str, float]
    evaluations_per_second: float
    seconds_left: float
    population: list[Individual] = field(repr=False)
    feasible: int = 0
    algorithm: dict[str, float] = field(default_factory=dict)


class Search:
    """A search by a recipe: an iterator of `Generation`, and a context manager.

    >>> with Search(read_recipe("demo"), out="runs/demo") as search:  # doctest: +SKIP
    ...     for generation in search:
    ...         print(generation.number, generation.best)

    Those who evaluate elsewhere call `ask` and `tell` in turn instead of iterating.

    Parameters
    ----------
    recipe : from `read_recipe`.
    out : run folder to be created; None records nothing.
    workers : worker processes, in place of the recipe's; 0 works in this process, without
        deadlines. Births do not depend on it.
    progress : told in a few words what is prepared before the first generation.

    ``notes`` are what a user should know, in words: on `resume`, before it goes on; of a new run,
    from `prepare` on, what of the maps' files was taken, and which constraints no parent keeps.
    Raises `RunError` if ``out`` exists, `FitnessError` if a measure declared in this session, in a
    notebook's cell for one, cannot be sent to the worker processes. A script that uses workers
    must start the search under ``if __name__ == "__main__":``, as with every use of processes in
    Python.
    """

    def __init__(
        self,
        recipe: Recipe,
        out: str | os.PathLike | None = None,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
    ):
        if not isinstance(recipe, Recipe):
            raise RecipeError(
                f"a search by a {type(recipe).__name__}",
                "a Recipe",
                "read one first: evocity.read_recipe(path or bundled name)",
            )
        if out is not None:
            refuse_existing(out)
        self.recipe, self.out = recipe, out
        self.notes: list[str] = []
        self._worker_count = recipe.worker_count if workers is None else workers
        measured = [*recipe.measures, *recipe.recorded]
        self._shipped = shipped(measured) if self._worker_count else ()
        self._progress = progress
        self._prepared: Prepared | None = None
        self._writer: RunWriter | None = None
        self._pool: Here | Workers | None = None
        self._population: Population | None = None
        self._asked: list[Born] | None = None
        self._next = 0
        self._births = self._failures = 0
        self._closed = self._entered = self._ended = False
        self._began = 0.0
        self._first = 0
        self._generation_began = 0.0

    @classmethod
    def resume(
        cls,
        path: str | os.PathLike,
        generations: int | None = None,
        workers: int | None = None,
        accept_changes: bool = False,
        progress: Callable[[str], None] | None = None,
    ) -> "Search":
        """Go on with the run in ``path`` after its last whole generation.

        ``generations`` replaces the recipe's number. Raises `RunError` if the recipe, a
        map or a measure's source changed since and ``accept_changes`` is False (the
        message names what changed; no changed file is executed before), if the change cannot
        be had in one run, or if the run has more generations already.
        """
        taken = resuming.take_up(path, generations, accept_changes)
        try:
            search = cls(taken.prepared.recipe, None, workers, progress)
        except BaseException:
            taken.writer.close()
            raise
        search.out, search._writer = path, taken.writer
        search._prepared = taken.prepared
        search._population = search._new_population()
        search._population.begin_with(taken.first_births)
        search._population.restore(taken.living)
        search._next, search._births, search._failures = taken.next, taken.births, taken.failures
        search._first = taken.next
        search.notes = [taken.edited] if taken.edited else []
        try:
            if not search.finished:
                search._compile()
                search._start_pool()
            search._event("resume", generation=taken.next, changes=taken.changes)
        except BaseException:
            search.close()
            raise
        return search

    # -- the loop ------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """Whether the last generation of the recipe is done."""
        return self._next > self.recipe.run.generations

    def __iter__(self) -> Iterator[Generation]:
        """Breed, evaluate and select until the recipe's last generation; then close."""
        try:
            while not self.finished:
                plans = self._planned("a generation")
                yield self._written(born(self._pool, plans))
            if not self._closed:
                self._event("finish", generation=self._next - 1)
                self._ended = True
        except BaseException as error:
            if isinstance(error, GeneratorExit) and self._entered:
                raise  # __exit__ knows why the loop was left
            self._stopped(error)
            self.close()
            raise
        self.close()

    def prepare(self) -> None:
        """Read and code the parents, start the workers, see which constraints the parents keep, and
        make the run folder: what the first generation does otherwise. Nothing of a run that is
        prepared already, or was taken up again.

        Raises `MapError`, `GenomeError` or `FitnessError` where a map does not serve, `RecipeError`
        if no parent keeps a bound that none can keep better, see `evocity.search.guarding`.
        """
        self._refuse_closed("prepare()")
        if self._prepared is None:
            self._start(True)

    def ask(self) -> list[Genome]:
        """Breed the next generation: the genomes to evaluate, in order.

        Births whose operator failed are not among them; they are logged by `tell`. Raises
        `RunError` out of turn, after the last generation and after `close`. Which constraints the
        parents keep is not looked at, unless `prepare` was called.
        """
        plans = self._planned("ask()", guarded=False)
        self._asked = bred(self._pool, plans)
        return [one.bred.genome for one in self._to_evaluate()]

    def tell(self, results: Sequence[Outcome | Mapping[str, float] | Exception]) -> Generation:
        """Take the results of the genomes last asked for, in their order, and select.

        A result is a mapping from every measure to its value, or the exception that prevented
        it. NaN and infinity make a birth `invalid`; a NaN of a measure that is a constraint alone
        breaks it. Measures that are recorded besides may be left out. The generation is written
        down whole.
        Raises `RunError` for results out of turn, and after `close`: the run's folder may be
        another process's by then.
        """
        self._refuse_closed("tell()")
        if self._asked is None:
            raise RunError(
                "tell() before ask()", "ask() and tell() in turn", "call ask() for genomes first"
            )
        asked = self._to_evaluate()
        if len(results) != len(asked):
            raise RunError(
                f"{len(results)} results for {len(asked)} genomes",
                "one result a genome, in the order ask() returned them",
                "give an exception for a genome that could not be evaluated",
            )
        header = self._prepared.header
        bounds = self._prepared.aims.bounds
        told = [outcome_of(one, header.measures, header.recorded, bounds) for one in results]
        outcomes = dict(zip((one.plan.id for one in asked), told, strict=True))
        return self._written(
            [replace(one, evaluated=outcomes.get(one.plan.id)) for one in self._asked]
        )

    def _to_evaluate(self) -> list[Born]:
        return [one for one in self._asked if one.bred.genome is not None]

    # -- beginning and end ---------------------------------------------------------------

    def __enter__(self) -> "Search":
        self._entered = True
        return self

    def __exit__(self, kind, error, trace) -> None:
        self._stopped(error)
        self.close()

    def close(self) -> None:
        """Stop the workers and release the run folder. Safe to call twice."""
        self._closed = True
        if self._pool is not None:
            self._pool.close()
            self._pool = None
        if self._writer is not None:
            self._writer.close()

    def _start(self, guarded: bool) -> None:
        self._compile()
        self._prepared = prepare(self.recipe, self._progress)
        try:
            self._start_pool()
            unkept = told_of_parents(self._prepared, self._pool) if guarded else []
            self._create()
        except BaseException:
            if self._pool is not None:
                self._pool.close()
            self._prepared = self._pool = None
            raise
        self.notes += [*self._prepared.notes, *unkept]
        self._population = self._new_population()
        self._event("start", seed=self.recipe.run.seed, workers=self._worker_count)

    def _new_population(self) -> Population:
        header = self._prepared.header
        algorithm = self.recipe.search.algorithm_of(header.population)
        return Population(algorithm, self._prepared.aims, header.chromosome, self.recipe.limits)

    def _create(self) -> None:
        """Make the run folder, if the run is kept."""
        if self.out is not None:
            kept = kept_by(self.recipe)
            self._writer = RunWriter.create(
                self.out,
                self.recipe.text,
                provenance_of(self._prepared, self.out, kept),
                self._prepared.header,
                self._prepared.sources,
                self._prepared.condensation,
                kept.files,
                self._prepared.others,
                [part.mask for part in self._prepared.within.values()],
            )

    @property
    def _sides(self) -> int | tuple[int, int]:
        """Of the range blocks, px: of a run of an older release its one."""
        before = None if self._prepared is None else self._prepared.header.block
        return before or self.recipe.genome.block

    def _compile(self) -> None:
        compile_once(self._sides, needed(self.recipe), self._tell)

    def _tell(self, text: str) -> None:
        if self._progress is not None:
            self._progress(text)

    def _start_pool(self) -> None:
        parts = tuple(needed(self.recipe))
        setup = dataclasses.replace(
            self._prepared.setup, shipped=self._shipped, sides=self._sides, parts=parts
        )
        if self._worker_count == 0:
            self._pool = Here(setup)
        else:
            self._tell(f"starting {self._worker_count} workers")
            timeout = self.recipe.evaluation.timeout
            self._pool = Workers(
                setup, self._worker_count, timeout, lambda text: self._event("retry", reason=text)
            )

    def _stopped(self, error: BaseException | None) -> None:
        """Note why the run stops, once; what is not whole is dropped at the next resume."""
        if self._ended or self._closed:
            return
        self._ended = True
        if self.finished and (error is None or isinstance(error, GeneratorExit)):
            self._event("finish", generation=self._next - 1)
            return
        reason = {KeyboardInterrupt: "interrupted", GeneratorExit: "left", type(None): "left"}
        told = reason.get(type(error), f"{type(error).__name__}: {error}")
        with contextlib.suppress(RunError):  # the folder itself may be what failed
            self._event("stop", generation=self._next - 1, reason=told)

    def _refuse_closed(self, what: str) -> None:
        if self._closed:
            raise RunError(
                f"{what} after the search was closed",
                "a search that still holds its run",
                "ask() and tell() before close(), or within `with`; go on with: "
                "Search.resume(path)",
            )

    def _event(self, event: str, **details) -> None:
        if self._writer is not None:
            self._writer.event(event, **details)

    # -- one generation ------------------------------------------------------------------

    def _planned(self, what: str, guarded: bool = True) -> list[Plan]:
        """The next generation's births; what a run needs is prepared before the first, ``guarded``
        or not by a look at what the parents keep."""
        self._refuse_closed(what)
        if self._asked is not None:
            raise RunError(
                f"{what} while the {len(self._to_evaluate())} genomes asked before are not told",
                "ask() and tell() in turn",
                "call tell(results) first",
            )
        if self.finished:
            raise RunError(
                f"{what} after the end of the search",
                f"generations up to {self.recipe.run.generations}",
                "go on with more: Search.resume(path, generations=…)",
            )
        if self._prepared is None:
            self._start(guarded)
        self._generation_began = time.perf_counter()
        sources = [source.genome for source in self._prepared.sources]
        if self._next == 0:
            return first_population(self.recipe, sources)
        population = self._population
        return next_population(
            self.recipe, population.algorithm, self._next, population.living, sources
        )

    def _written(self, individuals: Sequence[Born]) -> Generation:
        """Select among these ``individuals`` and the living; write the generation down whole."""
        births = [one.birth(self._next, self._prepared.aims) for one in individuals]
        looks = {
            one.plan.id: one.evaluated.look
            for one in individuals
            if one.evaluated is not None and one.evaluated.look is not None
        }
        # no birth has this slot
        rng = generator(self.recipe.run.seed, self._next, self.recipe.run.population)
        self._population.select(births, rng, looks)
        self._births += len(births)
        failed = [birth for birth in births if not birth.ok]
        self._failures += len(failed)
        generation = self._generation(births)
        if self._writer is not None:
            summary = dataclasses.asdict(replace(generation, population=[]))
            for key in ("number", "population", "seconds_left", "feasible"):  # births tell the last
                del summary[key]
            if not math.isfinite(generation.hypervolume):  # JSON has no infinity
                summary["hypervolume"] = None
            if not generation.algorithm:
                del summary["algorithm"]
            self._writer.write_generation(
                generation.number, births, self._population.members, summary
            )
        self._asked = None
        self._next += 1
        self._refuse_failures(failed, births)
        return generation

    def _generation(self, births: list[Birth]) -> Generation:
        now = time.perf_counter()
        done = self._next - self._first
        if done == 0:  # workers start and kernels load: what the births took tells more
            spent = sum(born.seconds for born in births) / max(1, self._worker_count)
            one, self._began = min(now - self._generation_began, spent), now
        else:
            one = (now - self._began) / done
        return Generation(
            number=self._next,
            births=self._births,
            failures=self._failures,
            hypervolume=self._population.hypervolume,
            best=self._population.best,
            evaluations_per_second=len(births) / max(now - self._generation_began, 1e-9),
            seconds_left=one * (self.recipe.run.generations - self._next),
            population=list(self._population.living),
            feasible=sum(not one.violation for one in self._population.living),
            algorithm=self._population.summary,
        )

    def _refuse_failures(self, failed: list[Birth], births: list[Birth]) -> None:
        count = len(births)
        limit = self.recipe.evaluation.max_failures
        if len(failed) <= limit * count and self._population.living:
            return
        if not failed:
            told = next((one.error for one in births if one.error), "no reason given")
            raise RunError(
                f"none of {len(births)} births of generation {self._next - 1} may live; the first: "
                f"{told}",
                "births that have a value of each of the algorithm's descriptors",
                "choose other descriptors under [search], and start a new run",
            )
        kinds = {
            s: sum(b.status == s for b in failed) for s in dict.fromkeys(b.status for b in failed)
        }
        said = ", ".join(f"{number} {status}" for status, number in kinds.items())
        raise RunError(
            f"{len(failed)} of {count} births of generation {self._next - 1} failed ({said}); "
            f"the first: {failed[0].error}",
            f"at most {limit:.0%} (evaluation.max_failures), and somebody alive",
            "correct the measure or the operator and start a new run; the births written down "
            "tell each failure",
        )
