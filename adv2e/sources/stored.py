"""Encoding of frames that are stored beside events, from the description written with them.

``frames`` of ``adv2e.json`` (or of the attribute ``adv2e``) tells the encoding of the numbers
stored and which of them means white; files that were written before it was there tell the encoding,
in ``source``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from adv2e.effects.frames.encoding import check_encoding
from adv2e.errors import ConfigError, DataError
from adv2e.files.regular import reading
from adv2e.sources.frame import RECORDED, Light

EVENTS, LIST, DESCRIPTION = "events.txt", "images.txt", "adv2e.json"
"""Files of a recording: its events, its frames and their times, and how it was made."""

_REASON = "as adv2e stored them"

MOST_BYTES = 16 << 20
"""Longest description that is read; one with effects of one's own holds their text."""


def light_stored(description: Any, label: str) -> Light | None:
    """Return the encoding that a description states for the frames stored with it; None: none.

    Raises
    ------
    DataError
        It states an impossible value; names `label` and the key.
    """
    if not isinstance(description, dict):
        return None
    for section in ("frames", "source"):
        stated = description.get(section)
        if isinstance(stated, dict) and "encoding" in stated:
            break
    else:
        return None
    encoding = stated["encoding"]
    try:
        if not isinstance(encoding, str) or encoding == "auto":
            raise ConfigError(f"encoding: must be linear, srgb or another name, got {encoding!r}")
        check_encoding(encoding)
    except ConfigError as error:
        raise DataError(f"{label}: {section}.{error}") from error
    # of the source it is the white before the frames were stored, perhaps in other numbers
    white = stated.get("full_scale") if section == "frames" else None
    if white is not None and not _is_white(white):
        raise DataError(f"{label}: {section}.full_scale: must be a number above 0, got {white!r}")
    return Light(encoding, _REASON, white, is_stated=True)


def recorded_light(description: Any, label: str) -> Light:
    """Return the encoding of frames beside events, as a conversion takes them.

    Frames that cameras recorded are linear; for frames that this program stored, the description
    states it.

    Raises
    ------
    DataError
        As :func:`light_stored`.
    """
    return light_stored(description, label) or Light("linear", RECORDED)


def _is_white(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and 0 < value < 1e300


def read_light(text: bytes, label: str) -> Light | None:
    """Return the encoding in the text of a description; None if adv2e did not write it.

    Raises
    ------
    DataError
        As :func:`light_stored`; or it is too long to be ours.
    """
    if len(text) > MOST_BYTES:
        raise DataError(f"{label}: more than {MOST_BYTES >> 20} MiB; it cannot be of adv2e")
    try:
        description = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return light_stored(description, label)


def light_beside(file: Path) -> Light | None:
    """Return the encoding in a description beside frames; None if there is no such file."""
    if not file.is_file():
        return None
    with reading(file), file.open("rb") as opened:
        text = opened.read(MOST_BYTES + 1)
    return read_light(text, str(file))
