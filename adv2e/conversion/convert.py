"""A whole conversion in one call: what ``adv2e convert`` does."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from adv2e.errors import DataError, UsageError, warn
from adv2e.in_python import in_python
from adv2e.options import (
    ConvertOptions,
    CopyOptions,
    SimulatedOutput,
    SourceOptions,
    chosen,
    declared,
    size_of,
    takes,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.config import Config, Written
    from adv2e.conversion.pipeline import Opening, Summary
    from adv2e.geometry import Size


@takes(ConvertOptions)
def convert(
    source: str | Path,
    output: str | Path | None = None,
    config: Written | Sequence[Written] | None = None,
    **options: Unpack[ConvertOptions],
) -> Summary:
    """Convert a video, a folder of images or a recording to a file of events.

    A file of events is written in another format, and nothing is simulated.

    Parameters
    ----------
    source : str or Path
        Video, folder of images, DAVIS240C recording, .npy stack of frames, or file of events.
    output : str or Path, optional
        File or folder to write; the suffix gives the format: .h5, .txt, .zip, or none for a
        DAVIS240C folder.  Default: ``<stem>.events.h5`` in the current folder.
    config : Config, or what :func:`adv2e.load_config` takes, optional
    **options
        See :class:`adv2e.options.ConvertOptions`.

    Returns
    -------
    Summary
        Counts, sizes, and what was noted, such as how light was decoded (`notes`).

    Raises
    ------
    DataError, ConfigError, OutputError, UsageError
        What is wrong with the input, the configuration, the output, or the arguments.

    Warns
    -----
    UserWarning
        Something about the input is in doubt, such as the unit of its times.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> from adv2e import convert
    >>> folder = tempfile.TemporaryDirectory()
    >>> clip = os.path.join(folder.name, "clip.npy")
    >>> np.save(clip, np.repeat(np.array([20, 40, 80, 160], np.uint8), 32 * 24).reshape(4, 24, 32))
    >>> config = ["davis346", {"frames": {"encoding": "srgb"}}]
    >>> done = convert(clip, os.path.join(folder.name, "clip.h5"), config, fps=100)
    >>> (done.width, done.height, done.frames, done.events > 0)
    (346, 260, 4, True)
    >>> folder.cleanup()
    """
    from adv2e.config import files_among, load_config  # noqa: PLC0415 - as below

    notes: list[str] = []
    summary = convert_input(
        str(source),
        None if output is None else str(output),
        lambda size: load_config(config, size=size),
        configured="" if config is None else "config",
        also_read=lambda: files_among(config),
        log=notes.append,
        doubt=lambda text: warn(in_python(text)),
        **options,
    )
    return replace(summary, notes=tuple(map(in_python, notes)))


@takes(ConvertOptions)
def convert_input(
    source: str,
    output: str | None,
    config: Callable[[Size | None], Config],
    *,
    configured: str = "",
    also_read: Callable[[], Iterable[str | Path]] = tuple,
    log: Callable[[str], None],
    doubt: Callable[[str], None] | None = None,
    begin: Callable[[], None] = lambda: None,
    ready: Callable[[], None] = lambda: None,
    capturing: str | None = None,
    opening: Opening | None = None,
    source_sha256: str | None = None,
    **options: Unpack[ConvertOptions],
) -> Summary:
    """Do what :func:`convert` does; errors name options of the command line.

    Parameters
    ----------
    source, output
        See :func:`convert`.
    config : callable
        Returns the configuration for a sensor of a size.  It is called once the frames are read
        ahead: configurations know of all effects, and importing these takes its time.
    configured : str
        Name of the option that gives a configuration, if one does.
    also_read : callable
        Returns the files that the configuration is made of, which must not be written over.
    log, doubt : callable
        Take lines for people; `doubt` those that ask for a look, by default `log`.
    begin : callable
        Is called first of all where frames are simulated.
    ready : callable
        Is called before the simulation, when all is imported and opened.
    capturing : str, optional
        What is told where Ctrl-C ends the frames of a pipe; default: it ends the conversion.
    opening : callable, optional
        Opens the output of a simulation; default: a file of events.
    source_sha256 : str, optional
        SHA-256 of the source, for the label of a simulation.
    **options
        See :class:`adv2e.options.ConvertOptions`.
    """
    if _takes_events(source, options, configured):
        from adv2e.conversion.transfer import convert_events  # noqa: PLC0415 - no kernel, fast

        if output is None:
            raise UsageError("-o OUT is missing: say what to write the events to")
        copied = chosen(CopyOptions, options)
        return convert_events(source, output, log=log, doubt=doubt, **copied)
    if options["set_back"] or options["crop_events"]:
        raise DataError(
            f"{source}: its frames are simulated: --set-back and --crop-events are for events,"
            " leave them out"
        )
    begin()
    from adv2e.conversion.reading import Reading  # noqa: PLC0415 - as above

    reading = Reading(source, threads=options["threads"], **chosen(SourceOptions, options))
    # it reads while all else that is needed is imported
    with reading, nullcontext() if capturing is None else reading.capturing(capturing):
        from adv2e.conversion.pipeline import convert_reading  # noqa: PLC0415

        of_raw_video = options["crop"] is not None and options["pixel_format"] is not None
        ready_config = config(None if of_raw_video else size_of(options))
        ready()
        return convert_reading(
            reading,
            output,
            config=ready_config,
            progress=options["progress"],
            also_read=also_read(),
            log=log,
            doubt=doubt,
            source_sha256=source_sha256,
            **({} if opening is None else {"opening": opening}),
            **chosen(SimulatedOutput, options),
        )


_SIMULATED = (
    *("fps", "timestamps", "allow_damaged", "bayer", "pixel_format", "motion", "preview"),
    "blurred_frames",
)
"""Options that say how frames are simulated."""


def _takes_events(source: str, options: ConvertOptions, configured: str) -> bool:
    """Tell whether to copy the events of the source, without a simulation.

    Raises
    ------
    DataError
        Events are copied, but options of a simulation are given.
    """
    from adv2e.formats.registry import may_hold_events  # noqa: PLC0415 - as above

    if options["take"] is None and not may_hold_events(Path(source)):
        return False
    from adv2e.formats.frames import takes_events  # noqa: PLC0415

    if not takes_events(Path(source), options["take"], options["track"]):
        return False
    known = declared(ConvertOptions)
    given = [known[name].flag_of(name) for name in _SIMULATED if options.get(name)]
    for flag in filter(None, [configured, *given]):
        raise DataError(
            f"{source}: its events are written, nothing is simulated: leave out {flag}, or take its"
            " frames, if it has any, with --from frames"
        )
    return True
