"""Progress bar for reading a file, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from adv2e.process import bars

_SHARE = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"


@contextmanager
def reading_told(
    path: str | Path, progress: bool
) -> Iterator[Callable[[int, int | None], None] | None]:
    """Yield a callback for a progress bar (amount read, total); None without `progress`.

    Once all is read, events are still to be sorted and counted, which the bar then says.
    """
    if not progress:
        yield None
        return
    with bars.bar(desc=f"reading {Path(path).name}", unit=" frames") as bar:

        def told(done: int, total: int | None) -> None:
            if total is not None:
                bar.total, bar.bar_format = total, _SHARE
            bar.update(done - bar.n)
            if done == total:
                bar.set_description_str("sorting and counting")

        yield told
