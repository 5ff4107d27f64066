"""Writing under temporary names, so that a final name only ever holds finished work.

Temporary names lie in the folder of the final one, where a rename is a single step.  An output
may be several files (events and the metadata beside them) or a folder: they come into place
together or not at all, and what they replace stays until then.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from adv2e import unfinished
from adv2e.errors import OutputError


@dataclass
class _Output:
    """One file or folder to be: as the user named it, where it will lie, where it is written."""

    named: Path
    final: Path
    temporary: Path
    replaced: Path | None = None


class Staging(unfinished.Unfinished):
    """Files and folders on their way to their final names.

    First all are named with :meth:`file` and :meth:`folder`, which check and touch nothing; then
    :meth:`prepare`; then they are written; then :meth:`commit` or :meth:`discard`.

    Parameters
    ----------
    overwrite : bool
        Outputs that exist are replaced, at the end.
    """

    def __init__(self, overwrite: bool) -> None:
        self._overwrite = overwrite
        self._outputs: list[_Output] = []
        self._made: list[Path] = []
        self._committing = False

    def file(self, path: Path) -> Path:
        """Return the temporary name of the file `path`.

        Raises
        ------
        OutputError
            `path` exists and is not to be replaced, is not a file, or is below a file.
        """
        output = _output(path)
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
        self._outputs.append(output)
        return output.temporary

    def _check_free(self, output: _Output) -> None:
        if os.path.lexists(output.final) and not self._overwrite:
            raise OutputError(f"{output.named}: exists already; --overwrite replaces it")

    def prepare(self) -> None:
        """Make the folders that the outputs are to lie in."""
        unfinished.add(self)
        for output in self._outputs:
            missing = []
            above = output.final.parent
            while not above.exists():
                missing.append(above)
                above = above.parent
            for folder in reversed(missing):
                self._made.append(folder)
                folder.mkdir(exist_ok=True)

    def commit(self) -> None:
        """Give all outputs their final names; if that fails, everything is as it was."""
        self._committing = True
        try:
            for output in self._outputs:
                self._check_free(output)
                if os.path.lexists(output.final):
                    output.replaced = _beside(output.final)
                    output.final.rename(output.replaced)
                output.temporary.rename(output.final)
        except BaseException:
            self._roll_back()
            raise
        for output in self._outputs:
            _remove(output.replaced)
        unfinished.drop(self)

    def _roll_back(self) -> None:
        for output in reversed(self._outputs):
            if not os.path.lexists(output.temporary):
                with suppress(OSError):
                    output.final.rename(output.temporary)
            if output.replaced is not None:
                # should this fail, the old output stays under its other name
                with suppress(OSError):
                    output.replaced.rename(output.final)
                output.replaced = None

    def discard(self) -> None:
        """Remove everything temporary, and the folders made for it."""
        for output in self._outputs:
            _remove(output.temporary)
            _remove(output.replaced)
        for folder in reversed(self._made):
            with suppress(OSError):  # something else may lie in it by now
                folder.rmdir()
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
                # under its new name nobody adds anything to it
                gone = output.temporary.with_name(output.temporary.name + "-")
                output.temporary.rename(gone)
                shutil.rmtree(gone)
        self.discard()
        return not any(os.path.lexists(output.temporary) for output in self._outputs)


def check_free(outputs: Iterable[Path], overwrite: bool) -> None:
    """Check before any work that all files may be written; errors are those of :class:`Staging`."""
    staging = Staging(overwrite)
    for output in outputs:
        staging.file(output)


def check_apart(output: str | Path, inputs: Iterable[str | Path]) -> None:
    """Refuse to write where something is read from, whether it may be replaced or not.

    Raises
    ------
    OutputError
        `output` is one of `inputs`, or a folder that holds one.
    """
    final = Path(output).resolve()
    for one in inputs:
        there = Path(one).resolve()
        if final == there or (final.exists() and there.exists() and final.samefile(there)):
            raise OutputError(f"{output}: is the input, which would be lost; choose another name")
        if final in there.parents and final.is_dir():
            raise OutputError(f"{output}: holds the input {one}; choose another name")


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
    return _Output(path, final, _beside(final))


def _beside(path: Path) -> Path:
    """Return a free, hidden name in the folder of `path`; short, whatever the length of its own.

    It has the suffix of `path`, by which OpenCV and others choose the format.
    """
    return path.with_name(f".{path.stem[:40]}.{secrets.token_hex(4)}.part{path.suffix[:20]}")


def _remove(path: Path | None) -> None:
    if path is None:
        return
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)
