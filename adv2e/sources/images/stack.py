"""TIFFs of several pages, each of them a frame, with times from beside the file."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from adv2e.errors import DataError
from adv2e.sources.frame import Pixels
from adv2e.sources.images.opencv import decode_image
from adv2e.sources.images.tiff_pages import Pages
from adv2e.sources.listed import ListedSource, Picture
from adv2e.sources.npy import timed_beside
from adv2e.sources.wanted import GivenTimes, Selection


def open_source(path: Path, given: GivenTimes, selection: Selection) -> ListedSource:
    """Return the pages of a TIFF.

    Raises
    ------
    DataError
        A single page; no times, or another number of times than of pages; a damaged file.
    """
    pages = Pages(path)
    if len(pages) == 1:
        raise DataError(f"{path}: a single picture; give a folder of them, or a TIFF of many pages")
    labels = [f"{path}: page {number}" for number in range(len(pages))]
    pictures = [
        Picture(label, None, partial(_load, pages, number, label))
        for number, label in enumerate(labels)
    ]
    times = timed_beside(path, given, pictures)
    return ListedSource(path, "tiff", times, selection, has_clock=given.fps is None)


def _load(pages: Pages, number: int, label: str) -> Pixels:
    return decode_image(pages.read(number), label)
