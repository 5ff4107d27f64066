"""Events of one file, written to another: no simulation, part by part in bounded memory.

The file is read twice: first to see how large the sensor is and whether the events are in the order
of time, then to write them.  Events out of order are sorted, for which all are kept in memory.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.causes import CAUSES
from adv2e.conversion.pipeline import Summary, versions
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of
from adv2e.errors import DataError
from adv2e.events import Events
from adv2e.files.regular import shown
from adv2e.files.staging import Staging
from adv2e.formats.event_file import EventFile
from adv2e.formats.reading import events_in_order, inside, open_events
from adv2e.formats.registry import check_frames, to_write
from adv2e.formats.writing import PACKAGES, Sink, open_sink
from adv2e.geometry import Rectangle
from adv2e.light.pictures import picture_of, picture_white
from adv2e.options import CopyOptions, EventInput, chosen, crop_of, takes
from adv2e.process.bars import share_bar
from adv2e.sources.base import Selection
from adv2e.sources.frame import Light, Pixels

if TYPE_CHECKING:
    from typing_extensions import Unpack

_MADE = ("adv2e", "versions", "config", "seed", "effects", "network", "source")
"""Metadata of a file of ours on the making of its events, which stay true of a copy."""


@dataclass(frozen=True)
class _Part:
    """Part of a recording to copy, in time and space, and the origin of its time.

    Attributes
    ----------
    first_us, last_us : float
        First and last time wanted, both inclusive [us].
    origin_us : int
        Time that becomes zero [us].
    crop : Rectangle
    """

    first_us: float
    last_us: float
    origin_us: int
    crop: Rectangle

    def of(self, events: Events) -> Events:
        """Return the part of sorted events, with timestamps and coordinates of the output."""
        begin = np.searchsorted(events["t"], self.first_us, "left")
        end = np.searchsorted(events["t"], self.last_us, "right")
        x, y, width, height = self.crop
        events = events[begin:end]
        if (x, y) != (0, 0):
            events = events[(events["x"] >= x) & (events["y"] >= y)]
            events["x"] -= x
            events["y"] -= y
        events = inside(events, (width, height))
        events["t"] -= self.origin_us
        return events

    def image_of(self, image: NDArray[Any], label: str) -> NDArray[Any]:
        """Return the crop of a frame; DataError if it is smaller than the sensor."""
        x, y, width, height = self.crop
        if image.shape[0] < y + height or image.shape[1] < x + width:
            raise DataError(
                f"{label}: {image.shape[1]}x{image.shape[0]} pixels, fewer than events have"
                f" ({x + width}x{y + height}); leave the frames out"
            )
        return image[y : y + height, x : x + width]


@takes(CopyOptions)
def convert_events(
    path: str,
    output: str,
    *,
    log: Callable[[str], None] = lambda text: None,
    doubt: Callable[[str], None] | None = None,
    **options: Unpack[CopyOptions],
) -> Summary:
    """Write the events of a file to another, of any format.

    Parameters
    ----------
    path : str
        Event file, or folder.
    output : str
        Output path ("-": text to stdout).
    log, doubt : callable
        Take lines for people; `doubt` those that ask for a look, by default `log`.
    **options
        See :class:`adv2e.options.CopyOptions`.  Of `t0`, auto is keep: times stay.

    Raises
    ------
    Adv2eError
        For anything wrong with input or output; then no output file is left.
    """
    began = time.perf_counter()
    selection = Selection(options["start_s"], options["stop_s"], options["t0"])
    with_frames, causes = options["with_frames"], options["causes"]
    chosen_format = to_write(Path(output), options["format"], options["layout"])
    if with_frames:
        check_frames(chosen_format)
    keeps_all_bits = chosen_format.is_davis240c
    file = open_events(path, **chosen(EventInput, options))
    facts = file.facts
    if with_frames and file.shots is None:
        raise DataError(f"{path}: holds events and no frames: leave --with-frames out")
    if causes and file.causes is None:
        raise DataError(
            f"{path}: its events have no causes; only 'adv2e convert --causes' has them"
        )
    doing = f"looking through {Path(path).name}"
    with share_bar(doing, "writing", options["progress"]) as facts.progress:
        found, first_us, parts = events_in_order(file)
        part = _part(path, found, first_us, selection, crop_of(options))
        width, height = part.crop[2:]
        frames = file.shots is not None and (with_frames or keeps_all_bits)
        with Staging(options["overwrite"], file.inputs) as staging, ExitStack() as stack:
            sink = stack.enter_context(
                open_sink(
                    output,
                    width=width,
                    height=height,
                    metadata={
                        **copied_metadata(
                            file,
                            {"crop": list(part.crop), "origin_us": part.origin_us},
                            frames=frames,
                            keeps_all_bits=keeps_all_bits,
                        ),
                        **({"causes": CAUSES} if causes else {}),
                    },
                    format=options["format"],
                    layout=options["layout"],
                    with_frames=frames,
                    threads=options["threads"],
                    staging=staging,
                    causes=causes,
                )
            )
            stored = _write_frames(file, part, sink, keeps_all_bits) if sink.wants_frames else 0
            events = on = first = last = 0
            for chunk in parts:
                ends = chunk["t"][-1] > part.last_us
                wanted = part.of(chunk)
                if wanted.size:
                    sink.write_events(wanted)
                    first = first if events else int(wanted["t"][0])
                    last = int(wanted["t"][-1])
                    events += wanted.size
                    on += int(np.count_nonzero(wanted["p"]))
                if ends:
                    break
            parts.close()
    for text in dict.fromkeys(facts.problems):
        (doubt or log)(f"{path}: {text}")
    return Summary(
        output=output,
        width=width,
        height=height,
        frames=stored,
        duration_s=(last - first) * 1e-6,
        events=events,
        on=on,
        seconds=time.perf_counter() - began,
        copied_from=path,
    )


def _part(
    path: str, size: tuple[int, int], first_us: int, wanted: Selection, crop: Rectangle | None
) -> _Part:
    """Return the part of a recording to copy; DataError if the crop is not on its sensor."""
    crop = crop or Rectangle(0, 0, *size)
    if not crop.is_inside(*size):
        raise DataError(
            f"{path}: --crop {crop} does not lie on the sensor of {size[0]}x{size[1]} pixels"
        )
    begin = first_us + wanted.start_ns / 1000 if wanted.start_ns else -math.inf
    end = first_us + wanted.stop_ns / 1000
    origin = first_us + wanted.start_ns // 1000 if wanted.t0 == "zero" else 0
    return _Part(begin, end, origin, crop)


def _write_frames(file: EventFile, part: _Part, sink: Sink, keeps_all_bits: bool) -> int:
    """Write the frames of the part that is wanted; return how many."""
    assert file.shots is not None
    count = 0
    for shot in file.shots():
        if part.first_us <= shot.t_ns / 1000 <= part.last_us:
            picture = stored_picture(shot.load(), file.facts.light, keeps_all_bits)
            sink.write_frame(shot.t_ns - part.origin_us * 1000, part.image_of(picture, shot.label))
            count += 1
    return count


def stored_picture(pixels: Pixels, light: Light, keeps_all_bits: bool) -> NDArray[Any]:
    """Return a frame of an event file in the whole numbers that are stored."""
    image, white = pixels.image, _white(pixels, light)
    decoder = LightDecoder(light.encoding, white, image.dtype, image.ndim == 3)
    return picture_of(image, pixels.alpha, decoder, not keeps_all_bits)


def _white(pixels: Pixels, light: Light) -> float:
    return light.full_scale or pixels.white or full_scale_of(pixels.image.dtype)


def copied_metadata(
    file: EventFile, converted: dict[str, Any], *, frames: bool, keeps_all_bits: bool
) -> dict[str, Any]:
    """Return the metadata of copied events: those of their file, and the copying itself.

    Parameters
    ----------
    file : EventFile
    converted : dict
        What was done.
    frames, keeps_all_bits : bool
        Its frames are stored, too; with all their bits, or with 8.
    """
    facts = file.facts
    made = {name: facts.description[name] for name in _MADE if name in facts.description}
    origin = {"name": shown(facts.path.name), "kind": file.layout}
    stored: dict[str, Any] = {}
    if frames and file.shots is not None and (first := next(file.shots(), None)) is not None:
        pixels, light = first.load(), facts.light
        white = picture_white(pixels.image.dtype, _white(pixels, light), not keeps_all_bits)
        stored = {"frames": {"encoding": light.encoding, "full_scale": white}}
    return {
        "adv2e": __version__,
        "versions": versions(PACKAGES),
        "source": origin,
        **made,
        "converted": {"adv2e": __version__, **origin, **converted},
        **stored,
    }
