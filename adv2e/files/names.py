"""Names of files as they are shown and stored: any name that a file system allows, on one line.

A name may hold bytes that are not UTF-8, which Python keeps as lone surrogates, and control
characters, line breaks among them.  Neither can be printed or stored as they are: many readers
refuse the first, and terminals obey the second.  A file is always opened by its name as it is;
what people or other programs are to read goes through :func:`shown`.
"""

from __future__ import annotations

import re
from pathlib import Path

_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def shown(name: str | Path) -> str:
    r"""Return a name, or a line that holds names, with escapes for what cannot be shown.

    A byte that is not UTF-8 reads ``\xff``, a line break ``\n``.

    >>> shown("two\nlines")
    'two\\nlines'
    """
    return _UNFIT.sub(_escape, str(name))


def beside(path: Path, ending: str) -> Path:
    """Return the path beside a file or folder with its name and an ending, also of ``.``."""
    whole = path if path.name.strip(".") else path.resolve()
    return whole.parent / f"{whole.name}{ending}"


def _escape(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # a byte that Python could not decode
        code -= 0xDC00
        return f"\\x{code:02x}"
    return found[0].encode("unicode_escape").decode("ascii")
