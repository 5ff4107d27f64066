"""A page with the measured and simulated events of each frame interval beside each other."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adv2e.events import Events, Window
from adv2e.rendering.styles import Style, draw
from adv2e.reports.markup import Markup, tag

MOST = 12
"""Frame intervals on a page, evenly chosen."""
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_CSS = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 1.5rem; color: #1c2430; background: #fff; }
p { max-width: 46rem; }
table { border-collapse: collapse; }
th { position: sticky; top: 0; background: #fff; text-align: left; padding: .3rem .4rem; }
td { padding: .2rem .4rem .9rem; vertical-align: top; }
img { display: block; width: 260px; image-rendering: pixelated; border: 1px solid #c4ccd6; }
figure { margin: 0; } figcaption { color: #4a5565; font-size: .85rem; }
small { font-weight: normal; color: #4a5565; display: block; max-width: 260px; }
"""


@dataclass(frozen=True)
class Column:
    """A stream of events, and scores to show under its pictures, a frame interval each."""

    name: str
    about: str
    events: Events
    scores: Sequence[float | None] = ()


def page(
    title: str,
    frames: Mapping[int, NDArray[np.uint8]],
    windows: Sequence[Window],
    size: tuple[int, int],
    columns: Sequence[Column],
    score: str,
) -> str:
    """Return the page as HTML: one file, no loads from elsewhere.

    Frames are given by their time [us]; of more than `MOST` frame intervals some are chosen.
    `score` is what the numbers under the pictures are.
    """
    chosen = np.unique(np.linspace(0, len(windows) - 1, MOST).round().astype(int)).tolist()
    about = (
        f"{len(chosen)} of {len(windows)} frame intervals. The frame is the one at the start."
        f" A pixel has the colour of its last event: ON red, OFF blue. {score}"
    )
    head = tag(
        "tr", tag("th", "frame"), *(tag("th", one.name, tag("small", one.about)) for one in columns)
    )
    rows = []
    for number in chosen:
        window = windows[number]
        label = f"{window[0] / 1e6:.3f} to {window[1] / 1e6:.3f} s"
        cells = [_figure(frames[window[0]], f"frame at {window[0] / 1e6:.3f} s", label)]
        for one in columns:
            first, last = np.searchsorted(one.events["t"], window)
            style = Style(window_us=window[1] - window[0])
            picture = draw(one.events[first:last], *size, window[1], style)
            told = f"{last - first:,} events"
            if len(one.scores) > number and one.scores[number] is not None:
                told += f", {one.scores[number]:.2f}"
            cells.append(_figure(picture, f"events of {one.name}, {label}", told))
        rows.append(tag("tr", *(tag("td", cell) for cell in cells)))
    document = tag(
        "html",
        tag(
            "head",
            tag("meta", charset="utf-8"),
            tag("meta", http_equiv="Content-Security-Policy", content=_POLICY),
            tag("title", title),
            tag("style", Markup(_CSS)),
        ),
        tag("body", tag("h1", title), tag("p", about), tag("table", head, *rows)),
        lang="en",
    )
    return f"<!DOCTYPE html>\n{document}\n"


def write(path: Path, text: str) -> None:
    """Write a page; folders on the way are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _figure(picture: NDArray[np.uint8], alternative: str, caption: str) -> Markup:
    bgr = picture[..., ::-1] if picture.ndim == 3 else picture
    done, data = cv2.imencode(".png", np.ascontiguousarray(bgr))
    if not done:
        raise RuntimeError("OpenCV could not write a PNG")
    source = "data:image/png;base64," + base64.b64encode(data.tobytes()).decode()
    image = tag("img", src=source, alt=alternative)
    return tag("figure", image, tag("figcaption", caption))
