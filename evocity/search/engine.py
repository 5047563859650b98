"""`Search`: from a recipe to generations, one after the other."""

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence

from evocity.errors import RecipeError, RunError
from evocity.fitness.shipping import shipped
from evocity.genome import Genome
from evocity.search import resuming
from evocity.search.archipelago import Archipelago
from evocity.search.beginning import Crew, pool_of, sides_of, writer_of
from evocity.search.births import Born, bred, to_evaluate, with_results
from evocity.search.breeding import Picks
from evocity.search.commands import Pick, Reweight, Stop
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluation import Engine
from evocity.search.evaluator import Outcome
from evocity.search.generation import Generation, Pace, refuse_failures
from evocity.search.generational import Generational, Weights
from evocity.search.guarding import told_of_parents
from evocity.search.notifying import told_to
from evocity.search.observers import Observer, Observers
from evocity.search.opening import open_run
from evocity.search.preparation import Prepared, prepare
from evocity.search.recipe import Recipe
from evocity.search.steady import Steady
from evocity.search.steering import Steering, genomes_of
from evocity.search.stopping import Clock, Reason, Stopping, end_of, now, refuse_passed
from evocity.store import Behind, Birth, refuse_existing


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
    cluster : a Dask cluster, in place of the recipe's: "tcp://HOST:PORT", "local:N", "none"; each
        of its workers hosts so many ``workers``, one a thread unless told.
    progress : told in a few words what is prepared before the first generation.
    observers : see `evocity.search.observers`; they see every generation and event.
    clock : tells the time by which ``[stop] until`` of the recipe goes.

    A run that goes on may be asked to stop, to breed from picks and to weigh anew, by `stop`,
    `pick` and `reweight` here, or by any process through the run's folder
    (`evocity.search.commands`).

    ``notes`` are what a user should know, in words: on `resume`, before it goes on; of a new run,
    from `prepare` on, what of the maps' files was taken, and which constraints no parent keeps.
    Raises `RunError` if ``out`` exists or the cluster cannot be had, `FitnessError` if a measure
    declared in this session, in a notebook's cell for one, cannot be sent to the worker processes.
    A script that uses workers must start the search under ``if __name__ == "__main__":``.
    """

    def __init__(
        self,
        recipe: Recipe,
        out: str | os.PathLike | None = None,
        workers: int | None = None,
        progress: Callable[[str], None] | None = None,
        observers: Sequence[Observer] = (),
        clock: Clock = now,
        cluster: str | None = None,
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
        self._crew = Crew.asked(recipe, workers, cluster)
        measured = [*recipe.measures, *recipe.recorded]
        self._shipped = () if self._crew.here else shipped(measured)
        self._tell = progress or (lambda text: None)
        self._prepared: Prepared | None = None
        self._writer: Behind | None = None
        self._pool: Engine | None = None
        self._population: Archipelago | None = None
        self._breeding: Generational | Steady | None = None
        self._observers = Observers(observers)
        self._steering = Steering(recipe, self._found)
        self._clock, self._stopping = clock, None
        self._asked: list[Born] | None = None
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
        clock: Clock = now,
        cluster: str | None = None,
    ) -> "Search":
        """Go on with the run in ``path`` after its last whole generation.

        ``generations`` and ``until`` replace the recipe's. What ``[stop]`` of the recipe says may
        hold still: then no generation follows, and ``notes`` tell what to change; more generations
        go on in spite of a target that is reached, and of stagnation. Raises `RunError` if the
        recipe, a map or a measure's source changed since and ``accept_changes`` is False (the
        message names what changed; no changed file is executed before), if the change cannot
        be had in one run, or if the run has more generations already. Raises it too, and executes
        nothing, if the run was not begun on this machine and brings measures or commands of its
        own: ``trust`` confirms these.

        ``recipe``: another one to go on by, or where to read it; all births are judged by it, and
        scored by its new measures. What a run cannot change is listed by `RecipeError`.
        """
        asked = {"run.generations": generations, "stop.until": until}
        crew, tell = (workers, cluster), progress or (lambda text: None)
        taken = resuming.take_up(path, asked, accept_changes, trust, recipe, crew, tell)
        try:
            search = cls(taken.prepared.recipe, None, workers, progress, observers, clock, cluster)
        except BaseException:
            taken.writer.close()
            raise
        search.out, search._prepared, search._writer = path, taken.prepared, Behind(taken.writer)
        search._next, search._births, search._failures = taken.next, taken.births, taken.failures
        search.notes = [taken.edited] if taken.edited else []
        try:
            search._observers.log(search._writer)
            old = taken.writer.commands(0)
            search._steering = Steering(
                search.recipe, search._found, taken.standing, old[-1][0] + 1 if old else 0
            )
            search._population, search._stopping = search._settled(), search._new_stopping()
            taken.restore(search._population)
            living, more = search._population.living, generations is not None
            held = search._stopping.take_up(open_run(path), living, more)
            search.notes += told_to(search.recipe, path, search._observers, search._stopping.best)
            if search.stopped_by is not None:
                search.notes.append(search.stopped_by.still)
            elif not search.finished:
                search._compile()
                search._start_pool()
                search._breeding = search._new_breeding(taken)
            engine = {} if search._pool is None else search._pool.described
            held |= {"changes": taken.changes, **engine}
            search._observers.event("resume", generation=taken.next, **held)
        except BaseException:
            search.close()
            raise
        return search

    # -- the loop ------------------------------------------------------------------------

    @property
    def finished(self) -> bool:
        """Whether the last generation of the recipe is done."""
        return self._next > self.recipe.run.generations

    @property
    def asked_to_stop(self) -> bool:
        """Whether a command ended the search."""
        return self._steering.standing.stop

    @property
    def stopped_by(self) -> Reason | None:
        """What of the recipe's ``[stop]`` ended the search; None while it goes on, and where it
        ended otherwise."""
        return None if self._stopping is None or self.finished else self._stopping.reason

    def stop(self) -> None:
        """End after the generation that is being bred, as `evocity stop` does."""
        self._steering.ask(Stop())

    def pick(self, ids: Sequence[int], share: float | None = None) -> None:
        """Breed from the individuals ``ids`` too, from the next generation on, see
        `evocity.search.commands.Pick`. One that was never born, or failed, is refused then."""
        self._steering.ask(Pick(ids=tuple(ids), share=share))

    def reweight(self, **weights: float) -> None:
        """Weigh operators, or measures of a sum, anew from the next generation on; by names."""
        self._steering.ask(Reweight(weights=weights))

    def observe(self, observer: Observer) -> None:
        """Have an ``observer`` see what comes from now on."""
        self._observers.add(observer)

    def __iter__(self) -> Iterator[Generation]:
        """Breed, evaluate and select until the recipe's last generation; then close."""
        try:
            while not self.finished and self._steered():
                yield self._written(self._breeding_of("a generation").births(*self._told()))
            if not self._closed:
                self._stopped(None)
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
        """Breed the next generation: the genomes to evaluate, in order. Nobody is refined.

        Births whose operator failed are not among them; they are logged by `tell`. Raises
        `RunError` out of turn, after the last generation and after `close`. Which constraints the
        parents keep is not looked at, unless `prepare` was called.
        """
        if self._asked is None and not self._closed and not self._steered():
            by = self.stopped_by
            found = "was asked to stop" if by is None else f"has stopped: {by.words}"
            raise RunError(
                f"ask() of a search that {found}",
                "a search that goes on",
                "close() it; go on with: Search.resume(path)",
            )
        if self.recipe.search.window is not None:
            raise RunError(
                f"ask() of a search with a window of {self.recipe.search.window}",
                "a search whose births are planned a generation at a time",
                "leave `window` out of [search]",
            )
        breeding = self._breeding_of("ask()", guarded=False)
        self._asked = bred(self._pool, breeding.plans(*self._told()))
        return [one.bred.genome for one in to_evaluate(self._asked)]

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
        header, bounds = self._prepared.header, self._prepared.aims.bounds
        individuals = with_results(self._asked, results, header, bounds)
        return self._written(self._breeding.selected(individuals, self._next))

    # -- beginning and end ---------------------------------------------------------------

    def __enter__(self) -> "Search":
        self._entered = True
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        with contextlib.closing(self):
            self._stopped(error)

    def flush(self) -> None:
        """Return once all that was bred is written down. Raises `RunError` if it cannot be."""
        if self._writer is not None and not self._closed:
            self._writer.flush()

    def close(self) -> None:
        """Stop the workers, write down what waits, release the run folder. Safe to call twice."""
        self._closed = True
        if self._breeding is not None:
            self._breeding.close()
            self._breeding = None
        if self._pool is not None:
            self._pool.close()
            self._pool = None
        if self._writer is not None:
            self._writer.close()

    def _start(self, guarded: bool) -> None:
        refuse_passed(self.recipe.stop, self._clock)
        self.notes += told_to(self.recipe, self.out, self._observers)
        self._compile()
        self._prepared = prepare(self.recipe, self._tell)
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
        self._population, self._stopping = self._settled(), self._new_stopping()
        self._breeding = self._new_breeding()
        self._observers.event("start", seed=self.recipe.run.seed, **self._pool.described)

    def _settled(self) -> Archipelago:
        """Where nobody lives yet."""
        return Archipelago(self._prepared, self._steering.standing.weights, self._observers.event)

    def _new_breeding(self, taken: resuming.TakenUp | None = None) -> Generational | Steady:
        """Generations one after the other, or by the recipe's window, of a run ``taken`` up."""
        if self.recipe.search.window is None:
            return Generational(self._prepared, self._population, self._pool)
        if taken is None or not taken.next:
            return Steady(self._prepared, self._population, self._pool)
        run, event = open_run(taken.writer.path), self._observers.event
        found = Steady.taken_up(run, self._prepared, taken.next, self._pool, event)
        self._population = found.population
        self._population.reweigh(self._steering.standing.weights)
        taken.restore(self._population)
        return found

    def _new_stopping(self) -> Stopping:
        limits, aims, written = self.recipe.stop, self._prepared.aims, self._observers.wait
        return Stopping(limits, aims, self.out, self._clock, written)

    def _create(self) -> None:
        """Make the run folder, if the run is kept."""
        if self.out is not None:
            self._writer = Behind(writer_of(self._prepared, self.out, self._pool.described))
            self._observers.log(self._writer)

    def _compile(self) -> None:
        compile_once(sides_of(self.recipe, self._prepared), needed(self.recipe, True), self._tell)

    def _start_pool(self) -> None:
        told = self._prepared, self._crew, self._shipped, self._tell
        self._pool = pool_of(*told, lambda text: self._observers.event("retry", reason=text))
        self._pace = Pace(self._pool.size)

    def _stopped(self, error: BaseException | None) -> None:
        """Note why the run stops, once; what is not whole is dropped at the next resume."""
        if self._ended or self._closed:
            return
        if error is None:  # what cannot be written is why it stops
            self.flush()
        self._ended = True
        event, details = end_of(error, self.finished, self.asked_to_stop, self.stopped_by)
        self._observers.end(event, generation=self._next - 1, **details)

    def _refuse_closed(self, what: str) -> None:
        if self._closed:
            raise RunError(
                f"{what} after the search was closed",
                "a search that still holds its run",
                "ask() and tell() before close(), or within `with`; else: Search.resume(path)",
            )

    # -- commands ------------------------------------------------------------------------

    def _steered(self) -> bool:
        """Carry out what was asked since the last generation; whether the search goes on."""
        steering, weights = self._steering, self._steering.standing.weights
        lines = [] if self._writer is None else self._writer.commands(steering.standing.read)
        for event, details in steering.carry_out(lines, self._next):
            self._observers.event(event, **details)
            if details.get("command") == "reweight" and self._stopping is not None:
                self._stopping.judge_anew()
        if steering.standing.weights != weights and self._population is not None:
            self._population.reweigh(steering.standing.weights)
        return not steering.standing.stop and self.stopped_by is None

    def _found(self, ids: Sequence[int]) -> dict[int, Genome]:
        """The genomes of births by id, for picks."""
        self._observers.wait()
        living = [] if self._population is None else self._population.living
        return genomes_of(ids, None if self._writer is None else self.out, living)

    # -- one generation ------------------------------------------------------------------

    def _breeding_of(self, what: str, guarded: bool = True) -> Generational | Steady:
        """What breeds the next generation, which begins; what a run needs is prepared before the
        first, ``guarded`` or not by a look at what the parents keep."""
        self._refuse_closed(what)
        if self._asked is not None:
            untold = len(to_evaluate(self._asked))
            raise RunError(
                f"{what} while the {untold} genomes asked before are not told",
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
        self._pace.begin()
        return self._breeding

    def _told(self) -> tuple[int, Picks, Weights]:
        """What breeding must know of the next generation: its number, and what was asked for."""
        steering = self._steering
        weights = self._population.weights(self._next, steering.standing.weights)
        return self._next, steering.picks, weights

    def _written(self, births: Sequence[Birth]) -> Generation:
        """Write the next generation down whole: its ``births``, and those who live on."""
        self._births += len(births)
        self._failures += sum(not birth.ok for birth in births)
        generation = self._generation(births)
        self._observers.generation(generation, births, self._population.members)
        self._asked = None
        self._stopping.look(generation)
        self._next += 1
        limit = self.recipe.evaluation.max_failures
        refuse_failures(births, limit, generation.number, self._population.alive)
        return generation

    def _generation(self, births: Sequence[Birth]) -> Generation:
        rate, one = self._pace.end(births)
        return Generation(
            number=self._next,
            births=self._births,
            failures=self._failures,
            hypervolume=self._population.hypervolume,
            best=self._population.best,
            evaluations_per_second=rate,
            seconds_left=one * (self.recipe.run.generations - self._next),
            population=list(self._population.living),
            feasible=sum(not one.violation for one in self._population.living),
            algorithm=self._population.summary,
            islands=self._population.summaries,
        )
