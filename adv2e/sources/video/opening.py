"""Videos under any name that a file system allows."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_UNFIT = re.compile("[%\ud800-\udfff]")
"""What FFmpeg takes for the number in a pattern, and what has no place in UTF-8."""


@contextmanager
def openable(path: str | Path) -> Iterator[str]:
    """Within the context, a name under which OpenCV opens a file and nothing else.

    It is absolute: FFmpeg takes what stands before a colon for a protocol.  A name that is no UTF-8
    or could be a pattern gives way to that of a link in a private folder, gone with the context.
    """
    whole = Path(path).absolute()
    if not _UNFIT.search(str(whole)):
        yield str(whole)
        return
    with tempfile.TemporaryDirectory(dir=_plain_folder()) as folder:
        link = Path(folder) / f"video{whole.suffix if whole.suffix.isascii() else ''}"
        try:
            link.symlink_to(whole)
        except OSError:  # not everybody may make links on Windows, where names are UTF-8
            link = whole
        yield str(link)


def _plain_folder() -> str:
    usual = tempfile.gettempdir()
    return "/tmp" if _UNFIT.search(usual) else usual
