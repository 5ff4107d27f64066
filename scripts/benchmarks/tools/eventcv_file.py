"""A video to events by EventCV: what its own command does, where there is no ffmpeg for that.

``python -m benchmarks.tools.eventcv_file VIDEO OUT.h5 ARGUMENTS``: as JSON, those of
``eventcv.simulate``.
"""

from __future__ import annotations

import json
import sys

import cv2
import eventcv
import numpy as np


def main(video: str, out: str, arguments: str) -> None:
    """Decode, simulate and write."""
    capture = cv2.VideoCapture(video)
    fps = capture.get(cv2.CAP_PROP_FPS)
    frames = []
    while True:
        is_there, frame = capture.read()
        if not is_there:
            break
        frames.append(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    eventcv.simulate(np.stack(frames), fps=fps, out=out, **json.loads(arguments))


if __name__ == "__main__":
    main(*sys.argv[1:])
