"""Which run folders may execute what they bring: those that were begun, or trusted, here.

A secret key of the user's, outside of all run folders, signs what a run executes. A stranger has no
such key, and so can neither forge a mark nor change what a marked run executes.
"""

import contextlib
import hashlib
import hmac
import json
import os
import secrets
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from evocity.errors import RunError, keyword, shown
from evocity.store import Run

_BYTES = 32
#: So many machines may have marked a run; the oldest are forgotten.
_MOST_MARKS = 16


def state_folder() -> Path:
    """Where evocity keeps what it remembers for this user."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "evocity"
    named = os.environ.get("XDG_STATE_HOME")
    if named and os.path.isabs(named):
        return Path(named) / "evocity"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "evocity"
    return Path.home() / ".local" / "state" / "evocity"


def _key(make: bool) -> bytes | None:
    """The user's secret; None where there is none, or nowhere to keep it."""
    with contextlib.suppress(OSError, RuntimeError):  # a user without a home
        path = state_folder() / "key"
        if make and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            temporary = path.with_name(f".key-{secrets.token_hex(4)}")
            try:
                descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(descriptor, "wb") as file:
                    file.write(secrets.token_bytes(_BYTES))
                    file.flush()
                    os.fsync(file.fileno())
                if not path.exists():  # of two processes the last key counts
                    os.replace(temporary, path)
            finally:
                temporary.unlink(missing_ok=True)
        key = path.read_bytes()
        return key if len(key) == _BYTES else None
    return None


def marked(provenance: Mapping, recipe_text: str, out: str | os.PathLike) -> dict:
    """The ``provenance`` of the run in ``out`` with a mark that it may execute here what it does
    by its ``recipe_text``. As it is where no key can be kept."""
    mark = _mark(provenance, recipe_text, Path(out), _key(True))
    if mark is None:
        return dict(provenance)
    before = [one for one in provenance.get("marks", []) if one != mark]
    return {**provenance, "marks": [*before[1 - _MOST_MARKS :], mark]}


def _mark(provenance: Mapping, recipe_text: str, out: Path, key: bytes | None) -> str | None:
    if key is None:
        return None
    recipe = provenance["recipe"]
    measures = [
        [one.get(name) for name in ("name", "file", "kept", "beside", "hash")]
        for kind in ("fitness", "recorded")
        for one in provenance.get(kind, [])
    ]
    signed = [_executed(recipe_text, recipe), measures]
    if commands_of(recipe_text):  # what lies in their folder is theirs to execute
        signed.append(str((out.resolve() / recipe["folder"]).resolve()))
    content = json.dumps(signed, sort_keys=True).encode()
    return hmac.new(key, content, hashlib.sha256).hexdigest()


def commands_of(recipe_text: str) -> list[str]:
    """The commands that a recipe has run, and the cluster that it connects to."""
    raw = _raw(recipe_text)
    found = []
    for section, keys in (("notify", ("on_improvement", "on_end")), ("evaluation", ("cluster",))):
        table = raw.get(section)
        told = [table.get(key) for key in keys] if isinstance(table, dict) else []
        found += [one for one in told if isinstance(one, str) and not one.startswith("local:")]
    return found


def executed_by(run: Run) -> list[str]:
    """In words, what going on with a ``run`` executes that it brings itself: files of measures, and
    commands. Nothing is executed to find out."""
    return _executed(run.recipe_text, run.provenance["recipe"])


def _executed(text: str, about: Mapping) -> list[str]:
    """The same, by the ``text`` of a recipe and what provenance tells ``about`` it."""
    sections = (one for key, one in _raw(text).items() if key != "notify")
    files = dict.fromkeys(one for one in _files(list(sections)) if one.endswith(".py"))
    cluster = about.get("overrides", {}).get("evaluation.cluster")
    others = [cluster] if isinstance(cluster, str) else []
    return [*files, *(shown(one) for one in [*commands_of(text), *others])]


def untrusted(run: Run) -> list[str]:
    """What a ``run`` would execute, as in `executed_by`, if it was not begun here, nor trusted;
    nothing of one that was."""
    found = executed_by(run)
    return found if found and not is_ours(run) else []


def is_ours(run: Run) -> bool:
    """Whether a ``run`` was begun, or trusted, on this machine by this user."""
    mark = _mark(run.provenance, run.recipe_text, run.path, _key(False))
    marks = [one for one in run.provenance.get("marks", []) if isinstance(one, str)]
    return mark is not None and any(hmac.compare_digest(mark, one) for one in marks)


def refuse_untrusted(run: Run, changed: bool = False) -> None:
    """Raise `RunError` if a ``run`` that was not begun here would execute anything of its own; or
    one that was, whose own copies of measures may have ``changed``."""
    found = executed_by(run) if changed else untrusted(run)
    if not found:
        return
    told = ", ".join(found[:4]) + (f" and {len(found) - 4} more" if len(found) > 4 else "")
    raise RunError(
        f"{run.path} was not begun on this machine, and would execute what it brings: {told}",
        "a run that was begun here, or that executes nothing of its own",
        f"look at these, then confirm them with {keyword('trust', True)}",
    )


def _raw(text: str) -> dict:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):  # told where the recipe is read
        return {}


def _files(raw) -> Iterator[str]:
    """All that stands for a file of measures anywhere in a recipe."""
    if isinstance(raw, Mapping):
        if isinstance(raw.get("file"), str):
            yield raw["file"]
        raw = raw.values()
    elif isinstance(raw, str) and raw.endswith(".py"):  # in run.record
        yield raw
    if isinstance(raw, str):
        return
    with contextlib.suppress(TypeError):
        for one in raw:
            yield from _files(one)


__all__ = ["executed_by", "is_ours", "marked", "refuse_untrusted", "state_folder", "untrusted"]
