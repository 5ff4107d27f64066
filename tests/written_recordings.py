"""Recordings in the DAVIS240C layout, written without the package."""

from __future__ import annotations

import cv2


def write_recording(folder, times, frames, events):
    """Write frames at `times` [s] and events to a new folder, and return it."""
    (folder / "images").mkdir(parents=True)
    names = [f"images/frame_{number:08d}.png" for number in range(len(frames))]
    for name, frame in zip(names, frames, strict=True):
        assert cv2.imwrite(str(folder / name), frame)
    stamps = [f"{t:.9f} {name}\n" for t, name in zip(times, names, strict=True)]
    (folder / "images.txt").write_text("".join(stamps))
    lines = [f"{e['t'] / 1e6:.9f} {e['x']} {e['y']} {e['p']}\n" for e in events]
    (folder / "events.txt").write_text("".join(lines))
    return folder
