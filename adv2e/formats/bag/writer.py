"""Bags of ROS 1 and ROS 2 with events and, where they are asked for, images.

======================= ====================== ====================================================
topic                   message                when it was recorded
======================= ====================== ====================================================
``/dvs/events``         dvs_msgs/EventArray    at its last event; of 10,000 events at most
``/dvs/image_raw``      sensor_msgs/Image      at its time; mono8 or rgb8
======================= ====================== ====================================================

Messages are written in the order of time.  The container is written by the package ``rosbags``, not
compressed, which every reader takes: a ``.bag``, or a folder with metadata.yaml and MCAP, of which
``custom_data`` holds the configuration.
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import MissingExtraError, OutputError
from adv2e.events import EVENT_DTYPE, Events
from adv2e.files.backlog import Backlog
from adv2e.files.staging import Staging
from adv2e.formats.bag.messages import (
    EVENT_ARRAY,
    EVENT_ARRAY_TEXT,
    EVENT_TEXT,
    IMAGE,
    event_array,
    image,
)
from adv2e.formats.sink import Request, Writer, to_json
from adv2e.light.pictures import eight_bit
from adv2e.sources.times.rates import NS_PER_S

_MESSAGE = 10_000  # events
_EVENTS_TOPIC, _IMAGES_TOPIC = "/dvs/events", "/dvs/image_raw"


class _BagWriter(Writer):
    """Base of the writers of both bags: messages in the order of time."""

    _is_cdr = False
    _most_s = 1 << 32

    def __init__(self, request: Request, stack: ExitStack, *temporary: Path) -> None:
        (path,) = temporary
        self._request = request
        self._frames = stack.enter_context(closing(Backlog(path.parent)))
        self._buffer = np.empty(_MESSAGE, EVENT_DTYPE)
        self._held = 0  # events in it
        try:
            import rosbags  # noqa: F401, PLC0415 - an optional package
        except ImportError:
            raise MissingExtraError(f"{request.path}: a bag of ROS", "bag") from None
        self._bag = self._opened(path)
        stack.callback(self._abandon)
        types = self._types()
        self._topics = {
            name: self._bag.add_connection(name, kind, typestore=types)
            for name, kind in ((_EVENTS_TOPIC, EVENT_ARRAY), (_IMAGES_TOPIC, IMAGE))
            if request.with_frames or name == _EVENTS_TOPIC
        }

    def _opened(self, path: Path) -> Any:
        """Return a writer of the package."""
        raise NotImplementedError

    def _types(self) -> Any:
        """Return the definitions of the messages."""
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

        types = get_typestore(Stores.ROS2_HUMBLE if self._is_cdr else Stores.ROS1_NOETIC)
        text = (
            EVENT_TEXT.replace("time ", "builtin_interfaces/Time ") if self._is_cdr else EVENT_TEXT
        )
        types.register(get_types_from_msg(text, "dvs_msgs/msg/Event"))
        types.register(get_types_from_msg(EVENT_ARRAY_TEXT, EVENT_ARRAY))
        return types

    def write_events(self, events: Events) -> None:
        """Append events."""
        while events.size:
            part, events = np.split(events, [_MESSAGE - self._held])
            self._buffer[self._held : self._held + part.size] = part
            self._held += part.size
            if self._held == _MESSAGE:
                self._write_held()

    def write_frame(self, t_ns: int, image: NDArray[Any]) -> None:
        """Append a frame."""
        if not 0 <= t_ns < self._most_s * NS_PER_S:
            raise OutputError(
                f"{self._request.path}: a frame at {t_ns / 1e9:.6f} s does not fit a bag, which"
                f" holds times from 0 to {self._most_s} s; --t0 zero may help"
            )
        self._frames.append(t_ns, eight_bit(image))

    def finish(self) -> None:
        """Write the remaining events and frames, and close the bag."""
        self._write_held()
        while len(self._frames):
            self._write_frame()
        bag, self._bag = self._bag, None
        bag.close()

    def _write_held(self) -> None:
        """Write the events held, and the frames among them."""
        held = self._buffer[: self._held]
        while held.size and len(self._frames):
            cut = int(np.searchsorted(held["t"] * 1000, self._frames.time(0)))
            if cut == held.size:
                break
            self._write_events(held[:cut])
            self._write_frame()
            held = held[cut:]
        self._write_events(held)
        self._held = 0

    def _write_events(self, events: Events) -> None:
        if events.size:
            size = self._request.width, self._request.height
            data = event_array(events, size, self._is_cdr)
            self._bag.write(self._topics[_EVENTS_TOPIC], int(events["t"][-1]) * 1000, data)

    def _write_frame(self) -> None:
        t_ns = self._frames.time(0)
        data = image(self._frames.take(), t_ns, self._is_cdr)
        self._bag.write(self._topics[_IMAGES_TOPIC], t_ns, data)

    def _abandon(self) -> None:
        """Close the open files of a bag where writing failed."""
        raise NotImplementedError


class BagWriter(_BagWriter):
    """Writes a bag of ROS 1; its bytes follow from its content."""

    def _opened(self, path: Path) -> Any:
        from rosbags import rosbag1  # noqa: PLC0415 - an optional package

        bag = rosbag1.Writer(path)
        bag.open()
        return bag

    def _abandon(self) -> None:
        if self._bag is not None and self._bag.bio is not None:
            self._bag.bio.close()


class Ros2Writer(_BagWriter):
    """Writes a bag of ROS 2, a folder; its bytes follow from its content."""

    _is_cdr = True
    _most_s = 1 << 31

    @staticmethod
    def stage(path: Path, staging: Staging) -> list[Path]:
        """Return the temporary name of the folder."""
        return [staging.folder(path, _foreign)]

    def _opened(self, path: Path) -> Any:
        from rosbags import rosbag2  # noqa: PLC0415 - an optional package

        path.mkdir()
        # the package calls the file as its folder, which has its final name when all is written
        self._folder = path / (self._request.path.name or "bag")
        plugin = rosbag2.StoragePlugin.MCAP
        bag = rosbag2.Writer(self._folder, version=8, storage_plugin=plugin)
        bag.set_custom_data("adv2e", to_json(self._request.description))
        bag.open()
        return bag

    def finish(self) -> None:
        """Write the remaining events and frames, and close the bag."""
        super().finish()
        for file in sorted(self._folder.iterdir()):
            file.rename(self._folder.parent / file.name)
        self._folder.rmdir()

    def _abandon(self) -> None:
        if self._bag is not None:
            self._bag.abort()


def _foreign(folder: Path) -> str | None:
    """Name something in `folder` that this layout, as written here, does not have."""
    ours = (f"{folder.name}.mcap", "metadata.yaml")
    return next((e.name for e in sorted(folder.iterdir()) if e.name not in ours), None)
