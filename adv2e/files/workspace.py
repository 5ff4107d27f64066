"""Hidden folders in which outputs are written, and what killed runs left of them.

A run holds a lock on a file in its folder for as long as it lives; the system lets go of the lock,
however the run ends.  So a folder whose file can be locked is abandoned, and the next run beside it
removes it.  Where files cannot be locked none looks abandoned, and what a run on another machine
made is left alone: a file system may not know of locks elsewhere.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from adv2e.files.locks import lock_file

_NAME = re.compile(r"\.adv2e\.[0-9a-f]{8}\.part-?")
_LOCK, _JOURNAL = "lock", "journal.json"

Identity = tuple[int, int]
"""What tells a file or folder from all others, by whatever name: device and inode."""


class Workspace:
    """A hidden folder beside outputs, which other runs leave alone as long as this one lives.

    Parameters
    ----------
    folder : Path
        That of the outputs.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / f".adv2e.{secrets.token_hex(4)}.part"
        self._lock: BinaryIO | None = None

    @property
    def is_made(self) -> bool:
        """Whether it is there."""
        return self._lock is not None

    def make(self) -> None:
        """Make the folder and lock it."""
        lock = self.path / _LOCK
        while not lock.exists():  # again if, not locked yet, it looked abandoned to another run
            self.remove()
            self.path.mkdir(0o700, exist_ok=True)
            with suppress(FileNotFoundError):
                self._lock = lock.open("xb", buffering=0)
                self._lock.write(
                    _machine() if lock_file(self._lock, wait=True) else b"no locks here"
                )

    def note_placing(
        self, first: tuple[Path, Identity], outputs: Iterable[tuple[str, str, str]]
    ) -> None:
        """Note that all is written and comes into place from now on.

        Parameters
        ----------
        first : (Path, identity)
            Final name and identity of the output that comes first.
        outputs : iterable of (str, str, str)
            Names of the outputs here: while written, that of what they replace, the final one.
        """
        path, identity = first
        told = {"first": [str(path), *identity], "outputs": list(outputs)}
        with (self.path / _JOURNAL).open("x", encoding="ascii") as file:
            json.dump(told, file)
            file.flush()
            os.fsync(file.fileno())

    def hide(self) -> None:
        """Rename the folder, so that whoever writes into it by its name does not any longer."""
        hidden = self.path.with_name(self.path.name + "-")
        self.path.rename(hidden)
        self.path = hidden

    def remove(self) -> None:
        """Remove the folder and all in it, but for what is to be put back and cannot be."""
        if self._lock is not None:
            _remove(self.path, self._lock)
            self._lock = None


def remove_abandoned(folder: Path) -> None:
    """Remove what dead runs left in a folder.

    If one was killed while its outputs came into place, that is brought to its end where the first
    of them is in place, else what was there before is put back.
    """
    with suppress(OSError):
        found = [entry for entry in os.scandir(folder) if _NAME.fullmatch(entry.name)]
        for entry in found:
            with suppress(OSError):
                if entry.is_dir(follow_symlinks=False) and is_ours(
                    entry.stat(follow_symlinks=False)
                ):
                    _remove_if_abandoned(Path(entry.path))


def _remove_if_abandoned(path: Path) -> None:
    file = path / _LOCK
    if not file.exists():
        path.rmdir()  # if it is empty: the run was killed before it could lock it
        return
    with file.open("r+b", buffering=0) as lock:
        if (
            _may_be_dead(lock.read())
            and lock_file(lock, wait=False)
            and os.path.samestat(os.fstat(lock.fileno()), file.stat())
        ):
            _remove(path, lock)


def _remove(path: Path, lock: BinaryIO) -> None:
    with suppress(OSError), lock:
        _settle(path)
        shutil.rmtree(path, ignore_errors=True)
        lock.close()
        shutil.rmtree(path, ignore_errors=True)  # Windows removes no open file


def _settle(path: Path) -> None:
    """Finish or undo what is noted as coming into place.

    Raises
    ------
    OSError
        Something could not be put in its place.
    """
    try:
        told = json.loads((path / _JOURNAL).read_text(encoding="ascii"))
    except (FileNotFoundError, ValueError):  # nothing came into place before the note was whole
        return
    first, *identity = told["first"]
    is_placed = identity_of(Path(first)) == tuple(identity)
    for new, old, final in told["outputs"]:
        source, target = path / (new if is_placed else old), path.with_name(final)
        if os.path.lexists(source) and not os.path.lexists(target):
            source.rename(target)


def identity_of(path: Path) -> Identity | None:
    """Return the identity of what has a name; None: nothing has it."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def is_ours(status: os.stat_result) -> bool:
    """Tell whether a file or folder of this status belongs to this user."""
    return os.name != "posix" or status.st_uid == os.geteuid()


def _may_be_dead(told: bytes) -> bool:
    """Tell whether a lock that is free tells of a dead run, which it does on one machine."""
    pairs = zip(told.split(b"\n"), _machine().split(b"\n"), strict=False)
    return not told or any(there == here != b"" for there, here in pairs)


def _machine() -> bytes:
    """Return what tells machines apart: the name, and what the system drew when it started."""
    name = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
    start = b""
    with suppress(OSError):
        start = Path("/proc/sys/kernel/random/boot_id").read_bytes().strip()
    return os.fsencode(name) + b"\n" + start
