"""Writing under temporary names, so that a final name only ever holds finished work.

Temporary names lie in the folder of the final one, where a rename is a single step.  An output
may be several files (events and the metadata beside them) or a folder: they come into place
together or not at all, and what they replace stays until then.

Killed at any instant, a run leaves what was there before or what it made, whole.  Of two files, one
that tells about the other is moved aside first and comes into place last: for an instant it is
missing, but never tells about another file than the one beside it.  What is left otherwise, the
next run in that folder removes (:mod:`adv2e.files.leavings`).
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from adv2e.errors import OutputError
from adv2e.files.apart import check_apart
from adv2e.files.leavings import Claim, Names, clear, remove
from adv2e.files.renaming import exchange, move_to_free, sync, sync_names
from adv2e.process import cleanup as unfinished


@dataclass(eq=False)
class _Output:
    """One file or folder to be: as the user named it, where it will lie, where it is written.

    `aside` is where what it replaces lies meanwhile; `about` is the output that it tells about;
    `identity` is that of the finished file or folder, and `replaces` whether there is another.
    """

    named: Path
    final: Path
    temporary: Path
    aside: Path
    about: _Output | None = None
    identity: tuple[int, int] | None = None
    replaces: bool = False

    @property
    def is_placed(self) -> bool:
        """Whether what was made has the final name."""
        return self.identity is not None and _identity(self.final) == self.identity

    def names(self) -> Names:
        """Return all but the folder."""
        waits_for = None
        if self.about is not None:
            is_beside = self.about.final.parent == self.final.parent
            waits_for = self.about.temporary.name if is_beside else ""
        return Names(self.temporary.name, self.aside.name, self.final.name, waits_for)


class Staging(unfinished.Unfinished):
    """Files and folders on their way to their final names.

    First all are named with :meth:`file` and :meth:`folder`, which check and touch nothing; then
    :meth:`prepare`; then they are written; then :meth:`commit` or :meth:`discard`.

    In a ``with`` block, several that write may share it: what they commit or discard waits for the
    end of the block, which decides for all of them.

    Parameters
    ----------
    overwrite : bool
        Outputs that exist are replaced, at the end.
    """

    def __init__(self, overwrite: bool) -> None:
        self._overwrite = overwrite
        self._outputs: list[_Output] = []
        self._made: list[Path] = []
        self._claims: list[Claim] = []
        self._claimed = 0
        self._committing = False
        self._is_shared = False

    def __enter__(self) -> Staging:
        self._is_shared = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._is_shared = False
        try:
            if kind is None:
                self.commit()
        finally:
            self.discard()

    def file(self, path: Path, about: Path | None = None) -> Path:
        """Return the temporary name of the file `path`.

        Parameters
        ----------
        path : Path
        about : Path, optional
            Temporary name of the file that it tells about.

        Raises
        ------
        OutputError
            `path` exists and is not to be replaced, is not a file, or is below a file.
        """
        output = _output(path)
        output.about = next((one for one in self._outputs if one.temporary == about), None)
        if output.final.is_dir():
            raise OutputError(f"{path}: is a folder, and a file is to be written")
        if os.path.lexists(output.final) and not output.final.is_file():
            raise OutputError(f"{path}: is not a regular file")
        return self._add(output)

    def folder(self, path: Path, foreign: Callable[[Path], str | None]) -> Path:
        """Return the temporary name of the folder `path`.

        Parameters
        ----------
        path : Path
        foreign : callable
            Names something in a folder that must not be lost by replacing it, or None.

        Raises
        ------
        OutputError
            `path` exists and is not to be replaced, is a file, holds other things than such
            outputs do, or is below a file.
        """
        output = _output(path)
        if os.path.lexists(output.final):
            if not output.final.is_dir():
                raise OutputError(f"{path}: is a file, and a folder is to be written")
            other = foreign(output.final) if self._overwrite else None
            if other is not None:
                raise OutputError(
                    f"{path}: holds {other}, which would be lost: choose another folder"
                )
        return self._add(output)

    def _add(self, output: _Output) -> Path:
        self._check_free(output)
        above = nearest_there(output.final)
        if not above.is_dir():
            raise OutputError(f"{output.named}: {above} is not a folder")
        for other in self._outputs:
            if _are_one(output.final, other.final):
                raise OutputError(f"{output.named}: is to be two outputs; choose another name")
            if other.final in output.final.parents or output.final in other.final.parents:
                raise OutputError(
                    f"{output.named} and {other.named}: one lies in the other; choose another name"
                )
        self._outputs.append(output)
        return output.temporary

    def _check_free(self, output: _Output) -> None:
        if os.path.lexists(output.final) and not self._overwrite:
            raise OutputError(f"{output.named}: exists already; --overwrite replaces it")

    def keep_apart(self, inputs: Iterable[str | Path]) -> None:
        """Refuse to write where something is read from; see :func:`check_apart`."""
        for output in self._outputs:
            check_apart(output.named, inputs)

    def prepare(self) -> None:
        """Make the folders that the outputs are to lie in, and clear them of what runs left."""
        unfinished.add(self)
        new = self._outputs[self._claimed :]
        self._claimed = len(self._outputs)
        for output in new:
            missing = []
            above = output.final.parent
            while not above.exists():
                missing.append(above)
                above = above.parent
            for folder in reversed(missing):
                self._made.append(folder)
                folder.mkdir(exist_ok=True)
        for folder in dict.fromkeys(output.final.parent for output in new):
            clear(folder)
            here = (output.names() for output in new if output.final.parent == folder)
            self._claims.append(Claim(folder, here))

    def commit(self) -> None:
        """Give all outputs their final names; if that fails, everything is as it was.

        Raises
        ------
        OutputError
            One cannot be written, or exists by now and is not to be replaced.
        """
        if self._is_shared or not self._outputs:
            return
        self._committing = True
        at_work = self._outputs[0]
        try:
            for at_work in self._outputs:
                self._check_free(at_work)
                sync(at_work.temporary)
                at_work.identity = _identity(at_work.temporary)
                at_work.replaces = os.path.lexists(at_work.final)
            for claim in self._claims:
                claim.note_placing()
            for at_work in self._outputs:
                self._keep(at_work)
            for at_work in self._outputs:
                self._place(at_work)
        except BaseException as error:
            self._roll_back()
            if isinstance(error, FileExistsError):
                self._check_free(at_work)
            if isinstance(error, OSError):
                raise OutputError(
                    f"{at_work.named}: cannot be written: {error.strerror or error}"
                ) from error
            raise
        for folder in dict.fromkeys(output.final.parent for output in self._outputs):
            sync_names(folder)
        self._end()

    def _keep(self, output: _Output) -> None:
        """See to it that what is replaced can be brought back, if that needs a name of its own."""
        if not os.path.lexists(output.final) or output.temporary.is_dir():
            return
        if output.about is not None:
            output.final.rename(output.aside)  # it must not tell about what is there next
        elif len(self._outputs) > 1:
            with suppress(OSError):  # not where there are no hard links
                os.link(output.final, output.aside)

    def _place(self, output: _Output) -> None:
        final, temporary = output.final, output.temporary
        if not self._overwrite:
            move_to_free(temporary, final)
        elif not temporary.is_dir():
            if any(_are_one(final, other.final) for other in self._outputs if other.is_placed):
                raise FileExistsError(errno.EEXIST, "it is another output, too")
            temporary.replace(final)
        elif not os.path.lexists(final):
            move_to_free(temporary, final)
        elif not exchange(temporary, final):
            final.rename(output.aside)
            temporary.rename(final)

    def _roll_back(self) -> None:
        for output in reversed(self._outputs):
            final, temporary, aside = output.final, output.temporary, output.aside
            # should any of this fail, the old output stays under its other name
            with suppress(OSError):
                if not output.is_placed:
                    pass
                elif temporary.is_dir():  # which was there before
                    exchange(temporary, final)
                elif os.path.lexists(temporary):
                    final.unlink()
                elif not output.replaces or os.path.lexists(aside):
                    final.rename(temporary)
                if os.path.lexists(aside) and not os.path.lexists(final):
                    aside.rename(final)

    def discard(self) -> None:
        """Remove everything temporary, and the folders made for it."""
        if self._is_shared:
            return
        self._end()
        for folder in reversed(self._made):
            with suppress(OSError):  # something else may lie in it by now
                folder.rmdir()

    def _end(self) -> None:
        for output in self._outputs:
            remove(output.temporary)
            if os.path.lexists(output.final):
                remove(output.aside)
        for claim in self._claims:
            claim.drop()
        self._claims.clear()
        unfinished.drop(self)

    def remove_now(self) -> bool:
        """Remove everything temporary although it may be written to at this moment.

        Not while it comes into place, which the one who does it can undo better; nor where open
        files cannot be removed, as on Windows.
        """
        if self._committing:
            return False
        for output in self._outputs:
            if output.temporary.is_dir():
                # under its new name nobody adds anything to it, but for what was under way
                gone = output.temporary.with_name(output.temporary.name + "-")
                output.temporary.rename(gone)
                shutil.rmtree(gone, ignore_errors=True)
                if gone.exists():
                    shutil.rmtree(gone)
        self._is_shared = False
        self.discard()
        return not any(os.path.lexists(output.temporary) for output in self._outputs)


def check_free(outputs: Iterable[Path], overwrite: bool) -> None:
    """Check before any work that all files may be written; errors are those of :class:`Staging`."""
    staging = Staging(overwrite)
    for output in outputs:
        staging.file(output)


def nearest_there(path: Path) -> Path:
    """Return what a file or folder would be made in: the nearest above it that exists."""
    above = path.parent
    while not os.path.lexists(above):
        above = above.parent
    return above


def _output(path: Path) -> _Output:
    """Return where `path` leads: a symbolic link stays, and what it points to is replaced."""
    final = Path(os.path.realpath(path))
    if not final.name:
        raise OutputError(f"{path}: cannot be replaced, choose a name below it")
    try:
        final.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:  # its name is too long, or nothing may be seen there
        raise OutputError(f"{path}: {error.strerror}") from None
    return _Output(path, final, _beside(final), _beside(final))


def _beside(path: Path) -> Path:
    """Return a free, hidden name in the folder of `path`, which any program can open.

    It is short, whatever the length of its own, and of plain characters; and has the suffix of
    `path`, by which OpenCV and others choose the format.
    """
    stem, suffix = (re.sub(r"[^A-Za-z0-9._-]", "_", part) for part in (path.stem, path.suffix))
    return path.with_name(f".{stem[:40]}.{secrets.token_hex(4)}.part{suffix[:20]}")


def _identity(path: Path) -> tuple[int, int] | None:
    """Return what tells a file or folder from all others by any name; None: it is not there."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _are_one(one: Path, other: Path) -> bool:
    """Tell whether two names lead to one file, also where upper and lower case are the same."""
    if os.path.normcase(one) == os.path.normcase(other):
        return True
    try:
        return one.samefile(other)
    except OSError:
        return False
