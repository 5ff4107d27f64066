"""A video file to events by EventCV, where ffmpeg is not there: OpenCV decodes.

``python -m benchmarks.eventcv_file VIDEO OUT.h5 JSON``, JSON being arguments of its ``simulate``.
All frames are in memory at once, as EventCV takes them only so.
"""

from __future__ import annotations

import json
import sys

import cv2
import eventcv
import numpy as np


def main() -> None:
    video, target, arguments = sys.argv[1:]
    capture = cv2.VideoCapture(video)
    fps = capture.get(cv2.CAP_PROP_FPS)
    frames = []
    while True:
        good, frame = capture.read()
        if not good:
            break
        frames.append(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))
    eventcv.simulate(np.stack(frames), fps=fps, out=target, **json.loads(arguments))


if __name__ == "__main__":
    main()
