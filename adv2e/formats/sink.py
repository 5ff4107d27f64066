"""What events and frames go to: it leaves a finished output or none."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from numpy.typing import NDArray

from adv2e.events import Events
from adv2e.files.staging import Staging, writing


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is to be written, as :func:`adv2e.formats.writing.open_sink` was told."""

    path: Path
    width: int
    height: int
    description: dict[str, Any]
    with_frames: bool
    threads: int


class Writer(ABC):
    """Writes a format, files under their temporary names.

    Parameters
    ----------
    request : Request
    stack : ExitStack
        Takes what is to be closed, however writing ends.
    *temporary : Path
        What :meth:`stage` returned.
    """

    takes_frames: ClassVar[bool] = False

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return the temporary names of the files that make the output `path`."""
        return [staging.file(path)]

    @abstractmethod
    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None: ...

    @abstractmethod
    def write_events(self, events: Events) -> None:
        """Append events."""

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        raise NotImplementedError  # a format that takes frames says how

    def finish(self) -> None:  # noqa: B027
        """Write what is left."""


class Sink:
    """Takes the events and frames of one recording, inside a ``with`` block.

    Leaving the block normally finishes the output; an exception leaves no trace of it.

    Parameters
    ----------
    writer : type
        Says how.
    request : Request
    staging : Staging
        Takes the files.
    is_alone : bool
        They come into place, or go, at the end of the sink; else with others of the `staging`.

    Attributes
    ----------
    wants_frames : bool
        Whether frames are stored; if not, they are ignored.
    """

    def __init__(
        self, writer: type[Writer], request: Request, staging: Staging, *, is_alone: bool
    ) -> None:
        self.wants_frames = request.with_frames and writer.takes_frames
        self._name = "standard output" if str(request.path) == "-" else str(request.path)
        temporary = writer.stage(request.path, staging)
        self._open = self._opened(partial(writer, request), staging, temporary, is_alone)

    @contextmanager
    def _opened(
        self,
        writer: Callable[..., Writer],
        staging: Staging,
        temporary: list[Path],
        is_alone: bool,
    ) -> Iterator[Writer]:
        with staging if is_alone else nullcontext(), _closing() as stack:
            with writing(self._name):
                staging.prepare()
                made = writer(stack, *temporary)
            yield made
            with writing(self._name):
                made.finish()
                stack.close()

    def write_events(self, events: Events) -> None:
        """Append events; over all calls they are sorted by time.

        Raises
        ------
        OutputError
            They cannot be written, as when the disk is full.
        BrokenPipeError
            They go to standard output, and nobody reads them any more.
        """
        with writing(self._name):
            self._writer.write_events(events)

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame taken at `t_ns` [ns]; over all calls sorted by time.

        `image` is uint8 or uint16, (rows, columns) or (rows, columns, 3) in RGB.  It may come
        long before the events around it.
        """
        if self.wants_frames:
            with writing(self._name):
                self._writer.write_frame(t_ns, image)

    def __enter__(self) -> Sink:
        self._writer = self._open.__enter__()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._open.__exit__(*raised)


@contextmanager
def _closing() -> Iterator[ExitStack]:
    """Give a stack for files; where the body raises, what closing them says is of no interest."""
    stack = ExitStack()
    try:
        yield stack
    except BaseException:
        with suppress(Exception):
            stack.close()
        raise
    stack.close()


def to_json(description: dict[str, Any]) -> str:
    """Return the description as text, the same for the same content, and fit for UTF-8."""
    text = json.dumps(description, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
