"""`Search`: the loop from a recipe to generations, one after the other."""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence

from evocity.errors import RecipeError, RunError
from evocity.evaluation import Engine
from evocity.evaluation.compilation import compile_once, kernel_parts
from evocity.evaluation.evaluator import Outcome
from evocity.genome import Genome
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.breeding.birth_plans import Guidance
from evocity.search.breeding.births import Offspring, add_results, breed_plans, without_failed
from evocity.search.preparation.constraints import describe_unkept_bounds
from evocity.search.preparation.preparation import Prepared, prepare
from evocity.search.preparation.startup import Crew, block_sides, create_run_folder, start_engine
from evocity.search.preparation.trust import Permission
from evocity.search.record.commands import Pick, Reweight, Stop
from evocity.search.resume.resume import ResumedRun, reopen_run
from evocity.search.schedules import SteadyState, WholeGenerations
from evocity.search.steering.execution import Steering, genomes_of
from evocity.search.steering.generation import Generation, Pace, refuse_failures
from evocity.search.steering.notification import add_notifier
from evocity.search.steering.observers import Observer, Observers
from evocity.search.steering.stop_rules import (
    Clock,
    Reason,
    Stopping,
    current_time,
    end_event,
    refuse_past_time,
)
from evocity.store import BackgroundWriter, Birth, refuse_existing


