"""Sequences of the GOPRO dataset, whose frames are numbered at 240 a second.

``GOPRO_Large_all/{train,test}/GOPR0384_11_00`` holds every frame of the camera.  ``GOPRO_Large``
has three pictures for each n of these, n being the second number of the name: ``sharp``, the one in
the middle, and two that are blurred.  The numbers of its files count those groups of n, which lie
side by side; ``blur/000047.png`` of a sequence with n = 7 is made of ``000323.png`` and the six
that follow.

``blur_gamma`` is the mean of their light, encoded as they are.  ``blur`` is the mean of their
numbers, taken for light: where nothing moves, it equals ``sharp``.  So all three are decoded alike.

References
----------
.. [1] S. Nah, T. H. Kim, K. M. Lee, "Deep Multi-scale Convolutional Neural Network for Dynamic
   Scene Deblurring", CVPR 2017.
.. [2] S. Nah, on how the frames were numbered and averaged:
   https://github.com/SeungjunNah/DeepDeblur_release, issues 13, 22, 59 and 60.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path

from adv2e.errors import DataError
from adv2e.label import guessed, told_of
from adv2e.sources.base import GivenTimes, Selection
from adv2e.sources.frame import Light
from adv2e.sources.images.opencv import read_image
from adv2e.sources.images.source import found_list, image_files
from adv2e.sources.listed import ListedSource, Picture, timed
from adv2e.sources.times.lists import FrameList
from adv2e.sources.times.rates import FrameRate, Stamp, Unit

_HZ = 240
_SEQUENCE = re.compile(r"GOPR\d{4}_(\d{2})_\d{2}", re.ASCII)
_FRAME = re.compile(r"\d{6}\.png", re.ASCII)
_KINDS = {
    "sharp": "the camera's curve is about that",
    "blur_gamma": "means of light, encoded again",
    "blur": "means of encoded numbers, no light",
}
"""Folders of ``GOPRO_Large``, the one that is taken first, and what the numbers in them are."""


@dataclass(frozen=True)
class Sequence:
    """Frames of a sequence: their folder, what they are, and one in how many they are."""

    folder: Path
    kind: str
    window: int

    @property
    def rate(self) -> FrameRate:
        """The rate at which their numbers count."""
        return FrameRate(Fraction(_HZ, self.window))

    @property
    def blurred(self) -> bool:
        """True if each frame is the mean of a whole group."""
        return self.kind.startswith("blur")


def find_sequence(path: Path) -> Sequence | None:
    """Return the sequence that a folder is, or whose frames it holds; None: it is of no such.

    Its name and those of its images tell.  They are all frames of the camera, unless a folder above
    or below is of a kind of ``GOPRO_Large``; below a folder of that name without kinds, it is open.
    """
    whole = path.absolute()
    inside = _SEQUENCE.fullmatch(whole.parent.name)
    named = _SEQUENCE.fullmatch(whole.name)
    found: Sequence | None = None
    if inside and whole.name in _KINDS:
        found = Sequence(path, whole.name, int(inside[1]))
    elif named:
        kind = next((kind for kind in _KINDS if (path / kind).is_dir()), "")
        above = next((place.name for place in whole.parents if place.name in _KINDS), "")
        if kind and not image_files(path):
            found = Sequence(path / kind, kind, int(named[1]))
        elif above:
            found = Sequence(path, above, int(named[1]))
        elif not kind and not any(place.name == "GOPRO_Large" for place in whole.parents):
            found = Sequence(path, "all", 1)
    if found is None or found.window == 0 or found_list(found.folder):
        return None
    files = image_files(found.folder)
    return found if files and all(_FRAME.fullmatch(file.name) for file in files) else None


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the frames of a sequence, at the times that their numbers stand for."""
    sequence = find_sequence(path)
    if sequence is None:
        raise DataError(f"{path}: not a sequence of the GOPRO dataset")
    files = image_files(sequence.folder)
    numbers = [int(file.stem) for file in files]
    label = f"the numbers in {sequence.folder}"
    pictures = [Picture(str(f), str(f.absolute()), partial(read_image, f)) for f in files]
    times = timed(given, pictures, path, label, lambda _: _listed(sequence, numbers))
    steps = [after - before for before, after in pairwise(numbers)]
    if not given and (gaps := [at for at, step in enumerate(steps) if step > 1]):
        first, more = gaps[0], f", and at {len(gaps) - 1} more places" if len(gaps) > 1 else ""
        times.notes.append(
            f"{sequence.folder}: no frames between {files[first].name} and"
            f" {files[first + 1].name}{more}; the times leave room for them"
        )
    known = any(place.name == "GOPRO_Large_all" for place in path.absolute().parents)
    if sequence.kind == "all" and not known and not given:
        others = FrameRate(Fraction(_HZ, int(path.absolute().name[9:11]) or 1)).hz
        told = f"its names are of GOPRO_Large_all: {_HZ} frames a second; --fps {others} if they"
        how = f"give --fps {_HZ} or --fps {others}"
        line = guessed(f"{told} are of GOPRO_Large", "fps", _HZ, how)
        times.doubts.append(told_of(path, line))
    if sequence.blurred and not given:
        exposure_us = round(1e6 * sequence.window / _HZ)
        times.notes.append(
            f"each frame is the mean of {sequence.window} frames of the camera: say"
            f" frames.exposure_us={exposure_us} to have the smear undone"
        )
    light = Light("srgb", f"GOPRO: {_KINDS.get(sequence.kind, _KINDS['sharp'])}")
    has_clock = given.timestamps is not None
    return ListedSource(path, "gopro", times, selection, has_clock=has_clock, light=light)


def _listed(sequence: Sequence, numbers: list[int]) -> FrameList:
    time_ns = sequence.rate.time_ns
    stamps = [
        Stamp(time_ns(number - numbers[0]), line, None) for line, number in enumerate(numbers)
    ]
    every = "all frames" if sequence.window == 1 else f"one frame of {sequence.window}"
    rate = f"{_HZ}" if sequence.window == 1 else f"{_HZ}/{sequence.window}"
    part = "GOPRO_Large_all" if sequence.kind == "all" else f"{sequence.kind} of GOPRO_Large"
    return FrameList(stamps, f"{every}, {rate} a second ({part})", Unit("s"))
