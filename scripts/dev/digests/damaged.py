"""Inputs that are damaged or doubtful."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from dev.digests.event_files import EVENTS, Change, events, evt21, lines, prophesee, text, written
from dev.digests.pictures import FPS, Make, film, images, pictures
from dev.digests.simulations import Array


def not_numbers(path: Path) -> None:
    frames = pictures("f4")
    frames[3, 5, 7] = np.nan
    np.save(path, frames)


def other_size(path: Path) -> None:
    images(path)
    cv2.imwrite(str(path / "frame_0005.png"), pictures()[0][:-8])


def long_list(path: Path) -> None:
    images(path, lists={"timestamps.txt": "{s}"})
    (path / "frame_0007.png").unlink()


def cut(path: Path, make: Make, share: float) -> None:
    make(path)
    data = path.read_bytes()
    path.write_bytes(data[: round(share * len(data))])


def spoiled(path: Path) -> None:
    """Write a film of which three pictures have no header."""
    film(path, "mpeg4")
    data = bytearray(path.read_bytes())
    for place in [n for n in range(len(data)) if data[n : n + 4] == b"\0\0\1\xb6"][6:9]:
        data[place : place + 30] = b"\xff" * 30
    path.write_bytes(data)


def _changed(name: str, where: slice, by: int) -> Change:
    def change(made: Array) -> Array:
        made[name][where] += by
        return made

    return change


def hot(made: Array) -> Array:
    return np.repeat(made, np.where(np.arange(EVENTS) == 40, 900, 1))


back = partial(text, change=_changed("t", slice(0, 1500), 1_000_000))
uncoded = partial(film, codec="rawvideo")  # its bytes are the same of any version

DAMAGED: Mapping[str, Make] = {
    "cut.mp4": partial(cut, make=partial(film, codec="mpeg4"), share=0.5),
    "cut.mkv": partial(cut, make=uncoded, share=0.6),
    "cut_taken.mkv --allow-damaged": partial(cut, make=uncoded, share=0.6),
    "spoiled.mkv": spoiled,
    "spoiled_taken.avi --allow-damaged": spoiled,
    "sizes" + FPS: other_size,
    "no_times": images,
    "wrong_names": partial(images, lists={"images.txt": "{s} 0.png"}),
    "long_list": long_list,
    "not_numbers.npy" + FPS: not_numbers,
    "back.txt": back,
    "back_sorted.txt --set-back sort": back,
    "back_continued.txt --set-back continue": back,
    "shuffled.txt": partial(text, change=_changed("t", slice(0, None, 7), 500)),
    "gap.npz": partial(written, change=_changed("t", slice(2000, None), 700_000)),
    "outside.npz": partial(written, change=_changed("x", slice(0, None, 20), 30)),
    "hot.npz": partial(written, change=hot),
    "words.txt": lambda path: path.write_text(lines(events()[:50]) + "0.1 three 4 1\n"),
    "cut.raw": partial(cut, make=evt21, share=0.501),
    "cut.h5": partial(cut, make=prophesee, share=0.5),
    "cut.npz": partial(cut, make=written, share=0.7),
    "empty.mp4": Path.touch,
    "none.h5": lambda path: None,
}  # fmt: skip
"""Writers of inputs, by the words that follow ``adv2e info``."""
