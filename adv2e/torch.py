"""Recordings and files of events as a data set for PyTorch, which is imported when it is used."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from adv2e.errors import DataError, MissingExtraError, UsageError
from adv2e.events import Events, cut
from adv2e.exporting.sequence import TRAIN, in_class, is_held_out, named_paths, split_of
from adv2e.exporting.voxels import Slice, VoxelSettings
from adv2e.formats.reading import read_events
from adv2e.in_python import reworded
from adv2e.options import VoxelOptions, declared
from adv2e.representations.histogram import stacked_histogram

KINDS = ("voxel", "counts", "raw")


class EventDataset:
    """Windows of recordings, or whole ones: a map-style data set.

    A recording is read when an item of it is asked for, in the worker that asks.  With windows, all
    are read once before, for their lengths.

    Parameters
    ----------
    source : path, or iterable of paths
        Files of events or recordings; or one folder, of which all below it count.  There, folders
        train, valid and test divide the set, and the next ones are its classes.
    kind : {'voxel', 'counts', 'raw'}
        voxel: float32, (bins, rows, columns), as ``adv2e export --to voxel`` writes them.  counts:
        float32, (bins, 2, rows, columns), OFF and ON.  raw: int64, (events, 4): time from the start
        of the window [us], column, row, polarity.
    window_us, count : int, optional
        Length of a window [us], or its number of events; default: whole recordings.  What is left
        at the end is left out.
    bins : int
        Bins of time.
    split : {'train', 'valid', 'test'}, optional
        That part alone; where no folder says it, `valid` and `test` are those held out.
    held_out : float
        Share that is held out, by names alone.
    labels : bool, optional
        Give each item as (tensor, number of its class in `classes`); default: if all have a class.
    transform : callable, optional
        Is given each tensor; what it returns is the item.
    kept : int
        Recordings that each worker keeps in memory.
    **more
        `normalise`, `polarity` and `span` of voxel grids, as ``adv2e export`` takes them.

    Attributes
    ----------
    classes : list of str
        Names of the classes, sorted.
    names : list of str
        Of the recordings.

    Raises
    ------
    MissingExtraError
        There is no torch.
    UsageError, DataError
        An option does not fit, there is nothing, or a recording has no class.

    Examples
    --------
    >>> from adv2e.torch import EventDataset
    >>> data = EventDataset("events/", kind="counts", bins=10)  # doctest: +SKIP
    >>> loader = torch.utils.data.DataLoader(data, batch_size=8)  # doctest: +SKIP
    """

    def __init__(
        self,
        source: str | Path | Iterable[str | Path],
        kind: str = "voxel",
        *,
        window_us: int | None = None,
        count: int | None = None,
        bins: int = 5,
        split: str | None = None,
        held_out: float = 0.2,
        labels: bool | None = None,
        transform: Callable[[Any], Any] | None = None,
        kept: int = 4,
        **more: Any,
    ) -> None:
        if find_spec("torch") is None:
            raise MissingExtraError("adv2e.torch", "torch")
        if kind not in KINDS or split not in (None, TRAIN, "valid", "test"):
            raise UsageError(f"kind and split: {kind!r} and {split!r} are not known")
        lengths = [one for one in (window_us, count) if one is not None]
        if len(lengths) > 1 or min([bins, kept, *lengths]) < 1:
            raise UsageError("give one of window_us and count; these, bins and kept from 1 on")
        paths = [source] if isinstance(source, (str, Path)) else list(source)
        found = [
            (name, path)
            for name, path in named_paths(paths)
            if split is None or _is_in(name, split, held_out)
        ]
        if not found:
            raise DataError(f"{paths[0] if paths else 'source'}: holds no recording of {split}")
        self.names, self._paths = [name for name, _ in found], [path for _, path in found]
        has_class = all("/" in (n.partition("/")[2] if split_of(n) else n) for n in self.names)
        self._labels = has_class if labels is None else labels
        self._of = [in_class(name)[0] for name in self.names] if self._labels else []
        self.classes = sorted(set(self._of))
        self._kind, self._window_us, self._count, self._bins = kind, window_us, count, bins
        known = declared(VoxelOptions)
        chosen = {name: known[name].checked(name, more[name]) for name in more.keys() & known}
        self._grids = VoxelSettings(**{"bins": bins, **more, **chosen})
        self._transform, self._kept = transform, kept
        self._read = lru_cache(kept)(_read)
        ends = [self._windows(path) for path in self._paths] if lengths else [1] * len(found)
        self._ends = np.cumsum(ends)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_read"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _read=lru_cache(state["_kept"])(_read))

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, number: int) -> Any:
        """Return the item: a tensor, or a tensor and its class; IndexError if there is none."""
        import torch  # noqa: PLC0415 - takes its time, and is optional

        if not -len(self) <= number < len(self):
            raise IndexError(number)
        number %= len(self)
        at = int(np.searchsorted(self._ends, number, side="right"))
        before = int(self._ends[at - 1]) if at else 0
        events, size = self._read(self._paths[at])
        made: Any = torch.from_numpy(self._made(self._part(events, number - before), size))
        if self._transform is not None:
            made = self._transform(made)
        return (made, self.classes.index(self._of[at])) if self._labels else made

    def _windows(self, path: Path) -> int:
        events, _ = _read(path)
        if self._count is not None:
            return int(events.size // self._count)
        assert self._window_us is not None
        return int((events["t"][-1] - events["t"][0]) // self._window_us) if events.size else 0

    def _part(self, events: Events, number: int) -> Slice:
        if self._window_us is not None:
            start = int(events["t"][0]) + number * self._window_us
            stop = start + self._window_us
            return Slice(start, stop, cut(events, start, stop))
        if self._count is not None:
            events = events[number * self._count : (number + 1) * self._count]
        first, last = (int(events["t"][k]) if events.size else 0 for k in (0, -1))
        return Slice(first, last, events)

    def _made(self, part: Slice, size: tuple[int, int]) -> Any:
        if self._kind == "voxel":
            return self._grids.grid(part, size).astype(np.float32)
        if self._kind == "raw":
            t, *rest = (part.events[name].astype(np.int64) for name in "txyp")
            return np.stack([t - part.start_us, *rest], axis=1)
        window = part.start_us, part.stop_us
        counts = stacked_histogram(part.events, self._bins, size, None, window)
        shape = 2, self._bins, size[1], size[0]
        return counts.reshape(shape).swapaxes(0, 1).astype(np.float32)


def _is_in(name: str, split: str, held_out: float) -> bool:
    said = split_of(name)
    return said == split if said else is_held_out(name, held_out) == (split != TRAIN)


def _read(path: Path) -> tuple[Events, tuple[int, int]]:
    recording = reworded(read_events)(path)
    return recording.events, (recording.width, recording.height)
