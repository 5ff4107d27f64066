"""Inputs with events, as adv2e writes them and as cameras and others do."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from dev.digests import simulations
from dev.digests.pictures import COLUMNS, COUNT, ROWS, Make, images, pictures
from dev.digests.running import done
from dev.digests.simulations import Array

WIDTH, HEIGHT, EVENTS = 48, 36, 3000
LINE = "{t:.6f} {x} {y} {p}\n"

Change = Callable[[Array], Array]
"""Takes events to those that are written."""


def events() -> Array:
    """Return events that no simulation makes."""
    from adv2e import EVENT_DTYPE  # noqa: PLC0415

    k = np.arange(EVENTS, dtype=np.int64)
    made = np.zeros(EVENTS, EVENT_DTYPE)
    made["t"] = 1000 + 37 * k + k * k % 31
    made["x"], made["y"], made["p"] = 31 * k % WIDTH, k * k // 5 % HEIGHT, k * k // 7 % 3 == 0
    return made


def recording(path: Path, *, turn: bool = False) -> None:
    """Write a DAVIS240C folder with frames every 10 ms; `turn` puts the last of all first."""
    images(path, [f"images/{n:04d}.png" for n in range(COUNT)], lists={"images.txt": "{s} {name}"})
    frames, made = pictures()[:, :HEIGHT, :WIDTH], events()
    if turn:
        frames = frames[::-1]
        for name in "xyp":
            made[name] = made[name][::-1]
    for n, frame in enumerate(frames):
        cv2.imwrite(str(path / f"images/{n:04d}.png"), frame)
    (path / "events.txt").write_text(lines(made))


def lines(made: Array, form: str = LINE) -> str:
    rows = made.tolist()
    return "".join(form.format(t=t / 1e6, us=t, x=x, y=y, p=p) for t, x, y, p in rows)


def text(path: Path, form: str = LINE, head: str = "", change: Change = np.copy) -> None:
    path.write_text(head + lines(change(events()), form))


def converted(path: Path, *options: str) -> None:
    """Write the events of a recording, and its frames, as ``adv2e convert`` does."""
    recording(path.parent / "recorded")
    done(path.parent, "convert", "recorded", "-o", path.name, "--from", "events", "-q", *options)


def simulated(path: Path) -> None:
    """Write a simulation, which tells its configuration and the causes of its events."""
    np.save(path.parent / "clip.npy", simulations.grey())
    words = ("--fps", "120", "--seed", "7", "--causes", "-q", "--set", simulations.LINEAR)
    done(path.parent, "convert", "clip.npy", "-o", path.name, *words)


def written(path: Path, change: Change = np.copy) -> None:
    """Write events as columns of NumPy."""
    made = change(events())
    np.savez(path, t_us=made["t"], **{name: made[name] for name in "xyp"}, width=48, height=36)


def nmnist(path: Path) -> None:
    rows = ((t, x % 34, y % 34, p) for t, x, y, p in events().tolist())
    path.write_bytes(
        b"".join(bytes([x, y]) + (p << 23 | t).to_bytes(3, "big") for t, x, y, p in rows)
    )


def evt21(path: Path) -> None:
    words = []
    for t, x, y, p in events().tolist():
        words += [8 << 60 | t >> 6 << 32]
        words += [p << 60 | (t & 63) << 54 | (x & ~31) << 43 | y << 32 | 1 << (x & 31)]
    head = b"% evt 2.1\n% format EVT21;height=36;width=48;endianness=little\n% end\n"
    path.write_bytes(head + np.array(words, "<u8").tobytes())


def prophesee(path: Path) -> None:
    import h5py  # noqa: PLC0415

    with h5py.File(path, "w") as file:
        kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
        made = np.zeros(EVENTS, kinds)
        for name in "txyp":
            made[name] = events()[name]
        file["CD/events"] = made
        file.attrs["geometry"] = f"{WIDTH}x{HEIGHT}"


def ddd(path: Path) -> None:
    """Write packets of a DAVIS, as DDD17 and DDD20 hold them."""
    import h5py  # noqa: PLC0415

    t, x, y, p = (events()[name].astype("<u4") for name in "txyp")
    body = np.stack([x << 17 | y << 2 | p << 1 | 1, t], axis=1).astype("<u4")
    packets = [(1, 8, EVENTS, body.tobytes())]
    for n, image in enumerate(pictures("u2")):
        head = struct.pack("<9i", 3, 0, 0, 10_000 * n, 10_000 * n + 90, COLUMNS, ROWS, 0, 0)
        packets.append((2, 36 + 2 * image.size, 1, head + image.astype("<u2").tobytes()))
    with h5py.File(path, "w") as file:
        data = file.create_dataset("dvs/data", (16, 3), h5py.vlen_dtype(np.uint8))
        for row, (kind, size, count, content) in enumerate(packets):
            head = struct.pack("<hhiiiiii", kind, 1, size, 4, 0, count, count, count)
            for column, part in enumerate((b"15", head, content)):
                data[row, column] = np.frombuffer(part, np.uint8)
        file["dvs/timestamp"] = np.arange(16)


WRITTEN = """
monash.h5 | frames.h5 --with-frames | dsec.h5 --layout dsec | v2e.h5 --layout v2e --with-frames
mvsec.h5 --layout mvsec --with-frames | m3ed.h5 --layout m3ed | a.txt | a.csv | a.npz | a.zip
folder --with-frames | a.aedat4 --with-frames | a.bag --with-frames | ros2 --format ros2
evt3.raw | evt2.raw --format evt2 | a.dat | a.aedat | a.es | e2vid.txt --format e2vid
e2vid.zip --format e2vid
"""
"""Outputs of ``adv2e convert``, and how they are asked for."""


def of_conversions() -> dict[str, Make]:
    outputs = (one.split() for line in WRITTEN.strip().splitlines() for one in line.split(" | "))
    return {name: lambda path, given=given: converted(path, *given) for name, *given in outputs}


EVENT_FILES: Mapping[str, Make] = {
    **of_conversions(),
    "simulated.h5": simulated,
    "simulated.npz": simulated,
    "recorded": recording,
    "turned.h5 --rotate180": converted,
    "array.npy": lambda path: np.save(path, events()),
    "n_mnist.bin": nmnist,
    "evt21.raw": evt21,
    "prophesee.h5": prophesee,
    "ddd17.h5": ddd,
    "metavision.csv": partial(text, form="{x},{y},{p},{us}\n"),
    "heading.csv": partial(text, form="{us}\t{p}\t{x}\t{y}\n", head="t_us\tp\tx\ty\n"),
    "sized.txt": partial(text, head="64 40\n"),
    "unit.txt --time-unit us": partial(text, form="{us} {x} {y} {p}\n"),
}
"""The same of files of events."""
