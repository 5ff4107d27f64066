"""What a sink is: it takes sorted events and frames, and leaves a finished output or none."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeVar

from numpy.typing import NDArray

from adv2e.errors import OutputError
from adv2e.events import Events
from adv2e.files.staging import Staging

Self = TypeVar("Self")


class Sink(Protocol):
    """Takes the events and frames of one recording, inside a ``with`` block.

    Leaving the block normally finishes the output; an exception leaves no trace of it.
    """

    @property
    def wants_frames(self) -> bool:
        """Whether frames are stored; if not, they are ignored."""

    def write_events(self, events: Events) -> None:
        """Append events; over all calls they are sorted by time."""

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame taken at `t_ns` [ns]; over all calls sorted by time.

        `image` is uint8 or uint16, (rows, columns) or (rows, columns, 3) in RGB.  It may come
        long before the events around it.
        """

    def __enter__(self: Self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


class FileSink(ABC):
    """A sink that writes files; derived classes say how.

    Parameters
    ----------
    path : Path
        The output as the user named it, for messages.
    staging : Staging
        Its files and folders.
    """

    wants_frames = False

    def __init__(self, path: Path, staging: Staging) -> None:
        self.path = path
        self._staging = staging

    def write_events(self, events: Events) -> None:
        """Append events; over all calls they are sorted by time."""
        with self._naming():
            self._write_events(events)

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame taken at `t_ns` [ns], if frames are wanted."""
        if self.wants_frames:
            with self._naming():
                self._write_frame(t_ns, image)

    def __enter__(self: Self) -> Self:
        assert isinstance(self, FileSink)
        try:
            with self._naming():
                self._staging.prepare()
                self._open()
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._leave()
            return
        try:
            with self._naming():
                self._finish()
                self._staging.commit()
        except BaseException:
            self._leave()
            raise

    def _leave(self) -> None:
        try:
            with suppress(Exception):  # the file is incomplete and goes away, whatever close says
                self._abandon()
        finally:
            self._staging.discard()

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """Name the output in errors of the system, such as a full disk."""
        try:
            yield
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written: {_reason(error)}") from error

    @abstractmethod
    def _open(self) -> None:
        """Open the files under their temporary names."""

    @abstractmethod
    def _write_events(self, events: Events) -> None: ...

    def _write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        raise NotImplementedError  # a sink that wants frames says how

    @abstractmethod
    def _finish(self) -> None:
        """Write what is left and close the files."""

    @abstractmethod
    def _abandon(self) -> None:
        """Close what is open; the files are incomplete and will be removed."""


def _reason(error: OSError) -> str:
    """Return what the system says, which HDF5 wraps in addresses and offsets."""
    text = error.strerror or str(error)
    inner = re.search(r"error message = '([^']*)'", text)
    return inner[1] if inner else text


def describe(metadata: dict[str, Any], width: int, height: int) -> dict[str, Any]:
    """Return what a file says of itself: the metadata and the geometry [pixels]."""
    version = {"adv2e": metadata["adv2e"]} if "adv2e" in metadata else {}
    return {**version, "width": width, "height": height, **metadata}


def to_json(description: dict[str, Any]) -> str:
    """Return the description as text, the same for the same content, and fit for UTF-8."""
    text = json.dumps(description, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def seconds_text(t_ns: int) -> str:
    """Return a time [ns] in seconds with nine decimals, exactly."""
    whole, rest = divmod(abs(t_ns), 1_000_000_000)
    return f"{'-' if t_ns < 0 else ''}{whole}.{rest:09d}"
