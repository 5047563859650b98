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
from evocity.search.breeding.births import Offspring, add_results, breed_plans, without_failed
from evocity.search.breeding.plans import Guidance
from evocity.search.preparation.constraints import describe_unkept_bounds
from evocity.search.preparation.preparation import Prepared, prepare
from evocity.search.preparation.startup import Crew, block_sides, create_run_folder, start_engine
from evocity.search.preparation.trust import Permission
from evocity.search.record.commands import Pick, Reweight, Stop
from evocity.search.resume.resume import ResumedRun, orders_of, reopen_run
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
    """Search by a recipe: an iterator of `Generation`, and a context manager.

    >>> with Search(read_recipe("demo"), out="runs/demo") as search:  # doctest: +SKIP
    ...     for generation in search:
    ...         print(generation.number, generation.best)

    To evaluate births by your own code, call `ask` and `tell` in turn instead of iterating.

    Parameters
    ----------
    recipe : recipe from `read_recipe`.
    out : run folder to be created. None records nothing.
    workers : number of worker processes, in place of the recipe's number. With 0, this process
        evaluates all births, without deadlines. The number does not change the births.
    cluster : Dask cluster, in place of the recipe's: "tcp://HOST:PORT", "local:N" or "none". Each
        worker of the cluster hosts ``workers`` processes, by default one per thread.
    progress : function that is called with a few words on each step before the first generation.
    observers : receivers of generations and events, see `evocity.search.steering.observers`.
    clock : time that ``[stop] until`` compares.

    A run in progress takes the commands `stop`, `pick` and `reweight`, also through its folder.

    The attribute ``notes`` lists sentences for the user. They describe how `prepare` read the maps'
    files, which constraints no parent keeps, and what changed before a `resume`. Raises `RunError`
    if ``out`` exists or the cluster cannot be reached. Raises `FitnessError` if a measure declared
    in this session, such as in a notebook's cell, cannot be sent to workers. To use workers in a
    script, start the search under ``if __name__ == "__main__":``.
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
                f"the recipe of a search is a {type(recipe).__name__}",
                "a Recipe",
                "read a recipe first: evocity.read_recipe(path or bundled name)",
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
        """Continue the run in ``path`` after its last whole generation.

        The arguments ``generations`` and ``until`` replace the values of the recipe. If a rule of
        ``[stop]`` still holds, no generation follows, and ``notes`` say which value to change. If
        you ask for more generations, the search ignores an earlier stagnation and a target already
        reached.

        The argument ``recipe`` is another recipe, or its path. It judges all births, and its new
        measures score them too. `RecipeError` lists the changes that a run cannot take.

        Raises `RunError` in these cases.

        - The recipe, a map or the source of a measure has changed, and ``accept_changes`` is False.
          The message names each change; no changed file is executed before.
        - The run cannot take the change, or already has more generations.
        - The run started on another machine and brings its own measures or commands. Nothing of
          them is executed unless ``trust`` confirms them.
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
            lines = writer.commands(0)
            old = lines[-1][0] + 1 if lines else 0
            orders = orders_of(resumed.run, resumed.next)
            search._steering = Steering(search.recipe, search._genomes_of, orders, old)
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
        """True after the last generation of the recipe."""
        return self._next > self.recipe.run.generations

    @property
    def asked_to_stop(self) -> bool:
        """True if a command ended the search."""
        return self._steering.orders.stop

    @property
    def stopped_by(self) -> Reason | None:
        """Rule of the recipe's ``[stop]`` that ended the search; None if no rule ended it."""
        return None if self._stopping is None or self.finished else self._stopping.reason

    def stop(self) -> None:
        """End the search after the generation that it is breeding, as ``evocity stop`` does."""
        self._steering.add(Stop())

    def pick(self, ids: Sequence[int], share: float | None = None) -> None:
        """Breed also from the individuals ``ids``, from the next generation on. Ids of failed
        births and unknown ids are refused. See `evocity.search.record.commands.Pick`."""
        self._steering.add(Pick(ids=tuple(ids), share=share))

    def reweight(self, **weights: float) -> None:
        """Set new weights of operators, or of measures in a sum, from the next generation on."""
        self._steering.add(Reweight(weights=weights))

    def observe(self, observer: Observer) -> None:
        """Pass all later events to an ``observer``."""
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
        """Prepare the first generation now, instead of at its beginning.

        This reads and encodes the parents, starts the workers, checks which constraints the parents
        keep, and creates the run folder. Nothing happens if the run is prepared or resumed.

        Raises `MapError`, `GenomeError` or `FitnessError` if a map cannot be used. Raises
        `RecipeError` if no parent keeps a constraint and no birth can keep it better. See
        `evocity.search.preparation.constraints`.
        """
        self._refuse_closed("prepare()")
        if self._prepared is None:
            self._start(True)

    def ask(self) -> list[Genome]:
        """Breed the next generation, without refinements. Return the genomes to evaluate, in order.

        Births whose operator failed are not returned; `tell` logs them. If `prepare` was not
        called, nothing checks which constraints the parents keep. Raises `RunError` if called twice
        without `tell`, after the last generation, or after `close`.
        """
        if self._pending is None and not self._closed and not self._carry_out_commands():
            by = self.stopped_by
            found = "was asked to stop" if by is None else f"has stopped: {by.words}"
            raise RunError(
                f"ask() was called, but the search {found}",
                "a search that is still running",
                "call close(); to go on: Search.resume(path)",
            )
        if self.recipe.search.window is not None:
            raise RunError(
                f"ask() does not work with [search] window = {self.recipe.search.window}",
                "a search that plans its births generation by generation",
                "leave `window` out of [search]",
            )
        self._begin_generation("ask()", guarded=False)
        plans = self._schedule.plans(self._next, self._guidance())
        self._pending = breed_plans(self._pool, plans)
        return [child.breeding.genome for child in without_failed(self._pending)]

    def tell(self, results: Sequence[Outcome | Mapping[str, float] | Exception]) -> Generation:
        """Take the results of the genomes from `ask`, in their order. Select, and log the whole
        generation.

        A result is a mapping from every measure to its value, or the exception that prevented it.
        NaN and infinity make a birth invalid. NaN of a measure that is only a constraint breaks the
        constraint. Measures that are only recorded may be missing.

        Raises `RunError` without a call of `ask` before, or after `close`, because another process
        may hold the run folder by then.
        """
        self._refuse_closed("tell()")
        if self._pending is None:
            raise RunError(
                "tell() was called before ask()",
                "ask() and tell() in turn",
                "call ask() for genomes first",
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
        """Wait until all births are written. Raises `RunError` if they cannot be written."""
        if self._writer is not None and not self._closed:
            self._writer.flush()

    def close(self) -> None:
        """Stop the workers, write the waiting births, and release the run folder. A second call
        does nothing."""
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
        self._pace = Pace(self._pool.size)

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
                "call ask() and tell() before close(); to go on now: Search.resume(path)",
            )

    # -- one generation ------------------------------------------------------------------

    def _carry_out_commands(self) -> bool:
        """Carry out the commands since the last generation; return whether the search goes on."""
        steering, weights = self._steering, self._steering.orders.weights
        lines = [] if self._writer is None else self._writer.commands(steering.orders.read)
        for event, details in steering.carry_out(lines, self._next):
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
        """Before the first generation, prepare the run, ``guarded`` or not as by `prepare`."""
        self._refuse_closed(call)
        if self._pending is not None:
            waiting = len(without_failed(self._pending))
            raise RunError(
                f"{call} was called, but {waiting} genomes of ask() still wait for their results",
                "ask() and tell() in turn",
                "call tell(results) first",
            )
        if self.finished:
            raise RunError(
                f"{call} was called after the last generation",
                f"generations up to {self.recipe.run.generations}",
                "go on with more generations: Search.resume(path, generations=…)",
            )
        if self._prepared is None:
            self._start(guarded)
        self._pace.begin()

    def _guidance(self) -> Guidance:
        weights = self._population.weights(self._next, self._steering.orders.weights)
        return Guidance(self._steering.picks, weights)

    def _record(self, births: Sequence[Birth]) -> Generation:
        """Log the ``births`` of the next generation, and who lives on."""
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
