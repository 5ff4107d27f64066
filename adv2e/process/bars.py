"""Progress bars on standard error, by tqdm, which end no work that nobody watches any more."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
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


@contextmanager
def share_bar(doing: str, then: str, is_shown: bool) -> Iterator[Callable[[int, int | None], None]]:
    """Yield a callback (amount done, total or None) for a bar that shows the share of a file.

    Once all of it is done the bar says `then`: a second pass, or work that has no share.
    """
    if not is_shown:
        yield lambda done, total: None
        return
    with bar(desc=doing, unit=" frames") as shown:

        def tell(done: int, total: int | None) -> None:
            if total is not None:
                shown.total = total
                shown.bar_format = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"
            if done < shown.n:
                shown.reset(total)
            shown.update(done - shown.n)
            if done == total:
                shown.set_description_str(then)

        yield tell


def reading_bar(
    path: str | Path, is_shown: bool
) -> AbstractContextManager[Callable[[int, int | None], None]]:
    """Return the bar of a file whose events are sorted and counted once they are read."""
    return share_bar(f"reading {Path(path).name}", "sorting and counting", is_shown)
