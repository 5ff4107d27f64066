"""Progress bars on standard error, by tqdm, which end no work that nobody watches any more."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tqdm import tqdm


class _Unfailing:
    """Standard error whose reader may leave, or whose disk may be full.

    An error on the way would leave tqdm's lock taken, for which all other threads then wait.
    """

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError, AttributeError):  # gone, full, closed or never there
            return sys.stderr.write(text)
        return 0

    def flush(self) -> None:
        with suppress(OSError, ValueError, AttributeError):
            sys.stderr.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)


def bar(**options: Any) -> tqdm[Any]:
    """Return a bar that goes when it is closed; `options` are those of ``tqdm.tqdm``."""
    from tqdm import tqdm  # noqa: PLC0415 - it takes its time, and most runs in scripts need none

    return tqdm(file=_Unfailing(), leave=False, **options)
