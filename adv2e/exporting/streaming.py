"""What is made of each window of a simulation while it goes on: the events are kept nowhere.

The folder is that of ``adv2e export``; ``export.json`` says how the events were made.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, Window, cut, empty_events
from adv2e.exporting.export import DESCRIPTION, foreign
from adv2e.exporting.layouts import REPRESENTATIONS
from adv2e.exporting.voxels import Slice, WindowFiles, check_empty
from adv2e.files.staging import Staging
from adv2e.formats.writing import write_side
from adv2e.ticks import microseconds


class WindowSink(ExitStack):
    """Takes the events of a conversion in the place of :class:`adv2e.formats.writing.Sink`.

    Parameters
    ----------
    to : str
        One of :data:`adv2e.exporting.layouts.REPRESENTATIONS`.
    how : mapping
        Its options, of which ``window_us`` or ``at`` says how events are cut.
    path : str
        The folder.
    width, height, metadata, staging, side
        As :func:`adv2e.formats.writing.open_sink` takes them, and more that plays no part.
    """

    def __init__(self, to: str, how: Mapping[str, Any], path: str, **asked: Any) -> None:
        super().__init__()
        self._told = {"adv2e": asked["metadata"]["adv2e"], "to": to, **how}
        self._metadata, self._how, self._name = asked["metadata"], how, Path(path).stem
        self._size = asked["width"], asked["height"]
        self._staging: Staging = asked["staging"]
        self._side = asked["side"]
        self._folder = self._staging.folder(Path(path), foreign)
        self.wants_frames = how["at"] == "images"
        self._stem, saving = REPRESENTATIONS[to]
        self._save = saving(how, self._size)
        self._label, self._empty = path, 0
        self._held, self._edges = empty_events(), list[int]()

    def __enter__(self) -> WindowSink:
        self._staging.prepare()
        self._folder.mkdir()
        place = self._folder / self._name
        self._files = self.enter_context(WindowFiles(place, self._stem, self._save))
        return self

    def write_events(self, events: Events) -> None:
        """Take events; over all calls they are sorted by time."""
        if events.size:
            if not self.wants_frames and not self._edges:
                self._edges = [int(events["t"][0])]
            self._held = np.concatenate([self._held, events]) if self._held.size else events
            self._make(until=int(events["t"][-1]))

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Take the time of a frame [ns]."""
        self._edges.append(microseconds(t_ns))

    def describe(self, **more: Any) -> None:
        """Add to the description what is known only at the end."""
        self._metadata.update(more)

    def _window(self) -> Window | None:
        """Return the next window, None where it is not known yet."""
        if self._edges and not self.wants_frames:
            return self._edges[0], self._edges[0] + self._how["window_us"]
        return (self._edges[0], self._edges[1]) if len(self._edges) > 1 else None

    def _make(self, until: float) -> None:
        while (window := self._window()) is not None and window[1] <= until:
            part = Slice(*window, cut(self._held, *window))
            if not self.wants_frames:
                self._empty = check_empty(part, self._empty, self._label, self._how["most_empty"])
            self._files.add(part)
            self._held = cut(self._held, window[1], int(np.iinfo(np.int64).max))
            self._edges = [window[1], *self._edges[2:]]

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        if kind is None:
            if self.wants_frames:  # also those after the last event
                self._make(until=np.inf)
            told = {"name": self._name, "size": self._size, "items": self._files.count}
            if self._side is not None:
                write_side(self._folder / "side" / self._name, self._side)
            entries = sorted({*(one.name for one in self._folder.iterdir()), DESCRIPTION})
            text = {"sequences": [told], "simulated": self._metadata, "entries": entries}
            written = json.dumps({**self._told, **text}, indent=2, default=str) + "\n"
            (self._folder / DESCRIPTION).write_text(written, "utf-8", newline="\n")
        super().__exit__(kind, *rest)
