"""Trust in run folders: only those that this user began, or confirmed, execute what they bring.

A secret key of the user's, outside of all run folders, signs what a run executes. A stranger lacks
the key, and so can neither forge a mark nor change what a marked run executes.
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
from dataclasses import dataclass
from pathlib import Path

from evocity.errors import RunError, keyword, spell
from evocity.store import RunLog

_BYTES = 32
#: The most marks of a run, one for each user and machine; the oldest are dropped.
_MOST_MARKS = 16


@dataclass(frozen=True)
class Permission:
    """The permission of a user for a run: ``trust`` executes the files and commands that it brings
    from another machine; ``accept_changes`` accepts changes of recipe, maps and measures."""

    trust: bool = False
    accept_changes: bool = False


NO_PERMISSION = Permission()


def state_folder() -> Path:
    """Return the folder where evocity keeps this user's key and settings."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "evocity"
    named = os.environ.get("XDG_STATE_HOME")
    if named and os.path.isabs(named):
        return Path(named) / "evocity"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "evocity"
    return Path.home() / ".local" / "state" / "evocity"


def _key(make: bool) -> bytes | None:
    """The user's secret; None without a key, or a place to keep it."""
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


def add_mark(provenance: Mapping, recipe_text: str, out: str | os.PathLike) -> dict:
    """Return the ``provenance`` of the run in ``out`` with a mark: it may execute here what it does
    by its ``recipe_text``. Without a key it stays as it is."""
    mark = _mark(provenance, recipe_text, Path(out), _key(True))
    if mark is None:
        return dict(provenance)
    before = [other for other in provenance.get("marks", []) if other != mark]
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
    signed = [_executable_parts(recipe_text, recipe), measures]
    if commands_of(recipe_text):  # they may execute what lies in their folder
        signed.append(str((out.resolve() / recipe["folder"]).resolve()))
    content = json.dumps(signed, sort_keys=True).encode()
    return hmac.new(key, content, hashlib.sha256).hexdigest()


def commands_of(recipe_text: str) -> list[str]:
    """Return the commands that a recipe runs, and the cluster that it connects to."""
    raw = _raw(recipe_text)
    commands = []
    for section, keys in (("notify", ("on_improvement", "on_end")), ("evaluation", ("cluster",))):
        table = raw.get(section)
        values = [table.get(key) for key in keys] if isinstance(table, dict) else []
        commands += [v for v in values if isinstance(v, str) and not v.startswith("local:")]
    return commands


def list_executed(run: RunLog) -> list[str]:
    """Describe what a resumed ``run`` executes that it brings itself: measure files, and commands.
    Nothing is executed here."""
    return _executable_parts(run.recipe_text, run.provenance["recipe"])


def _executable_parts(text: str, about: Mapping) -> list[str]:
    sections = (section for key, section in _raw(text).items() if key != "notify")
    files = dict.fromkeys(name for name in _files(list(sections)) if name.endswith(".py"))
    cluster = about.get("overrides", {}).get("evaluation.cluster")
    others = [cluster] if isinstance(cluster, str) else []
    return [*files, *(spell(command) for command in [*commands_of(text), *others])]


def list_untrusted(run: RunLog) -> list[str]:
    """Describe what a ``run`` would execute, as `list_executed`, if it is not trusted; nothing if
    it is."""
    executed = list_executed(run)
    return executed if executed and not is_trusted(run) else []


def is_trusted(run: RunLog) -> bool:
    """Whether this user began a ``run``, or confirmed it, on this machine."""
    mark = _mark(run.provenance, run.recipe_text, run.path, _key(False))
    marks = [other for other in run.provenance.get("marks", []) if isinstance(other, str)]
    return mark is not None and any(hmac.compare_digest(mark, other) for other in marks)


def refuse_untrusted(run: RunLog, changed: bool = False) -> None:
    """Raise `RunError` if a ``run`` that is not trusted would execute anything of its own. If it
    ``changed``, no run is trusted: its copies of measures may be others."""
    executed = list_executed(run) if changed else list_untrusted(run)
    if not executed:
        return
    more = f" and {len(executed) - 4} more" if len(executed) > 4 else ""
    raise RunError(
        f"{run.path} was not started on this machine, and would execute files or commands: "
        f"{', '.join(executed[:4])}{more}",
        "a run that was started on this machine, or that executes no files or commands",
        f"read these files and commands, then confirm them with {keyword('trust', True)}",
    )


def _raw(text: str) -> dict:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):  # the reader of the recipe reports it
        return {}


def _files(raw) -> Iterator[str]:
    """All names of measure files anywhere in a recipe."""
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
