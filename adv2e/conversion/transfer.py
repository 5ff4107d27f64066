"""Events of one file, written to another: no simulation, part by part in bounded memory.

The file is read twice: first to see how large the sensor is and whether the events are in the order
of time, then to write them (:func:`adv2e.formats.reading.events_in_order`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adv2e import __version__
from adv2e.causes import CAUSES
from adv2e.conversion.pipeline import Summary, versions
from adv2e.effects.frames.encoding import LightDecoder, full_scale_of
from adv2e.errors import DataError
from adv2e.files.regular import shown
from adv2e.files.staging import Staging
from adv2e.formats.event_file import EventFile
from adv2e.formats.reading import events_in_order, open_events, shots_of, wanted_us
from adv2e.formats.registry import check_frames, to_write
from adv2e.formats.writing import PACKAGES, Sink, open_sink
from adv2e.geometry import Size
from adv2e.label import Label, left_out
from adv2e.light.pictures import picture_of, picture_white
from adv2e.options import CopyOptions, EventInput, chosen, crop_of, takes
from adv2e.process.bars import share_bar
from adv2e.side.carrying import SideData, find_side
from adv2e.side.placement import Clock, Placement
from adv2e.sources.frame import Frame, Light

if TYPE_CHECKING:
    from typing_extensions import Unpack

_MADE = ("adv2e", "versions", "config", "seed", "effects", "network", "source")
"""Metadata of a file of ours on the making of its events, which stay true of a copy."""


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
        size, first_us, parts = events_in_order(file)
        width, height = size
        crop = crop_of(options) or (0, 0, *size)
        origin_us = first_us if options["t0"] == "zero" else 0
        frames = file.shots is not None and (with_frames or keeps_all_bits)
        tell = label = Label(doubt or log, facts.description.get("label"))
        label.add(*facts.problems, *facts.selection.left_out)
        if options["strict"]:
            label.refuse(path)
        kept = {"frames": file.shots is None or frames, "causes": file.causes is None or causes}
        label.add(*(left_out(name) for name in kept if not kept[name]))
        side = side_of(file, options["side"], tell)
        clock = partial(clock_of, file, origin_us)
        with Staging(options["overwrite"], file.inputs) as staging, ExitStack() as stack:
            sink = stack.enter_context(
                open_sink(
                    output,
                    width=width,
                    height=height,
                    metadata={
                        **copied_metadata(
                            file,
                            {"crop": list(crop), "origin_us": origin_us},
                            frames=frames,
                            keeps_all_bits=keeps_all_bits,
                        ),
                        **({"causes": CAUSES} if causes else {}),
                        "label": label.entries,
                    },
                    format=options["format"],
                    layout=options["layout"],
                    with_frames=frames,
                    threads=options["threads"],
                    staging=staging,
                    causes=causes,
                    side=None if side is None or output == "-" else side.files(clock, tell),
                )
            )
            stored = _write_frames(file, Size(*size), origin_us, sink, keeps_all_bits)
            events = on = first = last = 0
            for chunk in parts:
                chunk["t"] -= origin_us
                sink.write_events(chunk)
                first = first if events else int(chunk["t"][0])
                last = int(chunk["t"][-1])
                events += chunk.size
                on += int(np.count_nonzero(chunk["p"]))
    for text in dict.fromkeys(facts.problems):
        (doubt or log)(f"{path}: {text}")
    if side is not None:
        log("standard output holds no side data" if output == "-" else side.told())
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


def side_of(
    file: EventFile, given: str | Path | None, doubt: Callable[[str], None]
) -> SideData | None:
    """Return the side data of an event file, of which events were asked for in order."""
    place = Placement.of(Size(*file.facts.whole), file.facts.selection)
    return find_side(file.facts.path, given, place, doubt, file.facts.uncarried)


def clock_of(file: EventFile, origin_us: int = 0) -> Clock:
    """Return the way from the clock of an event file to that of its events, from an origin on."""
    begin_us, end_us = wanted_us(file)
    shots = [] if file.shots is None else list(file.shots())
    return Clock(
        frames=np.array([shot.t_ns for shot in shots], np.int64),
        names=[shot.label for shot in shots],
        begin=begin_us * 1000 - 500,
        end=end_us * 1000 + 499,
        zero=origin_us * 1000,
    )


def _write_frames(
    file: EventFile, size: Size, origin_us: int, sink: Sink, keeps_all_bits: bool
) -> int:
    """Write the frames, if any are wanted, their times counted from an origin; return how many."""
    count = 0
    for shot in shots_of(file) if sink.wants_frames else ():
        picture = stored_picture(shot.load(), file.facts.light, keeps_all_bits)
        rows, columns = picture.shape[:2]
        if columns < size.width or rows < size.height:
            raise DataError(
                f"{shot.label}: {columns}x{rows} pixels, fewer than events have ({size}); leave the"
                " frames out"
            )
        sink.write_frame(shot.t_ns - origin_us * 1000, picture[: size.height, : size.width])
        count += 1
    return count


def stored_picture(frame: Frame, light: Light, keeps_all_bits: bool) -> NDArray[Any]:
    """Return a frame of an event file in the whole numbers that are stored."""
    image, white = frame.image, _white(frame, light)
    decoder = LightDecoder(light.encoding, white, image.dtype, image.ndim == 3)
    return picture_of(image, frame.alpha, decoder, not keeps_all_bits)


def _white(frame: Frame, light: Light) -> float:
    return light.full_scale or frame.white or full_scale_of(frame.image.dtype)


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
    if frames and (first := next(shots_of(file), None)) is not None:
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
