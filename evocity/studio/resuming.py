"""A run that is stopped, or taken up again: by the commands that one would type."""

import hashlib
from pathlib import Path
from typing import Annotated

from evocity.errors import RunError
from evocity.search import commands
from evocity.search.opening import open_run
from evocity.search.trust import is_ours, refuse_untrusted, state_folder
from evocity.store.lock import is_held
from evocity.studio.apart import Carried
from evocity.studio.asked import Body, whole


class Resume(Body):
    """Go on; ``generations`` of the whole run, None for as many as it was begun with."""

    generations: Annotated[int | None, whole("to generation", 1, 99_999_999)] = None


def log_of(run: Path) -> Path:
    """The file for what a process says that carries out a ``run``: with its recipe, where it was
    begun at the desk, else with what evocity remembers for this user; never in the run, and never
    beside a stranger's."""
    beside = run.with_name(f"{run.name}-recipe")
    own = not beside.is_symlink() and (beside / "recipe.toml").is_file()
    if own and (not run.exists() or is_ours(open_run(run))):
        return beside / "run.log"
    called = hashlib.blake2b(str(run).encode(errors="replace"), digest_size=8).hexdigest()
    return state_folder() / "logs" / f"{called}.log"


def stop(run: Path) -> None:
    """Have a run end after the generation that it breeds. Raises `RunError` where none goes on."""
    commands.send(run, commands.Stop())


def resume(run: Path, carried: Carried, asked: Resume) -> None:
    """Go on with a run by `evocity resume`. Raises `RunError` where it goes on, and for one that
    was not begun here and would execute something of its own."""
    found = open_run(run)
    if is_held(run / "lock"):
        raise RunError(f"{run}: a process is at it", "a run that has ended", "stop it first")
    try:
        refuse_untrusted(found)
    except RunError as error:
        remedy = f"look at these, then, in a terminal: evocity resume {run} --trust"
        raise RunError(error.found, error.expected, remedy) from None
    more = [] if asked.generations is None else ["--generations", str(asked.generations)]
    carried.begin(run, ["resume", str(run), *more], log_of(run))


__all__ = ["Resume", "log_of", "resume", "stop"]
