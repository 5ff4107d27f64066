"""Inputs with frames: films, images, lists of times, stacks."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dev.digests import simulations
from dev.digests.simulations import Array, scene

Make = Callable[[Path], Any]
"""Writes an input to the path given."""

ROWS, COLUMNS, COUNT = 48, 64, 12
STEP_S = 0.01
"""Between two frames that have times of their own."""


def pictures(dtype: str = "u1", *, colour: bool = False, count: int = COUNT) -> Array:
    light = scene(ROWS, COLUMNS, count)
    if colour:
        light = np.stack([light, light**0.7, 1 - light], -1)
    white = 1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max
    return (white * light).astype(dtype)


def film(
    path: Path, codec: str, pixels: str = "yuv420p", *, numbers: Iterable[int] = range(COUNT),
    reordered: int = 0, full: bool = False, tags: Sequence[int] = (2, 2, 2), aspect: str = "",
    tracks: int = 1, options: Mapping[str, str] | None = None,
    container: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """Write a film, with pictures at the numbers given of ticks of 40 ms.

    `tags` are the codes of ITU-T H.273 for primaries, transfer and matrix.
    """
    import av  # noqa: PLC0415

    with av.open(str(path), "w", container_options=dict(container or {})) as file:
        streams = [file.add_stream(codec, rate=25) for _ in range(tracks)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = COLUMNS, ROWS, pixels
            stream.options = dict(options or {})
            context = stream.codec_context
            context.max_b_frames, context.time_base = reordered, Fraction(1, 25)
            context.color_primaries, context.color_trc, context.colorspace = tags
            context.color_range = 2 if full else 1
            if aspect:
                stream.sample_aspect_ratio = Fraction(aspect)
        for number, image in zip(numbers, pictures(colour=True), strict=True):
            for stream in streams:
                frame = av.VideoFrame.from_ndarray(image, "rgb24").reformat(format=pixels)
                frame.pts, frame.time_base = number, Fraction(1, 25)
                file.mux(stream.encode(frame))
        for stream in streams:
            file.mux(stream.encode(None))


def turned(path: Path) -> None:
    """Write a film whose display matrix asks for a quarter turn."""
    film(path, "mpeg4")
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 44
    struct.pack_into(">5i", data, place, 0, 1 << 16, 0, -1 << 16, 0)
    path.write_bytes(data)


def encoded(suffix: str, image: Array, orientation: int = 0) -> bytes:
    """Return the bytes of an image, which Exif says to turn."""
    data = bytes(cv2.imencode(suffix, image)[1])
    if not orientation:
        return data
    entry = struct.pack("<2sHIHHHIHHI", b"II", 42, 8, 1, 274, 3, 1, orientation, 0, 0)
    body = b"Exif\0\0" + entry
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]


def images(
    path: Path, names: Sequence[str] = (), dtype: str = "u1", *, suffix: str = ".png",
    colour: bool = False, orientation: int = 0, lists: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """Write images to a folder, or to a zip, with lists of which a line is given for each image.

    A line is a format of `s`, `ms`, `us` and `ns`, its time in these units, and of `n` and `name`.
    """
    names = names or [f"frame_{n:04d}{suffix}" for n in range(COUNT)]
    made = pictures(dtype, colour=colour, count=len(names))
    files = {
        name: encoded(Path(name).suffix.lower(), image, orientation)
        for name, image in zip(names, made, strict=True)
    }
    for name, line in (lists or {}).items():
        head, _, each = line.rpartition("\n")
        rows = (
            each.format(n=n, name=one, s=f"{n * STEP_S:.6f}", ms=10 * n, us=10_000 * n,
                        ns=1_400_000_000_000_000_000 + 10_000_000 * n)
            for n, one in enumerate(names)
        )  # fmt: skip
        files[name] = "\n".join([*filter(None, [head]), *rows, ""]).encode()
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in files.items():
                archive.writestr(name, data)
        return
    for name, data in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)


def pages(path: Path, dtype: str) -> None:
    cv2.imwritemulti(str(path), list(pictures(dtype)))


def stack(path: Path, dtype: str = "u1", *, colour: bool = False, times: bool = False) -> None:
    np.save(path, pictures(dtype, colour=colour))
    if times:
        np.save(path.with_name(f"{path.stem}_ts.npy"), STEP_S * np.arange(COUNT))


FPS = " --fps 25"


def listed(name: str, line: str, folder: str = "") -> Make:
    """Return what writes images with a list, numbered ones where they lie in a folder below."""
    names = [f"{folder}/{n}.png" for n in range(COUNT)] if folder else ()
    return partial(images, names=names, lists={name: line})


PICTURES: Mapping[str, Make] = {
    "h264.mp4": partial(film, codec="libx264"),
    "b_frames.mp4": partial(film, codec="libx264", reordered=2),
    "b_frames.mkv": partial(film, codec="libx264", reordered=3),
    "fragments.mp4": partial(
        film, codec="mpeg4", container={"movflags": "frag_keyframe+empty_moov"}
    ),
    "varying.mkv": partial(film, codec="libx264", numbers=[0, 1, 2, 5, 6, 7, 9, *range(30, 35)]),
    "varying.mp4": partial(film, codec="mpeg4", numbers=[3, 4, 6, 7, *range(14, 22)]),
    "rate.mp4 --fps 240": partial(film, codec="mpeg4"),
    "vp9.webm": partial(film, codec="libvpx-vp9", options={"deadline": "realtime"}),
    "mjpeg.avi": partial(film, codec="mjpeg", pixels="yuvj420p"),
    "mpeg2.mpg": partial(film, codec="mpeg2video"),
    "h264.ts": partial(film, codec="libx264"),
    "stream.h264": partial(film, codec="libx264"),
    "wmv.wmv": partial(film, codec="wmv2"),
    "film.y4m": lambda path: simulations.video(path.parent),
    "ffv1.mkv": partial(film, codec="ffv1", pixels="yuv444p"),
    "ffv1_10.mkv": partial(film, codec="ffv1", pixels="yuv420p10le"),
    "ffv1_grey16.mkv": partial(film, codec="ffv1", pixels="gray16le"),
    "alpha.mov": partial(film, codec="prores_ks", pixels="yuva444p10le"),
    "pq.mp4": partial(
        film, codec="libx265", pixels="yuv420p10le", tags=(9, 16, 9),
        options={"x265-params": "log-level=none"},
    ),
    "bt709.mp4": partial(film, codec="libx264", tags=(1, 1, 1)),
    "full_range.mp4": partial(film, codec="libx264", full=True, tags=(1, 13, 1)),
    "wide_pixels.mp4": partial(film, codec="mpeg4", aspect="4/3"),
    "fields.mp4": partial(film, codec="libx264", options={"x264-params": "tff=1"}),
    "turned.mp4": turned,
    "tracks.mkv": partial(film, codec="mpeg4", tracks=2),
    "tracks.mp4 --track 1": partial(film, codec="mpeg4", tracks=2),
    "moving.gif": partial(film, codec="gif", pixels="rgb8"),
    "moving.apng": partial(film, codec="apng", pixels="rgb24"),
    "moving.webp": partial(film, codec="libwebp_anim"),
    "numbers" + FPS: partial(images, names=[f"{n}.png" for n in range(5, 5 + COUNT)]),
    "gaps" + FPS: partial(images, names=[f"{n:03d}.png" for n in (1, 2, 3, 7, 8)]),
    "case" + FPS: partial(images, names=["B3.PNG", "a1.png", "A2.png", "c4.Jpg"]),
    "colour" + FPS: partial(images, suffix=".jpg", colour=True),
    "exif" + FPS: partial(images, suffix=".jpg", orientation=6),
    "deep" + FPS: partial(images, dtype="u2"),
    "floats" + FPS: partial(images, dtype="f4", suffix=".tif"),
    "radiance" + FPS: partial(images, dtype="f4", suffix=".hdr", colour=True),
    "mosaic --bayer rggb" + FPS: images,
    "upside_down --rotate180" + FPS: images,
    "zipped.zip": listed("images.txt", "{s} {name}"),
    "images_txt": listed("images.txt", "{s} {name}"),
    "timestamps_txt": listed("timestamps.txt", "{us}"),
    "info_txt": listed("info.txt", "{name} {ms}"),
    "heading": listed("timestamps.txt", "# id timestamp [ns] filename\n{n} {ns} {name}"),
    "unit --time-unit ms": listed("timestamps.txt", "{us}"),
    "given --timestamps given/list.csv": listed("list.csv", "{s};{name}"),
    "tum": listed("rgb.txt", "# color images\n{s} {name}", "rgb"),
    "euroc": listed(
        "mav0/cam0/data.csv", "#timestamp [ns],filename\n{ns},{name}", "mav0/cam0/data"
    ),
    "uzh_fpv": listed("left_images.txt", "# id timestamp image_name\n{n} {s} {name}", "img"),
    "GOPR0372_07_00": partial(images, names=[f"sharp/{n:06d}.png" for n in range(1, 1 + COUNT)]),
    "photo.png": lambda path: cv2.imwrite(str(path), pictures()[0]),
    "pages.tif" + FPS: partial(pages, dtype="u1"),
    "pages_16.tif" + FPS: partial(pages, dtype="u2"),
    "pages_float.tiff" + FPS: partial(pages, dtype="f4"),
    "grey.npy" + FPS: stack,
    "deep.npy --fps 30000/1001": partial(stack, dtype="u2"),
    "floats.npy" + FPS: partial(stack, dtype="f4", colour=True),
    "timed.npy": partial(stack, times=True),
    "frames.npz": lambda path: np.savez(path, frames=pictures()),
}  # fmt: skip
"""Writers of inputs, by the words that follow ``adv2e info``."""