class Search:
    """A search by a recipe, usable as an iterator of `Generation` and as a context manager.

    >>> with Search(read_recipe("demo"), out="runs/demo") as search:  # doctest: +SKIP
    ...     for generation in search:
    ...         print(generation.number, generation.best)

    To evaluate births by your own code, call `ask` and `tell` in turn instead of a loop.

    Parameters
    ----------
    recipe : recipe of the search, from `read_recipe`.
    out : run folder to be created; with None, the search records nothing.
    workers : number of worker processes, instead of the recipe's number. With ``workers=0``, the
        calling process evaluates all births without deadlines. Births do not depend on ``workers``.
    cluster : address of a Dask cluster, in place of the recipe's address: one of "tcp://HOST:PORT",
        "local:N", "none". With a cluster, ``workers`` is the number of processes in each Dask
        worker; by default, each thread of the Dask worker gets a process.
    progress : function that receives a short text at each step before the first generation.
    observers : receivers of generations and events (see `evocity.search.steering.observers`).
    clock : function that returns the time, to check the key ``until`` of the section ``[stop]``.

    The commands `stop`, `pick` and `reweight` can control a search through its run folder. The
    attribute ``notes`` lists sentences for the user: how files of maps were read, which constraints
    no parent keeps, and what changed before a `resume`. To use workers in a script, start the
    search under ``if __name__ == "__main__":``.

    Raises `RunError` if ``out`` exists or the cluster cannot be reached. Raises `FitnessError` if
    workers cannot receive a measure that was defined in this session.
    """

    def __init__(
        self,
        recipe: Recipe,
        out: str | os.PathLike | None = None,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
        observers: Sequence[Observer] = (),
        clock: Clock = current_time,
        cluster: str | None = None,
    ):
        if not isinstance(recipe, Recipe):
            raise RecipeError(
                f"Search received a {type(recipe).__name__} in place of a recipe",
                "an object of the class evocity.Recipe",
                "read the recipe first: evocity.read_recipe(path or bundled name)",
            )
        if out is not None:
            refuse_existing(out)
        self.recipe, self.out = recipe, out
        self.notes: list[str] = []
        self._crew = Crew.choose(recipe, workers, cluster)
        self._shipment = self._crew.ship(recipe)
        self._tell = progress or (lambda text: None)
        self._prepared: Prepared | None = None
        self._writer: BackgroundWriter | None = None
        self._pool: Engine | None = None
        self._population: Archipelago | None = None
        self._schedule: WholeGenerations | SteadyState | None = None
        self._observers = Observers(observers)
        self._steering = Steering(recipe, self._genomes_of)
        self._clock, self._stopping = clock, None
        self._pending: list[Offspring] | None = None
        self._next = 0
        self._births = self._failures = 0
        self._closed = self._entered = self._ended = False
        self._pace = Pace(1)

    @classmethod
    def resume(
        cls,
        path: str | os.PathLike,
        generations: int | None = None,
        workers: int | None = None,
        accept_changes: bool = False,
        trust: bool = False,
        progress: Callable[[str], None] | None = None,
        observers: Sequence[Observer] = (),
        until: str | None = None,
        recipe: Recipe | str | os.PathLike | None = None,
        clock: Clock = current_time,
        cluster: str | None = None,
    ) -> "Search":
        """Continue the run in ``path`` after its last complete generation.

        The arguments ``generations`` and ``until`` replace the values in the recipe. If a rule in
        ``[stop]`` still ends the run, no generation follows, and the attribute ``notes`` says which
        value to change. If the argument ``generations`` adds generations, a stopped run continues.

        The argument ``recipe`` is a new recipe, or its path. The search judges all earlier births
        again by the goals of the new recipe. The search computes new measures of the recipe for
        earlier births, too.

        If the new recipe changes values that must stay constant in a run, `RecipeError` lists these
        values. The method `resume` raises `RunError` in three cases.

        - If the recipe, a map or a measure has changed, `RunError` lists the changes, unless
          ``accept_changes`` is True. With ``accept_changes=False``, no changed file is executed.
        - If a change is not allowed, or ``generations`` is too small, `resume` raises `RunError`.
        - If a run from another machine has measure files or commands, `resume` raises `RunError`,
          unless ``trust`` is True. With ``trust=False``, no measure file of this run is executed.
        """
        overrides = {"run.generations": generations, "stop.until": until}
        permission, tell = Permission(trust, accept_changes), progress or (lambda text: None)
        resumed = reopen_run(path, overrides, permission, recipe, (workers, cluster), tell)
        prepared, writer, more = resumed.prepared, resumed.writer, generations is not None
        try:
            search = cls(prepared.recipe, None, workers, progress, observers, clock, cluster)
        except BaseException:
            writer.close()
            raise
        search.out, search._prepared, search._writer = path, prepared, BackgroundWriter(writer)
        search.notes = [resumed.recipe_note] if resumed.recipe_note else []
        try:
            status, search._next = resumed.run.status(), resumed.next
            search._births, search._failures = status["births"], status["failures"]
            search._observers.log(search._writer)
            search._steering = resumed.steering(search._genomes_of)
            search._settle()
            resumed.restore(search._population)
            logged = search._stopping.resume(resumed.run, search._population.living, more)
            best = search._stopping.best
            search.notes += add_notifier(search.recipe, path, search._observers, best)
            if search.stopped_by is not None:
                search.notes.append(search.stopped_by.note)
            elif not search.finished:
                search._compile()
                search._start_pool()
                search._schedule = search._new_schedule(resumed)
            logged |= {"changes": resumed.changes}
            logged |= {} if search._pool is None else search._pool.described
            search._observers.event("resume", generation=resumed.next, **logged)
        except BaseException:
            search.close()
            raise
        return search

    # -- the loop ------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """Whether the last generation of the recipe is over."""
        return self._next > self.recipe.run.generations

    @property
    def asked_to_stop(self) -> bool:
        """Whether the command `stop` ended the search."""
        return self._steering.orders.stop

    @property
    def stopped_by(self) -> Reason | None:
        """Rule in the recipe's section ``[stop]`` that ended the search; None if no rule ended the
        search."""
        return None if self._stopping is None or self.finished else self._stopping.reason

    def stop(self) -> None:
        """End the search after the present generation, like the command ``evocity stop``."""
        self._steering.add(Stop())

    def pick(self, ids: Sequence[int], share: float | None = None) -> None:
        """Use the individuals with these ``ids`` as additional parents from the next generation on.
        Events report unknown ids and failed births. See `evocity.search.record.commands.Pick`."""
        self._steering.add(Pick(ids=tuple(ids), share=share))

    def reweight(self, **weights: float) -> None:
        """Set the ``weights`` of operators, or of measures in sums, from the next generation on."""
        self._steering.add(Reweight(weights=weights))

    def observe(self, observer: Observer) -> None:
        """Pass all later generations and events to an ``observer``."""
        self._observers.add(observer)

    def __iter__(self) -> Iterator[Generation]:
        """Breed, evaluate and select until the recipe's last generation; then close."""
        try:
            while not self.finished and self._carry_out_commands():
                self._begin_generation("a generation")
                yield self._record(self._schedule.births(self._next, self._guidance()))
            if not self._closed:
                self._record_end(None)
        except BaseException as error:
            if isinstance(error, GeneratorExit) and self._entered:
                raise  # __exit__ knows why the caller left the loop
            self._record_end(error)
            self.close()
            raise
        self.close()

    def prepare(self) -> None:
        """Prepare the search now, instead of at the beginning of the first generation.

        The preparation reads and encodes the parents, starts the workers, checks which constraints
        the parents keep, and creates the run folder. Only the first `prepare` has an effect.

        Raises `MapError`, `GenomeError` or `FitnessError` if a map cannot be used. Raises
        `RecipeError` if no parent satisfies a constraint, and breeding cannot bring births closer
        to the bound of this constraint. See `evocity.search.preparation.constraints`.
        """
        self._refuse_closed("prepare()")
        if self._prepared is None:
            self._start(True)

    def ask(self) -> list[Genome]:
        """Breed the next generation, but refine no birth. Return the genomes for you to evaluate.

        The returned list lacks births whose operator failed; the method `tell` logs these births.
        Only the method `prepare` checks which constraints the parents keep. Raises `RunError` in
        three cases: `tell` did not follow the last `ask`; no generation is left; the search is
        closed.
        """
        if self._pending is None and not self._closed and not self._carry_out_commands():
            by = self.stopped_by
            found = "was asked to stop" if by is None else f"has stopped: {by.words}"
            raise RunError(
                f"ask() was called, but the search {found}",
                "a search that is still running",
                "close the search with close(), then continue the run with Search.resume(path)",
            )
        if self.recipe.search.window is not None:
            raise RunError(
                f"ask() does not work with [search] window = {self.recipe.search.window}",
                "a recipe that breeds whole generations",
                "remove the key `window` from [search] of the recipe",
            )
        self._begin_generation("ask()", guarded=False)
        plans = self._schedule.plans(self._next, self._guidance())
        self._pending = breed_plans(self._pool, plans)
        return [child.breeding.genome for child in without_failed(self._pending)]

    def tell(self, results: Sequence[Outcome | Mapping[str, float] | Exception]) -> Generation:
        """Take a result for each genome that `ask` returned, in the order of the genomes; select
        the survivors and log the generation.

        A result is either a mapping from each measure to its value, or the exception that the
        evaluation raised. A birth with a value of NaN or infinity is invalid. If a measure is only
        a constraint, NaN breaks the constraint. Measures that the run only records may be missing.

        Raises `RunError` if you call `tell` before `ask`, or after `close` has released the run
        folder.
        """
        self._refuse_closed("tell()")
        if self._pending is None:
            raise RunError(
                "tell() was called before ask()",
                "a call of ask() before each call of tell()",
                "call ask(), evaluate the genomes that ask() returned, then call tell() with the "
                "results",
            )
        offspring = add_results(self._pending, results, self._prepared)
        return self._record(self._schedule.select(offspring, self._next))

    # -- beginning and end ---------------------------------------------------------------

    def __enter__(self) -> "Search":
        self._entered = True
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        with contextlib.closing(self):
            self._record_end(error)

    def flush(self) -> None:
        """Wait until all births are written. Raises `RunError` if a birth cannot be written."""
        if self._writer is not None and not self._closed:
            self._writer.flush()

    def close(self) -> None:
        """Stop the workers, write the births that are not yet written, and release the run folder.
        Only the first call of `close` has an effect."""
        self._closed = True
        if self._schedule is not None:
            self._schedule.close()
            self._schedule = None
        if self._pool is not None:
            self._pool.close()
            self._pool = None
        if self._writer is not None:
            self._writer.close()

    def _start(self, guarded: bool) -> None:
        refuse_past_time(self.recipe.stop, self._clock)
        self.notes += add_notifier(self.recipe, self.out, self._observers)
        self._compile()
        self._prepared = prepare(self.recipe, self._tell)
        try:
            self._start_pool()
            unkept = describe_unkept_bounds(self._prepared, self._pool) if guarded else []
            if self.out is not None:
                writer = create_run_folder(self._prepared, self.out, self._pool.described)
                self._writer = BackgroundWriter(writer)
                self._observers.log(self._writer)
        except BaseException:
            if self._pool is not None:
                self._pool.close()
            self._prepared = self._pool = None
            raise
        self.notes += [*self._prepared.notes, *unkept]
        self._settle()
        self._schedule = self._new_schedule()
        self._observers.event("start", seed=self.recipe.run.seed, **self._pool.described)

    def _settle(self) -> None:
        """Create the population, which is empty, and the stop rules."""
        observers, weights = self._observers, self._steering.orders.weights
        self._population = Archipelago(self._prepared, weights, observers.event)
        limits, aims = self.recipe.stop, self._prepared.aims
        self._stopping = Stopping(limits, aims, self.out, self._clock, observers.wait)

    def _new_schedule(self, resumed: ResumedRun | None = None) -> WholeGenerations | SteadyState:
        if self.recipe.search.window is None:
            return WholeGenerations(self._prepared, self._population, self._pool)
        if resumed is None or not resumed.next:
            return SteadyState(self._prepared, self._population, self._pool)
        run, event = resumed.run, self._observers.event
        steady = SteadyState.resume(run, self._prepared, resumed.next, self._pool, event)
        self._population = steady.population
        self._population.reweigh(self._steering.orders.weights)
        resumed.restore(self._population)
        return steady

    def _compile(self) -> None:
        sides = block_sides(self.recipe, self._prepared)
        compile_once(sides, kernel_parts(self.recipe, True), self._tell)

    def _start_pool(self) -> None:
        setup = self._prepared, self._crew, self._shipment, self._tell
        self._pool = start_engine(*setup, lambda text: self._observers.event("retry", reason=text))
        self._pace, self.notes = Pace(self._pool.size), [*self.notes, *self._pool.notes]

    def _record_end(self, error: BaseException | None) -> None:
        """Log why the run stops, once; the next resume drops an unfinished generation."""
        if self._ended or self._closed:
            return
        if error is None:  # a write that fails is why it stops
            self.flush()
        self._ended = True
        event, details = end_event(error, self.finished, self.asked_to_stop, self.stopped_by)
        self._observers.end(event, generation=self._next - 1, **details)

    def _refuse_closed(self, call: str) -> None:
        if self._closed:
            raise RunError(
                f"{call} was called after the search was closed",
                "an open search",
                "call close() only at the end; continue a recorded run with Search.resume(path)",
            )

    # -- one generation ------------------------------------------------------------------

    def _carry_out_commands(self) -> bool:
        """Carry out the commands since the last generation; return whether the search goes on."""
        steering, weights = self._steering, self._steering.orders.weights
        for event, details in steering.carry_out_from(self._writer, self._next):
            if event is not None:
                self._observers.event(event, **details)
            if details.get("command") == "reweight" and self._stopping is not None:
                self._stopping.reset_progress()
        if steering.orders.weights != weights and self._population is not None:
            self._population.reweigh(steering.orders.weights)
        return not steering.orders.stop and self.stopped_by is None

    def _genomes_of(self, ids: Sequence[int]) -> dict[int, Genome]:
        self._observers.wait()
        living = [] if self._population is None else self._population.living
        return genomes_of(ids, None if self._writer is None else self.out, living)

    def _begin_generation(self, call: str, guarded: bool = True) -> None:
        self._refuse_closed(call)
        if self._pending is not None:
            waiting = len(without_failed(self._pending))
            raise RunError(
                f"{call} was called, but {waiting} genomes of ask() still wait for their results",
                "a call of tell() after each call of ask()",
                "call tell() with the results of these genomes first",
            )
        if self.finished:
            raise RunError(
                f"{call} was called after the last generation",
                f"a call in one of the generations 0 to {self.recipe.run.generations}",
                "continue with more generations: Search.resume(path, generations=…)",
            )
        if self._prepared is None:
            self._start(guarded)
        self._pace.begin()

    def _guidance(self) -> Guidance:
        weights = self._population.weights(self._next, self._steering.orders.weights)
        return Guidance(self._steering.picks, weights)

    def _record(self, births: Sequence[Birth]) -> Generation:
        self._births += len(births)
        self._failures += sum(not birth.ok for birth in births)
        population, (rate, seconds) = self._population, self._pace.end(births)
        generation = Generation(
            number=self._next,
            births=self._births,
            failures=self._failures,
            hypervolume=population.hypervolume,
            best=population.best,
            evaluations_per_second=rate,
            seconds_left=seconds * (self.recipe.run.generations - self._next),
            population=list(population.living),
            feasible=sum(not individual.violation for individual in population.living),
            algorithm=population.summary,
            islands=population.summaries,
        )
        self._observers.generation(generation, births, population.members)
        self._pending = None
        self._stopping.check(generation)
        self._next += 1
        limit = self.recipe.evaluation.max_failures
        refuse_failures(births, limit, generation.number, population.alive)
        return generation
