"""Writing under temporary names, so that a final name only ever holds finished work.

Outputs are written in a hidden folder beside their final names, where a rename is a single step.
An output may be several files (events and the metadata beside them) or a folder: they come into
place together or not at all, and what they replace stays until then.

Killed at any instant, a run leaves what was there before or what it made, whole.  Of several
outputs those after the first may be missing then, but never tell about another file than the one
beside them.  What they were to replace lies in the hidden folder, which the next run in that folder
tells of, and else removes (:mod:`adv2e.files.workspace`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from adv2e.errors import OutputError
from adv2e.files.states import are_one, check_distinct
from adv2e.files.workspace import (
    Workspace,
    exchange,
    move_to_free,
    remove_abandoned,
    sync,
    sync_one,
)
from adv2e.process import signals

Identity = tuple[int, int]
"""Identity of a file or folder under any name: device and inode."""


@dataclass(eq=False)
class _Output:
    """Output file or folder: as the user named it, its final and its temporary path, its workspace.

    `identity` is that of the file or folder that was written.
    """

    named: Path
    final: Path
    temporary: Path
    workspace: Workspace
    identity: Identity | None = None

    @property
    def is_placed(self) -> bool:
        return self.identity is not None and _identity_of(self.final) == self.identity


class Staging(signals.Unfinished):
    """Files and folders on their way to their final names.

    First they are named with :meth:`file` and :meth:`folder`, which check and touch nothing; then
    :meth:`prepare`; then they are written; then :meth:`commit` or :meth:`discard`, which the end of
    a ``with`` block calls.

    Parameters
    ----------
    overwrite : bool
        Outputs that exist are replaced, at the end.
    inputs : iterable of str or Path
        Files that are read, where nothing may be written; see :func:`check_distinct`.
    """

    def __init__(self, overwrite: bool, inputs: Iterable[str | Path] = ()) -> None:
        self._overwrite = overwrite
        self._inputs = list(inputs)
        self._outputs: list[_Output] = []
        self._workspaces: dict[Path, Workspace] = {}
        self._made: list[Path] = []
        self._committing = False

    def __enter__(self) -> Staging:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.commit()
        finally:
            self.discard()

    def file(self, path: Path) -> Path:
        """Return the temporary name of the file `path`, with its suffix.

        Raises
        ------
        OutputError
            `path` exists and is not to be replaced, is not a file, is below a file, or is read.
        """
        final = self._final(path)
        if final.is_dir():
            raise OutputError(f"{path}: is a folder, and a file is to be written")
        if os.path.lexists(final) and not final.is_file():
            raise OutputError(f"{path}: is not a regular file")
        return self._add(path, final)

    def folder(self, path: Path, foreign: Callable[[Path], str | None]) -> Path:
        """Return the temporary name of the folder `path`.

        Parameters
        ----------
        foreign : callable
            Names something in a folder that must not be lost by replacing it, or None.

        Raises
        ------
        OutputError
            `path` exists and is not to be replaced, is a file, holds other things than such
            outputs do, is below a file, or is read.
        """
        final = self._final(path)
        if os.path.lexists(final):
            if not final.is_dir():
                raise OutputError(f"{path}: is a file, and a folder is to be written")
            other = foreign(final) if self._overwrite else None
            if other is not None:
                raise OutputError(
                    f"{path}: holds {other}, which would be lost: choose another folder"
                )
        return self._add(path, final)

    def _final(self, path: Path) -> Path:
        """Return the path with links resolved: a symbolic link stays, its target is replaced."""
        check_distinct(path, self._inputs)
        final = Path(os.path.realpath(path))
        if not final.name:
            raise OutputError(f"{path}: cannot be replaced, choose a name below it")
        try:
            final.lstat()
        except (FileNotFoundError, NotADirectoryError):
            pass
        except OSError as error:  # its name is too long, or nothing may be seen there
            raise OutputError(f"{path}: {error.strerror}") from None
        return final

    def _add(self, path: Path, final: Path) -> Path:
        self._check_free(path, final)
        above = nearest_there(final)
        if not above.is_dir():
            raise OutputError(f"{path}: {above} is not a folder")
        for other in self._outputs:
            if are_one(final, other.final):
                raise OutputError(f"{path}: is to be two outputs; choose another name")
            if other.final in final.parents or final in other.final.parents:
                raise OutputError(
                    f"{path} and {other.named}: one lies in the other; choose another name"
                )
        workspace = self._workspaces.setdefault(final.parent, Workspace(final.parent))
        # OpenCV and others choose the format by the suffix
        name = f"{len(self._outputs)}{re.sub(r'[^A-Za-z0-9._-]', '_', final.suffix)[:20]}"
        self._outputs.append(_Output(path, final, workspace.written(name), workspace))
        return self._outputs[-1].temporary

    def _check_free(self, path: Path, final: Path) -> None:
        if os.path.lexists(final) and not self._overwrite:
            raise OutputError(f"{path}: exists already; --overwrite replaces it")

    def prepare(self) -> None:
        """Make the folders that the outputs are to lie in, and clear them of what runs left."""
        signals.add(self)
        for folder, workspace in self._workspaces.items():
            if workspace.is_made:
                continue
            missing = takewhile(lambda above: not above.exists(), (folder, *folder.parents))
            for above in reversed(list(missing)):
                self._made.append(above)
                above.mkdir(exist_ok=True)
            remove_abandoned(folder)
            workspace.make()

    def commit(self) -> None:
        """Give all outputs their final names; if that fails, everything is as it was.

        Raises
        ------
        OutputError
            One cannot be written, or exists by now and is not to be replaced.
        """
        if not self._outputs:
            return
        self._committing = True
        at_work = first = self._outputs[0]
        try:
            for at_work in self._outputs:
                self._check_free(at_work.named, at_work.final)
                sync(at_work.temporary)
                at_work.identity = _identity_of(at_work.temporary)
            # the others may tell about the first, and must not tell about the one that it replaces
            for at_work in self._outputs[1:]:
                if os.path.lexists(at_work.final):
                    at_work.workspace.put_aside(at_work.final)
            for at_work in self._outputs:
                self._place(at_work, replaces=self._overwrite and at_work is first)
        except BaseException as error:
            self._roll_back()
            if isinstance(error, FileExistsError):
                self._check_free(at_work.named, at_work.final)
            if isinstance(error, OSError):
                raise OutputError(
                    f"{at_work.named}: cannot be written: {error.strerror or error}"
                ) from error
            raise
        for folder, workspace in self._workspaces.items():
            with suppress(OSError):
                sync_one(folder)
            workspace.drop_aside()
        self._end()

    def _place(self, output: _Output, *, replaces: bool) -> None:
        final, temporary = output.final, output.temporary
        if not replaces or not os.path.lexists(final):
            move_to_free(temporary, final)
        elif exchange(temporary, final):
            pass
        elif len(self._outputs) == 1 and not temporary.is_dir():
            temporary.replace(final)
        else:
            output.workspace.put_aside(final, linked=True)
            temporary.replace(final)

    def _roll_back(self) -> None:
        """Take back what came into place, and put back what lies aside."""
        if all(output.is_placed for output in self._outputs):
            for workspace in self._workspaces.values():
                workspace.drop_aside()
            return
        for output in reversed(self._outputs):
            if output.is_placed:
                there = _identity_of(output.temporary)
                with suppress(OSError):
                    if there is None:
                        output.final.rename(output.temporary)
                    elif there == output.identity:
                        output.final.unlink()  # it has both names
                    else:
                        exchange(output.temporary, output.final)
            output.workspace.put_back(output.final)

    def discard(self) -> None:
        """Remove everything temporary, and the folders made for it."""
        self._end()
        for folder in reversed(self._made):
            with suppress(OSError):  # something else may lie in it by now
                folder.rmdir()

    def _end(self) -> None:
        for workspace in self._workspaces.values():
            workspace.remove()
        signals.drop(self)

    def remove_now(self) -> bool:
        """Remove everything temporary although it may be written to at this moment.

        Not while it comes into place, which the one who does it can undo better; nor where open
        files cannot be removed, as on Windows.
        """
        if self._committing:
            return False
        made = [workspace for workspace in self._workspaces.values() if workspace.is_made]
        for workspace in made:
            workspace.hide()
        self.discard()
        return not any(workspace.path.exists() for workspace in made)


def _identity_of(path: Path) -> Identity | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def nearest_there(path: Path) -> Path:
    """Return the nearest folder above a path that exists, in which the path would be made."""
    return next(above for above in path.parents if os.path.lexists(above))


@contextmanager
def writing(name: str | Path) -> Iterator[None]:
    """Turn an OSError in the body, such as a full disk, into an OutputError with the name."""
    try:
        yield
    except BrokenPipeError:  # of standard output: nobody reads any more
        raise
    except OSError as error:
        raise OutputError(f"{name}: cannot be written: {_reason(error)}") from error


def _reason(error: OSError) -> str:
    """Return the message of the system, which HDF5 wraps in addresses and offsets."""
    text = error.strerror or str(error)
    inner = re.search(r"error message = '([^']*)'", text)
    return inner[1] if inner else text
