"""Sources whose frames are all known before the first is read: images, recordings, stacks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from adv2e.errors import DataError
from adv2e.label import WHITE, guessed, told_of
from adv2e.sources.base import GivenTimes, Selection, Source
from adv2e.sources.bayer import in_colour, light_of
from adv2e.sources.frame import Frame, Light, Shot, check_values
from adv2e.sources.times.lists import FrameList, match, read_list
from adv2e.sources.times.rates import gap_doubts, numbering_doubt


@dataclass(frozen=True)
class Picture:
    """A frame without a time: label for messages, path that lists may name (if any), loader."""

    label: str
    path: str | None
    load: Callable[[], Frame]


@dataclass(frozen=True)
class Timed:
    """Frames with their times, what is doubtful and what else is to be told of these.

    `found` is the list that lies beside them, whether its times are taken or others; `own` returns
    its times [ns] where a rate replaces them.
    """

    shots: list[Shot]
    doubts: list[str]
    notes: list[str]
    found: str | None = None
    own: Callable[[], list[int]] | None = None


def timed(
    given: GivenTimes,
    pictures: Sequence[Picture],
    path: Path,
    found: str | None,
    read_found: Callable[[str], FrameList] | None = None,
    missing: str = "",
    order: Sequence[str] = (),
) -> Timed:
    """Return the pictures at the times that the user gave, else at those found beside them.

    Parameters
    ----------
    pictures : sequence of Picture
        All of `path`, in order.
    found : str or None
        Name of the list that was found.
    read_found : callable, optional
        Reads what is called so; not needed where the user gave times.
    missing : str
        What was looked for.
    order : sequence of str
        What is doubtful of the order of the pictures, where it is not the list that has it.

    Raises
    ------
    DataError
        No times; or a list that cannot be read or does not fit the pictures.
    """
    if (rate := given.rate) is not None:
        shots = [Shot(rate.time_ns(n), p.label, p.load) for n, p in enumerate(pictures)]
        doubt = numbering_doubt([picture.path or "" for picture in pictures], rate)
        result = Timed(shots, [told_of(path, line) for line in (*order, doubt) if line], [])
    elif given.timestamps is not None:
        label = str(given.timestamps)
        listed = read_list(given.timestamps, time_unit=given.time_unit)
        result = _listed(listed, label, pictures, path, order)
        if len(result.shots) != len(pictures):
            raise _other_number(label, len(result.shots), len(pictures), path)
    elif found is not None and read_found is not None:
        result = _listed(read_found(found), found, pictures, path, order)
        return replace(result, found=found)
    else:
        raise DataError(
            f"{path}: no times of its frames are known: give --fps F or --timestamps FILE, or put"
            f" {missing}"
        )
    if found is not None and not _is_same(given.timestamps, found):
        result.notes.append(f"{given} replaces the times in {found}")
    if given.rate is None or found is None or read_found is None:
        return replace(result, found=found)
    own = partial(_own_times, found, read_found, pictures, path, result.shots)
    return replace(result, found=found, own=own)


def _own_times(
    found: str,
    read_found: Callable[[str], FrameList],
    pictures: Sequence[Picture],
    path: Path,
    shots: Sequence[Shot],
) -> list[int]:
    """Return the times [ns] that a list has for frames to which a rate was given."""
    listed = _listed(read_found(found), found, pictures, path, ())
    times = {shot.label: shot.t_ns for shot in listed.shots}
    missing = next((shot.label for shot in shots if shot.label not in times), None)
    if missing is not None:
        raise DataError(f"{found}: has no time for {missing}")
    return [times[shot.label] for shot in shots]


def _is_same(file: Path | None, other: str) -> bool:
    return file is not None and Path(other).exists() and file.samefile(other)


def _listed(
    found: FrameList, label: str, pictures: Sequence[Picture], path: Path, order: Sequence[str]
) -> Timed:
    """Return the pictures that a list of times names, or all in order if it names none."""
    doubts, notes = found.told(label)
    stamps, paths = found.stamps, [p.path for p in pictures if p.path is not None]
    if stamps[0].name is not None and paths:
        places = match(stamps, paths, label, f" in {path}")
    elif len(stamps) == len(pictures):
        places = list(range(len(pictures)))
        doubts += [told_of(path, line) for line in order]
    else:
        raise _other_number(label, len(stamps), len(pictures), path)
    shots = [
        Shot(stamp.t_ns, pictures[at].label, pictures[at].load, stamp.exposure_ns)
        for stamp, at in zip(stamps, places, strict=True)
    ]
    return Timed(shots, doubts, notes)


def _other_number(label: str, times: int, frames: int, path: Path) -> DataError:
    return DataError(f"{label}: {times} times for the {frames} frames of {path}")


class ListedSource(Source):
    """A source whose frames and times are all known before the first is read.

    `light` is what the numbers stand for, where the kind of source decides and not the image.

    Raises
    ------
    DataError
        Fewer than two frames, in all or selected, or an unreadable first frame.
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        timed: Timed,
        selection: Selection,
        *,
        has_clock: bool,
        light: Light | None = None,
    ) -> None:
        super().__init__(path, kind, selection, has_clock)
        shots = self._shots = timed.shots
        # of an archive or a stack, they are names of no file
        self.inputs += [*filter(None, [timed.found]), *(shot.label for shot in shots)]
        if (pattern := selection.bayer) is not None:
            shots = self._shots = [in_colour(shot, pattern) for shot in shots]
            light = light_of(pattern)
        self._own = timed.own
        self.doubts += timed.doubts
        self.notes += timed.notes
        if selection.allow_damaged:
            self.notes.append(
                f"{path}: --allow-damaged is for video: a picture is read whole, or is an error"
            )
        self._count()
        self.doubts += gap_doubts([shot.t_ns for shot in shots], str(path))
        first = shots[0].load()
        self._describe(first, shots[0].label, light)
        check_values(self.selection.of_frame(first).image, shots[0].label)
        self.largest = float(first.image.max())
        if self.dtype.kind == "u":
            self._look_for_white()
        elif self.largest > 1:
            told = f"values above 1.0 (up to {self.largest:g} in the first frame); white is 1.0"
            told += " unless frames.full_scale says otherwise"
            self.notes.append(guessed(told, WHITE, 1.0))

    def _look_for_white(self) -> None:
        """Look at more frames than the first, should it be far below white."""
        for shot in (self._shots[len(self._shots) // 2], self._shots[-1]):
            assert self.largest is not None
            if self.largest and not self.doubt_of_white(self.largest):
                break
            self.largest = max(self.largest, float(shot.load().image.max()))

    def _count(self) -> None:
        if len(self._shots) < 2:
            raise DataError(
                f"{self.path}: {'a single frame' if self._shots else 'no frames'}; at least two"
                " are needed"
            )
        first_ns = self._shots[0].t_ns
        chosen = self.selection
        inside = [
            shot
            for shot in self._shots
            if chosen.start_ns <= shot.t_ns - first_ns <= chosen.stop_ns
        ]
        self.count = len(inside)
        if any(shot.exposure_ns for shot in inside):
            self.exposures_us = [shot.exposure_ns / 1000 for shot in inside]
        if self.count < 2:
            raise self._too_few(self.count, self._shots[-1].t_ns - first_ns)

    def listed(self) -> Sequence[Shot]:
        """Return all frames, in the order of time."""
        return self._shots

    def own_times_ns(self) -> list[int] | None:
        """Return the times of the frames that a rate replaces [ns]; None: there are none."""
        return None if self._own is None else self._own()

    def shots(self) -> Iterator[Shot]:
        """Yield every frame, not loaded."""
        return iter(self._shots)
