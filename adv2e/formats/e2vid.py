"""Events as rpg_e2vid and its descendants read them: text with a heading, or a zip of it alone.

============ ==================================================
first line   ``width height``, which these programs skip
other lines  ``seconds x y polarity``, polarity 0 (OFF) or 1 (ON)
============ ==================================================

Without the first line they would lose the first event, and refuse a zip of more than one file.
What reads such files are :mod:`adv2e.formats.text.reader` and
:mod:`adv2e.formats.davis240c.reader`.

References
----------
.. [1] H. Rebecq et al., "High speed and high dynamic range video with an event camera", TPAMI 2019,
   arXiv:1906.07165; github.com/uzh-rpg/rpg_e2vid: utils/event_readers.py.
"""

from __future__ import annotations

import zipfile
from contextlib import ExitStack
from pathlib import Path
from typing import IO

from adv2e.events import Events
from adv2e.formats.sink import Request, Writer
from adv2e.formats.text.writer import text_blocks

_BLOCK = 1 << 20  # bytes deflated at once: the archive must not depend on who calls how
_LEVEL = 4  # of deflate


class E2vidWriter(Writer):
    """Writes the text, or, to a path that ends in ``.zip``, a zip that holds it alone."""

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._file: IO[bytes]
        if request.path.suffix.lower() == ".zip":
            archive = stack.enter_context(
                zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL)
            )
            name = f"{request.path.stem}.txt"
            self._file = stack.enter_context(archive.open(name, "w", force_zip64=True))
        else:
            self._file = stack.enter_context(path.open("wb"))
        self._text = bytearray(f"{request.width} {request.height}\n".encode())

    def write_events(self, events: Events) -> None:
        """Append events."""
        for block in text_blocks(events):
            self._text += block
            while len(self._text) >= _BLOCK:
                self._file.write(self._text[:_BLOCK])
                del self._text[:_BLOCK]

    def finish(self) -> None:
        """Write the remaining lines."""
        self._file.write(self._text)
