"""The frames of a source on their way to the pixel, read ahead of it.

Reading begins before anybody has said what the frames are to become: what a configuration needs
takes as long to import as a short video to decode.  What was read until then waits as it is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import NDArray

from adv2e.background import default_threads, read_ahead
from adv2e.effects.frames.brightness import check_floats, check_light
from adv2e.errors import Adv2eError, DataError
from adv2e.formats.frames import open_frames
from adv2e.label import Seen
from adv2e.light.pictures import picture_of
from adv2e.options import SourceOptions, takes
from adv2e.sources import STDIN
from adv2e.sources.base import Source
from adv2e.sources.frame import Frame

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from adv2e.effects.frames.encoding import LightDecoder
    from adv2e.effects.hooks import LightFrame
    from adv2e.light.sensor import Fitting

AHEAD_BYTES, AHEAD_FRAMES = 16 << 20, 256
"""Memory for frames that were decoded and not taken yet, light and what is seen of them."""

EARLY_BYTES = 32 << 20
"""Memory for frames that were read before it was known what they are to become."""


Decoded: TypeAlias = "tuple[LightFrame, NDArray[Any] | None]"
"""A frame decoded for the pixels and, where it is kept, its picture."""


@dataclass(frozen=True)
class Decoding:
    """Decoding of frames to light, and to pictures for the output.

    Parameters
    ----------
    decoder : LightDecoder
    coded : bool
        Frames stay as they were read: the kernel decodes them itself.
    with_pictures : bool
        Pictures of the frames are kept, too.
    full_scale : float, optional
        Number that means white, as configured.
    eight_bit : bool
        Pictures must be of 8 bits.
    fitting : Fitting, optional
        Fitting of the frames to the sensor; None: they have its size.
    seen : Seen, optional
        Takes note of each frame.
    """

    decoder: LightDecoder
    coded: bool
    with_pictures: bool
    full_scale: float | None = None
    eight_bit: bool = False
    fitting: Fitting | None = None
    seen: Seen | None = None

    def decoded(self, frame: Frame) -> Decoded:
        """Return a frame decoded for the pixels; DataError if its white is not as configured."""
        check_floats(frame.image, frame.label, self.full_scale)
        if frame.odd_white and self.full_scale is None:
            raise DataError(f"{frame.label}: {frame.odd_white}")
        picture, fitting = None, self.fitting
        if fitting is not None and frame.offset is not None:
            fitting = fitting.moved(frame.offset)
        if self.with_pictures:
            picture = picture_of(frame.image, frame.alpha, self.decoder, self.eight_bit, fitting)
        if not self.coded:
            light = self.decoder.decode(frame.image, frame.alpha)
            if fitting is not None:
                light = fitting.light(light, frame.label)
        elif frame.alpha is None:
            light = frame.image
        else:
            light = self.decoder.over_black(frame.image, frame.alpha)
        if frame.image.dtype.kind == "f":  # here, where its name is known
            check_light(light, frame.label)
        if self.seen is not None:
            self.seen.add(frame.t_ns, frame.image, frame.offset, light)
        return (frame.t_ns, light), picture


class Reading(ExitStack):
    """A source, and the reading of its frames; to be used as a context, once.

    With more than one thread, frames are read in a thread of their own from the beginning of the
    context on; with one, when they are taken.

    Parameters
    ----------
    path : str
    threads : int, optional
        Threads that the whole conversion may compute with; default: all cores.
    **options
        See :func:`adv2e.sources.open_source`.
    """

    @takes(SourceOptions)
    def __init__(
        self, path: str, *, threads: int | None = None, **options: Unpack[SourceOptions]
    ) -> None:
        self.path, self.options = path, options
        self.threads = threads or default_threads()
        super().__init__()
        self._opened: Source | Adv2eError | None = None
        self._decoding: Future[Decoding] = Future()
        self._decoded: Iterator[Decoded] = iter(())

    @property
    def source(self) -> Source:
        """The source.

        Raises
        ------
        Adv2eError
            It could not be opened.
        """
        if isinstance(self._opened, Adv2eError):
            raise self._opened
        assert self._opened is not None, "not entered"
        return self._opened

    @property
    def inputs(self) -> tuple[str | Path, ...]:
        """Files that are read: those of the source, and the list of times if there is one."""
        source = () if self.path == STDIN else self.source.inputs
        return *source, *filter(None, [self.options["timestamps"]])

    def capturing(self, told: str) -> AbstractContextManager[None]:
        """Return a context within which Ctrl-C ends a pipe's frames, as `told`; see `Source`."""
        return self._opened.capturing(told) if isinstance(self._opened, Source) else nullcontext()

    def decoded(self, decoding: Decoding) -> Iterator[Decoded]:
        """Return the frames, as `decoding` says; raises what goes wrong with them."""
        self._decoding.set_result(decoding)
        return self._decoded

    def __enter__(self) -> Reading:
        try:
            source = self._opened = open_frames(self.path, **self.options)
        except Adv2eError as error:  # the other parts of the command may be wrong, too
            self._opened = error
            return self
        source.threads = self.threads
        self._decoded = _decoded(source.frames(), self._decoding)
        if self.threads > 1 and not source.waits:
            count = AHEAD_BYTES // (8 * source.width * source.height)
            self._decoded = self.enter_context(
                read_ahead(self._decoded, min(max(1, count), AHEAD_FRAMES))
            )
            self.callback(self._decoding.cancel)  # its thread may wait for it
        return self


def _decoded(frames: Iterator[Frame], decoding: Future[Decoding]) -> Generator[Decoded, None, None]:
    """Yield the frames once it is known what they are to become, some of them read before."""
    waiting: deque[Frame] = deque()
    room = EARLY_BYTES
    wrong: Adv2eError | None = None
    # large frames fill the memory: none stays longer than it is needed
    try:
        for frame in frames:
            waiting.append(frame)
            room -= frame.image.nbytes
            del frame
            if room <= 0 or decoding.done():
                break
    except Adv2eError as error:  # those before it come first
        wrong = error
    known = decoding.result()
    while waiting:
        yield known.decoded(waiting.popleft())
    if wrong is not None:
        raise wrong
    for frame in frames:
        seen = known.decoded(frame)
        del frame
        yield seen
        del seen
