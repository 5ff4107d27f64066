"""Zip archives that may be damaged, encrypted, or made to fill the memory."""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from adv2e.errors import DataError
from adv2e.files.expansion import check_expansion
from adv2e.process.machine import machine_complaint

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, struct.error, OSError),
    *(NotImplementedError, RuntimeError, UnicodeDecodeError),
)
"""What reading an archive raises that is damaged, encrypted or packed in an unknown way."""


@contextmanager
def zip_archive(path: Path, kind: str = "a zip archive") -> Iterator[zipfile.ZipFile]:
    """Open an archive; what is wrong with it, when it is opened or read, is a DataError."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except UNREADABLE as error:
        if machine_complaint(error):
            raise
        raise DataError(f"{path}: not {kind} that can be read, or damaged: {error}") from error


def open_member(archive: zipfile.ZipFile, member: str | zipfile.ZipInfo) -> IO[bytes]:
    """Return a member as a file; DataError if it states far more bytes than it holds."""
    info = archive.getinfo(member) if isinstance(member, str) else member
    assert archive.fp is not None
    # no more than the archive itself, which is where its list of members ends
    held = min(info.compress_size, archive.start_dir)
    check_expansion(info.file_size, held, f"{archive.filename}: {info.filename}")
    return archive.open(info)
