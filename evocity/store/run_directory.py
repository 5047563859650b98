"""`RunDirectory`: the files of a run folder, read and written without following a link.

A stranger's folder may hold links to other places, pipes that never answer, endless devices. Every
part is reached from a descriptor of the run folder, one folder after the other. Where the system
has no access by descriptors (Windows), each folder on the way is looked at first.
"""

import contextlib
import errno
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath, PurePosixPath
from typing import BinaryIO, cast

from pydantic_core import from_json

from evocity.errors import RunError

#: Bytes of a text, JSON or event file of a run, at most.
MOST_BYTES = 64 * 2**20
#: The kinds of parts: what `RunDirectory.entries` returns.
FILE, FOLDER, LINK, OTHER = "file", "folder", "link", "other"

_SAFELY = sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
)
_BY_DESCRIPTOR = (
    hasattr(os, "O_NOFOLLOW")
    and {os.open, os.stat, os.mkdir, os.rename, os.unlink, os.rmdir} <= os.supports_dir_fd
    and os.scandir in os.supports_fd
)
_TO_FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_CLOEXEC", 0)


class RunDirectory:
    """The run folder ``root``, which may itself be reached through a link; no part of it may.

    A ``part`` is a path that begins with ``root``, or a text relative to it, such as "births". All
    methods raise `RunError` if the part, or a folder on the way to it, is a link or another special
    file, before they write anything. They raise OSError, FileNotFoundError for a missing part.

    Each call opens the folder at ``root`` again, unless `hold` was called: then all calls work in
    the folder that was there, whatever stands at ``root`` later.
    """

    def __init__(self, root: str | os.PathLike):
        self._held: int | None = None
        self.root = Path(root)

    def hold(self) -> None:
        """Open the folder once for all later calls, until `release`."""
        if _BY_DESCRIPTOR and self._held is None:
            self._held = os.open(self.root, _TO_FOLDER)

    def release(self) -> None:
        """Close the folder that `hold` opened. A second call changes nothing."""
        held, self._held = self._held, None
        if held is not None:
            os.close(held)

    def __del__(self):
        self.release()

    def check_in_place(self) -> None:
        """Raise OSError unless the folder that `hold` opened still stands at ``root``."""
        there = os.stat(self.root)
        if self._held is not None and not os.path.samestat(os.fstat(self._held), there):
            raise FileNotFoundError(errno.ENOENT, "another folder is in its place", str(self.root))

    # -- reading -------------------------------------------------------------------------

    def exists(self, part: str | PurePath) -> bool:
        """Return whether something of any kind is at ``part``."""
        self._names(part)
        try:
            self.stat(part)
        except (OSError, ValueError):  # as `os.path.lexists`
            return False
        return True

    def stat(self, part: str | PurePath) -> os.stat_result:
        """Return the state of a part of any kind; a link is not followed."""
        with self._place(part) as (name, handle):
            return os.stat(name, dir_fd=handle, follow_symlinks=False)

    def states(self, part: str | PurePath) -> dict[str, os.stat_result]:
        """Return the states of all that is in a plain folder, by name; links are not followed."""
        states = {}
        with (
            self._folder(part) as handle,
            os.scandir(self._path(part) if handle is None else handle) as entries,
        ):
            for entry in entries:
                with contextlib.suppress(FileNotFoundError):  # replaced in this moment
                    states[entry.name] = entry.stat(follow_symlinks=False)
        return states

    def open(self, part: str | PurePath) -> BinaryIO:
        """Open a plain file to read."""
        with self._place(part) as (name, handle):
            self._check(part, name, handle, FILE)
            return self._plain(part, self._open(part, "rb", name, os.O_RDONLY, handle))

    def read(self, part: str | PurePath) -> bytes:
        """Return all bytes of a plain file of at most `MOST_BYTES`."""
        with self.open(part) as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise RunError(
                f"{self._path(part)} has more than {MOST_BYTES // 2**20} MiB",
                "a smaller file, as `evocity run` writes it",
                "restore the file from a backup",
            )
        return content

    def read_json(self, part: str | PurePath):
        """Return the JSON document in a plain file. Raises ValueError, also for one nested too
        deep."""
        return from_json(self.read(part))

    def entries(self, part: str | PurePath = ".") -> dict[str, str]:
        """Return the names in a plain folder, sorted, each with its kind."""
        with (
            self._folder(part) as handle,
            os.scandir(self._path(part) if handle is None else handle) as entries,
        ):
            return dict(sorted((entry.name, _kind_of_entry(entry)) for entry in entries))

    def check_file(self, part: str | PurePath) -> None:
        """Raise `RunError` unless ``part`` is a plain file."""
        with self._place(part) as (name, handle):
            self._check(part, name, handle, FILE)

    def check_folder(self, part: str | PurePath) -> None:
        """Raise `RunError` unless ``part`` is a plain folder."""
        with self._folder(part):
            pass

    # -- writing -------------------------------------------------------------------------

    def check_replaceable(self, part: str | PurePath) -> None:
        """Raise `RunError` unless ``part`` is a plain file, or missing."""
        with self._place(part) as (name, handle), contextlib.suppress(FileNotFoundError):
            self._check(part, name, handle, FILE)

    def check_appendable(self, part: str | PurePath) -> None:
        """Raise `RunError` unless ``part`` is a plain file with a single name, or missing."""
        with contextlib.suppress(FileNotFoundError):
            self.check_file(part)
            self._check_single(part, self.stat(part))

    @contextmanager
    def write(self, part: str | PurePath) -> Iterator[BinaryIO]:
        """Yield a temporary file, open to read and write; on success flush it and rename it to
        ``part``. After an error ``part`` is as before."""
        with self._place(part) as (name, handle):
            with contextlib.suppress(FileNotFoundError):
                self._check(part, name, handle, FILE)
            path = PurePath(name)
            temporary = str(path.with_name(f".{path.stem}-{secrets.token_hex(4)}{path.suffix}"))
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL
            file = self._open(part, "rb+", temporary, flags, handle)
            try:
                with file:
                    yield file
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(temporary, name, src_dir_fd=handle, dst_dir_fd=handle)
                _flush(handle, path.parent)
            except BaseException:
                with contextlib.suppress(OSError):
                    os.unlink(temporary, dir_fd=handle)
                raise

    def write_bytes(self, part: str | PurePath, content: bytes) -> None:
        """Write a file whole, or not at all."""
        with self.write(part) as file:
            file.write(content)

    def append(self, part: str | PurePath) -> BinaryIO:
        """Open a plain file to read and append; create it if it is missing. Raises `RunError` for a
        file that has another name too: the bytes would also appear there."""
        self.check_appendable(part)
        with self._place(part) as (name, handle):
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND
            file = self._plain(part, self._open(part, "ab+", name, flags, handle))
        try:
            self._check_single(part, os.fstat(file.fileno()))
        except BaseException:
            file.close()
            raise
        return file

    def make_folder(self, part: str | PurePath, exist_ok: bool = False) -> None:
        """Make a folder; with ``exist_ok`` it may be there, and folders on the way are made."""
        names = self._names(part)
        for number in range(1 if exist_ok else len(names), len(names) + 1):
            inner = "/".join(names[:number])
            with self._place(inner) as (name, handle):
                try:
                    os.mkdir(name, dir_fd=handle)
                except FileExistsError:
                    if not exist_ok:
                        raise
                    self._check(inner, name, handle, FOLDER)

    def rename(self, part: str | PurePath, new: str | PurePath) -> None:
        """Rename a plain file or folder; a file at ``new`` is replaced."""
        with self._place(part) as (name, handle), self._place(new) as (target, other):
            kind = _kind(os.stat(name, dir_fd=handle, follow_symlinks=False).st_mode)
            self._check(part, name, handle, FOLDER if kind == FOLDER else FILE)
            os.replace(name, target, src_dir_fd=handle, dst_dir_fd=other)

    def remove(self, part: str | PurePath) -> None:
        """Remove a file, or a link itself, if it is there."""
        with (
            contextlib.suppress(FileNotFoundError),
            self._place(part) as (name, handle),
        ):
            os.unlink(name, dir_fd=handle)

    def remove_folder(self, part: str | PurePath) -> None:
        """Remove a plain folder with its contents; of links in it, only the links."""
        with self._place(part) as (name, handle):
            self._check(part, name, handle, FOLDER)
            if handle is None:
                shutil.rmtree(name)
            else:
                shutil.rmtree(name, dir_fd=handle)

    def flush(self, part: str | PurePath = ".") -> None:
        """Make renames in a folder survive a power cut, where the system can flush folders."""
        with self._folder(part) as handle:
            _flush(handle, self._path(part))

    # -- the way to a part ---------------------------------------------------------------

    def _names(self, part: str | PurePath) -> tuple[str, ...]:
        inner = PurePosixPath(part) if isinstance(part, str) else part.relative_to(self.root)
        if inner.is_absolute() or ".." in inner.parts:
            raise ValueError(f"{str(part)!r} is not a part of a run folder")
        return inner.parts

    def _path(self, part: str | PurePath) -> Path:
        return self.root.joinpath(*self._names(part))

    @contextmanager
    def _place(self, part: str | PurePath) -> Iterator[tuple[str, int | None]]:
        """Yield the name of a part, and the descriptor of its folder; a path and None where the
        system has no access by descriptors."""
        *above, name = self._names(part)
        with self._folder("/".join(above)) as handle:
            yield (str(self._path(part)) if handle is None else name), handle

    @contextmanager
    def _folder(self, part: str | PurePath) -> Iterator[int | None]:
        """Yield the descriptor of a plain folder, or None as `_place`."""
        names = self._names(part)
        if not _BY_DESCRIPTOR:
            for number in range(1, len(names) + 1):
                inner = "/".join(names[:number])
                self._check(inner, str(self._path(inner)), None, FOLDER)
            yield None
            return
        held = self._held
        # a description of its own, with its own place
        handle = os.open(self.root if held is None else ".", _TO_FOLDER, dir_fd=held)
        try:
            for number, name in enumerate(names, 1):
                self._check("/".join(names[:number]), name, handle, FOLDER)
                within = os.open(name, _TO_FOLDER | os.O_NOFOLLOW, dir_fd=handle)
                os.close(handle)
                handle = within
            yield handle
        finally:
            os.close(handle)

    def _check(self, part: str | PurePath, name: str, handle: int | None, wanted: str) -> None:
        """Raise `RunError` unless the part ``name`` of a folder is of the kind ``wanted``."""
        kind = _kind(os.stat(name, dir_fd=handle, follow_symlinks=False).st_mode)
        if kind != wanted:
            raise refusal(self._path(part), kind, wanted)

    def _open(
        self, part: str | PurePath, mode: str, name: str, flags: int, handle: int | None
    ) -> BinaryIO:
        """Open the file ``name`` of a folder; for its user it has the path of the ``part``."""

        def opener(path: str, _: int) -> int:
            return os.open(name, flags | _SAFELY, 0o666, dir_fd=handle)

        return cast(BinaryIO, open(self._path(part), mode, opener=opener))

    def _plain(self, part: str | PurePath, file: BinaryIO) -> BinaryIO:
        """Return an open ``file``, which may have been exchanged since it was looked at."""
        kind = _kind(os.fstat(file.fileno()).st_mode)
        if kind != FILE:
            file.close()
            raise refusal(self._path(part), kind, FILE)
        return file

    def _check_single(self, part: str | PurePath, state: os.stat_result) -> None:
        if state.st_nlink > 1:
            raise RunError(
                f"{self._path(part)} is a hard link: {state.st_nlink} names stand for one file",
                "a file with a single name, because evocity appends to it",
                "replace the file by a copy of the file",
            )


def refusal(path: Path, kind: str, wanted: str) -> RunError:
    """Return the error for a part of a run that is of another ``kind`` than ``wanted``."""
    return RunError(
        f"{path} is {'a link' if kind == LINK else f'not a plain {wanted}'}",
        "only plain files and folders, so that evocity neither reads nor writes anything outside a "
        "run folder",
        "replace the links by copies, but only if you know the sender of the folder",
    )


def _kind(mode: int) -> str:
    if stat.S_ISREG(mode):
        return FILE
    if stat.S_ISDIR(mode):
        return FOLDER
    return LINK if stat.S_ISLNK(mode) else OTHER


def _kind_of_entry(entry: os.DirEntry) -> str:
    if entry.is_file(follow_symlinks=False):
        return FILE
    if entry.is_dir(follow_symlinks=False):
        return FOLDER
    return LINK if entry.is_symlink() else OTHER


def _flush(handle: int | None, folder: PurePath) -> None:
    """Flush a folder by its descriptor, or by its path; some systems cannot."""
    with contextlib.suppress(OSError):
        if handle is not None:
            os.fsync(handle)
            return
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
