"""Recordings of known films: events of one camera, each with a video or a picture it saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.config.model import Frames, Sensor
from adv2e.diagnosis.data.evidence import check_events
from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.film.view import STEP_NS, Films
from adv2e.diagnosis.tables.table import read_table
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.formats.reading import read_events
from adv2e.geometry import Size
from adv2e.light.decoding import decoder_for
from adv2e.light.sensor import check_beside
from adv2e.sources import check_stored, open_source
from adv2e.sources.frame import Frame
from adv2e.sources.images.opencv import IMAGE_SUFFIXES, read_image

LEAST = 4
"""Recordings before pictures: half of them judge."""
_WHITE_DN = 255.0
_APART = 2.0
"""Of recordings with one path, the time from the first event to the last of all of them, as a
multiple of that of the longest."""

Pair = tuple[str | Path, str | Path]


@dataclass(frozen=True)
class FilmRecordings:
    """Recordings of one camera with the films that they saw.

    Attributes
    ----------
    events : sequence of events
        Of each, sorted.
    """

    films: Films
    events: Sequence[Events]
    notes: list[str]

    @cached_property
    def stream(self) -> Stream:
        """Events of all recordings, side by side on one wide sensor."""
        width, height = self.films.size
        parts = []
        for number, events in enumerate(self.events):
            moved = events.astype(np.dtype([(n, np.int64) for n in ("t", "x", "y", "p")]))
            moved["x"] += number * width
            parts.append(moved)
        every = np.concatenate(parts)
        every = every[np.argsort(every["t"], kind="stable")]
        return Stream.of(every, width * len(self.events), height)

    def every_second(self, first: int) -> FilmRecordings:
        """Return every second recording, from `first` on."""
        some = slice(first, None, 2)
        return replace(self, films=self.films.of(some), events=self.events[some])


def split(stream: Stream, recordings: int) -> list[Events]:
    """Return the events of each recording of a stream of all of them."""
    events, width = stream.events(), stream.width // recordings
    number = events["x"] // width
    events["x"] %= width
    return [events[number == k] for k in range(recordings)]


def read_pairs(path: str | Path) -> list[Pair]:
    """Return the files of a table with the columns ``events`` and ``film``, beside which they lie.

    Raises
    ------
    DataError
        It cannot be read, has other columns, or a row without a name.
    """
    table = read_table(path)
    for name in ("events", "film"):
        if name not in table.columns:
            raise DataError(f"{table.name}: needs the columns events and film")
        for row, text in enumerate(table.texts(name)):
            if not text:
                raise table.wrong(row, name, "must be the name of a file")
    folder = Path(path).parent
    pairs = zip(table.texts("events"), table.texts("film"), strict=True)
    return [(folder / events, folder / film) for events, film in pairs]


def read_recordings(
    pairs: Sequence[Pair], sensor: Sensor | None = None, **reading: Any
) -> FilmRecordings:
    """Read recordings and their films; `reading` as :func:`read_events` takes it.

    Raises
    ------
    DataError
        A file cannot be read; sizes differ; there are too few events, or too few recordings before
        pictures; films are videos and pictures, or several videos; their clocks are not one.
    """
    size = None if sensor is None else (sensor.width, sensor.height)
    events, notes, sizes = [], [], []
    for path, _ in pairs:
        recording = read_events(path, size=size, **reading)
        check_beside(recording.width, recording.height, sensor, recording.path)
        sizes.append(Size(recording.width, recording.height))
        if sizes[-1] != sizes[0]:
            raise DataError(f"{path}: {sizes[-1]} pixels, but {pairs[0][0]} has {sizes[0]}")
        events.append(recording.events)
        notes += [one for one in recording.problems if "frame" not in one]
    check_events(sum(map(len, events)), pairs[0][0], "in all recordings")
    if not all(Path(film).suffix.lower() in IMAGE_SUFFIXES for _, film in pairs):
        if len(pairs) > 1:
            raise DataError(
                f"{pairs[0][1]}: a film that moves is taken with one recording at a time; several"
                " recordings need a picture each"
            )
        pictures, times_ns = _video(pairs[0][1])
        return FilmRecordings(Films([pictures], times_ns, sizes[0]), events, notes)
    if len(pairs) < LEAST:
        raise DataError(
            f"{len(pairs)} recordings before pictures: at least {LEAST} are needed, as half of them"
            " judge what the others were fitted to"
        )
    seen = dict.fromkeys(Path(film) for _, film in pairs)
    made = {film: _numbers(read_image(film))[None] for film in seen}
    films = Films([made[Path(film)] for _, film in pairs], _instants(events, pairs), sizes[0])
    return FilmRecordings(films, events, list(dict.fromkeys(notes)))


def _numbers(frame: Frame) -> NDArray[np.float32]:
    """Return the numbers of a frame as they are, 0 ... 1: its grey curve is fitted."""
    decoder = decoder_for(
        Frames(encoding="linear"),
        frame.image.dtype,
        frame.image.ndim == 3,
        auto="linear",
        white=frame.white,
    )
    return np.asarray(decoder.decode(frame.image) / _WHITE_DN, np.float32)


def _video(path: str | Path) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    check_stored(path)
    source = open_source(path)
    frames = list(source.frames())
    times_ns = np.array([frame.t_ns for frame in frames], np.int64)
    return np.array([_numbers(frame) for frame in frames]), times_ns


def _instants(events: Sequence[Events], pairs: Sequence[Pair]) -> NDArray[np.int64]:
    spans = np.array([one["t"][[0, -1]] for one in events if len(one)])
    first, last = int(spans[:, 0].min()), int(spans[:, 1].max())
    if last - first > _APART * (spans[:, 1] - spans[:, 0]).max():
        raise DataError(
            f"{pairs[0][0]} and the others: the times of their events are not on one clock: before"
            " pictures they must count from the same moment of the camera's path"
        )
    step_us = STEP_NS // 1000
    first -= first % step_us
    return np.arange(first, last + step_us + 1, step_us, dtype=np.int64) * 1000
