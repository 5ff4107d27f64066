#!/usr/bin/env python
"""Write a scene of BS-ERGB as a recording that every command reads.

BS-ERGB (Tulyakov et al., CVPR 2022) has a Prophesee Gen 4 beside a colour camera.  A scene is a
folder of ``images/00000K.png``, and of ``events/00000K.npz`` with the events from image K to the
next, in 1/32 of a pixel of the images.  It has no list of times.  Here an image stands at the first
event of its file, and the last one at the last event of all::

    python scripts/experiments/bs_ergb.py scene -o recording
    adv2e info recording

The recording is a DAVIS240C folder.  Coordinates are rounded to pixels; what then lies outside the
images is left out.

The exposure of the colour camera follows the light, of which no event tells.  So it is evened out:
where no event fires, the codes of all pixels change by one factor from an image to the next, as
those of a power of the light do.  This factor is divided out.  What is brighter than the codes for
which it was found is cut.  The power, which scales all thresholds, cannot be told from that;
--encoding states it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from writing import as_written, one_line_errors

from adv2e import read_events, write_events
from adv2e.effects.frames.encoding import check_encoding
from adv2e.errors import ConfigError, DataError, OutputError
from adv2e.events import Events

Image = NDArray[Any]
FINE = "in 1/32 of a pixel"
BANDS = ((20, 40), (40, 60), (60, 90), (90, 120), (120, 160))
"""Codes by which exposure is told: brighter ones of this camera are rounded off."""
CODES = ", ".join(f"{low}-{high}" for low, high in BANDS)
MARGIN = 1
"""Pixels this near to one that fires tell nothing [pixels]."""
FEWEST = 200


@click.command(help=as_written(__doc__))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="FOLDER", required=True,
    help="Folder to write; it must not exist.",
)  # fmt: skip
@click.option(
    "--encoding", default="gamma:2.2", show_default=True, help="How the images code light."
)
@click.option("--as-exposed", is_flag=True, help="Leave the images as they are.")
@click.argument("scene", type=click.Path(path_type=Path), metavar="SCENE")
@one_line_errors()
def main(scene: Path, output: Path, encoding: str, as_exposed: bool) -> None:
    """Write a scene as a recording."""
    if encoding == "auto":
        raise ConfigError("encoding: nothing tells it, so it cannot be auto; say which it is")
    check_encoding(encoding)
    parts, times_us, files = read_scene(scene)
    images = [read_image(file) for file in files]
    if not as_exposed:
        for k, events in enumerate(parts):
            told = factors(images[k], images[k + 1], events)
            if None in told:
                raise click.ClickException(
                    f"{files[k + 1]}: too few pixels without events near them tell its exposure;"
                    " --as-exposed leaves it"
                )
            values = ", ".join(f"{one:.3f}" for one in told)
            click.echo(f"{files[k + 1].name}: codes {CODES} change by {values}", err=True)
        images = evened(images, parts)
    write_recording(output, np.concatenate(parts), times_us, images, encoding)
    click.echo(f"{output}: {sum(map(len, parts)):,} events, {len(images)} images")


def read_scene(scene: Path) -> tuple[list[Events], list[int], list[Path]]:
    """Return the events of each file of a scene, and times [us] and files of its images.

    Raises
    ------
    DataError
        Files are missing, not in order, or hold coordinates in something else than 1/32 of a pixel.
    """
    files, images = _numbered(scene / "events", ".npz"), _numbered(scene / "images", ".png")
    first = min(files)
    wanted = range(first, first + len(files))
    for k in wanted:
        if k not in files:
            raise DataError(f"{scene}: no events/{k:06d}.npz, but some after it")
    for k in (*wanted, wanted.stop):
        if k not in images:
            raise DataError(f"{scene}: no images/{k:06d}.png, at an end of the events of a file")
    rows, columns = read_image(images[first]).shape[:2]
    parts: list[Events] = []
    for k in wanted:
        recording = read_events(files[k], size=(columns, rows))
        if not any(FINE in problem for problem in recording.problems):
            raise DataError(f"{files[k]}: its coordinates are not {FINE}: is this BS-ERGB?")
        events = recording.events
        if not len(events):
            raise DataError(f"{files[k]}: no event inside the images, which tells their time")
        if parts and events["t"][0] < parts[-1]["t"][-1]:
            raise DataError(f"{files[k]}: begins before the events of the file before end")
        parts.append(events)
    times_us = [int(one["t"][0]) for one in parts] + [int(parts[-1]["t"][-1])]
    return parts, times_us, [images[k] for k in (*wanted, wanted.stop)]


def read_image(file: Path) -> Image:
    """Return an image of 8 bits in colour, in the order of OpenCV."""
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise DataError(f"{file}: is no image in colour of 8 bits")
    return image


def factors(before: Image, after: Image, events: Events) -> list[float | None]:
    """Return by which factor codes change in each of `BANDS`, where no event fires or nearby.

    None: fewer than `FEWEST` pixels tell.
    """
    fires = np.zeros(before.shape[:2], np.uint8)
    fires[events["y"], events["x"]] = 1
    around = np.ones((2 * MARGIN + 1, 2 * MARGIN + 1), np.uint8)
    rests = cv2.dilate(fires, around) == 0
    a, b = (cv2.GaussianBlur(one.astype(np.float32), (0, 0), 2.0) for one in (before, after))
    mean = np.sqrt(a * b)
    found: list[float | None] = []
    for low, high in BANDS:
        told = rests[..., None] & (mean >= low) & (mean < high)
        enough = np.count_nonzero(told) >= FEWEST
        found.append(float(np.median(b[told] / a[told])) if enough else None)
    return found


def evened(images: list[Image], parts: list[Events]) -> list[Image]:
    """Return the images with the exposure of the first, as codes of 16 bits."""
    gains = [1.0]
    for k, events in enumerate(parts):
        told = [one for one in factors(images[k], images[k + 1], events) if one is not None]
        gains.append(gains[-1] * float(np.median(told)))
    # what is brighter in the image of the longest exposure is beyond the codes that were looked at
    most = BANDS[-1][1] / max(gains)
    even = (np.minimum(one / gain, most) for one, gain in zip(images, gains, strict=True))
    return [np.rint(257 * one).astype(np.uint16) for one in even]


def _numbered(folder: Path, suffix: str) -> dict[int, Path]:
    """Return the files of a folder by their numbers."""
    found = {}
    for path in folder.glob(f"*{suffix}"):
        if path.stem.isdecimal():
            found[int(path.stem)] = path
    if not found:
        raise DataError(f"{folder}: no numbered {suffix} in it; a scene has events/ and images/")
    return found


def write_recording(
    folder: Path, events: Events, times_us: list[int], images: list[Image], encoding: str
) -> None:
    """Write a DAVIS240C folder, which says how its images are coded."""
    rows, columns = images[0].shape[:2]
    write_events(folder, events, (columns, rows), metadata={"frames": {"encoding": encoding}})
    (folder / "images").mkdir(exist_ok=True)
    lines = []
    for k, (t_us, image) in enumerate(zip(times_us, images, strict=True)):
        name = f"images/frame_{k:08d}.png"
        if not cv2.imwrite(str(folder / name), image):
            raise OutputError(f"{folder / name}: cannot be written")
        lines.append(f"{t_us // 10**6}.{t_us % 10**6:06d} {name}\n")
    (folder / "images.txt").write_text("".join(lines), "ascii")


if __name__ == "__main__":
    main()
