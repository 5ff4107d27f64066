"""Pictures and films of events: drawing, laying out, writing.

======== =========================================================================================
styles   ``adv2e.rendering.styles``: events of a window -> picture (rows, columns, 3), uint8 RGB
layout   panels side by side, captions, contact sheets
films    files that take pictures one by one: .mp4, .webm, .avi, .gif; and .png, a sheet
preview  :func:`open_preview`: a stream of events and frames -> film or sheet, in bounded memory
======== =========================================================================================
"""

from __future__ import annotations

from adv2e.rendering.films import check_suffix
from adv2e.rendering.recording import open_preview, render_recording
from adv2e.rendering.styles import STYLES, Style, draw, parse_colour

__all__ = [
    "STYLES",
    "Style",
    "check_suffix",
    "draw",
    "open_preview",
    "parse_colour",
    "render_recording",
]
