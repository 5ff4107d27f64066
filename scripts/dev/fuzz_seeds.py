"""Small good files of every kind that can be read, what is done with each, and how each is damaged.

Changes are such as a fault of a disk, a careless writer or an enemy makes.
"""

from __future__ import annotations

import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import h5py
import numpy as np
from dev.digests.event_files import EVENT_FILES, HEIGHT, WIDTH, events
from dev.digests.pictures import FPS, PICTURES, Make, images, pictures, stack

from adv2e.sources.images.opencv import quiet

ODD_NUMBERS = (
    *("0", "-1", "1", "255", "256", "65535", "65536", "2147483647", "4294967295", "4294967296"),
    *("9223372036854775807", "9223372036854775808", "18446744073709551615", "-9223372036854775808"),
    *("1e9", "1e13", "1e300", "1e999", "-1e13", "nan", "inf", "-inf", "1e-320", "0.0000000001"),
    *("9" * 40, "9" * 5000, "0x10", "1_000", "٣", "", " ", "true", "null"),
)
"""Numbers, and what stands where one should, for files of text."""

ODD_INTEGERS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
                1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)  # fmt: skip

ODD_TEXT = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n\n", b"#", b"[" * 3000, b"{" * 3000, b"&a"),
    *(
        b"*a",
        b"../" * 5,
        b"/dev/zero",
        b"\\",
        b"%d",
        b"\xf0\x9f\x98\x80",
        b"- " * 2000,
        b"!!python/x",
    ),
)

_NUMBER = re.compile(rb"-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")


def mutated(data: bytes, draw: random.Random, *, text: bool) -> bytes:
    """Return `data` changed in one to four ways.

    Parameters
    ----------
    data : bytes
    draw : random.Random
    text : bool
        Numbers in it are written in digits.
    """
    ways = [*_OF_TEXT, *_OF_ALL] if text else _OF_ALL
    for _ in range(draw.choice((1, 1, 2, 4))):
        data = draw.choice(ways)(bytearray(data), draw)
    if data.startswith(b"\x89PNG") and draw.random() < 0.8:
        data = _with_checksums(data)
    return bytes(data)


def _flip_bits(data: bytearray, draw: random.Random) -> bytearray:
    for _ in range(draw.choice((1, 1, 3, 16)) if data else 0):
        data[_place(data, draw)] ^= 1 << draw.randrange(8)
    return data


def _set_bytes(data: bytearray, draw: random.Random) -> bytearray:
    for _ in range(draw.choice((1, 2, 8)) if data else 0):
        data[_place(data, draw)] = draw.choice((0, 0xFF, 0x7F, 0x80, draw.randrange(256)))
    return data


def _set_integer(data: bytearray, draw: random.Random) -> bytearray:
    size = draw.choice((2, 4, 8))
    if len(data) >= size:
        place = min(_place(data, draw), len(data) - size)
        value = draw.choice(ODD_INTEGERS) & ((1 << 8 * size) - 1)
        data[place : place + size] = value.to_bytes(size, draw.choice(("little", "big")))
    return data


def _truncate(data: bytearray, draw: random.Random) -> bytearray:
    return data[: draw.randrange(len(data) + 1)]


def _remove(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    del data[first:last]
    return data


def _repeat(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    data[first:first] = data[first:last] * draw.choice((1, 1, 50))
    return data


def _clear(data: bytearray, draw: random.Random) -> bytearray:
    first, last = _stretch(data, draw)
    data[first:last] = bytes([draw.choice((0, 0xFF))]) * (last - first)
    return data


def _insert(data: bytearray, draw: random.Random) -> bytearray:
    place = _place(data, draw) if data else 0
    data[place:place] = draw.randbytes(draw.choice((1, 4, 100)))
    return data


def _append(data: bytearray, draw: random.Random) -> bytearray:
    return data + draw.randbytes(draw.choice((1, 1000)))


def _change_number(data: bytearray, draw: random.Random) -> bytearray:
    numbers = list(_NUMBER.finditer(bytes(data)))
    if numbers:
        first, last = draw.choice(numbers).span()
        data[first:last] = draw.choice(ODD_NUMBERS).encode()
    return data


def _insert_text(data: bytearray, draw: random.Random) -> bytearray:
    place = _place(data, draw) if data else 0
    data[place:place] = draw.choice(ODD_TEXT)
    return data


def _swap_lines(data: bytearray, draw: random.Random) -> bytearray:
    lines = bytes(data).split(b"\n")
    draw.shuffle(lines)
    return bytearray(b"\n".join(lines))


_OF_ALL = (_flip_bits, _set_bytes, _set_integer, _set_integer, _truncate, _remove, _repeat, _clear,
           _insert, _append)  # fmt: skip
_OF_TEXT = (_change_number,) * 5 + (_insert_text,) * 2 + (_swap_lines,)


def _place(data: bytearray, draw: random.Random) -> int:
    """Return a place in `data`; headers are at the beginning, and indices at the end."""
    size = len(data)
    near = draw.randrange(min(size, 200))
    return draw.choice((near, near, size - 1 - near, draw.randrange(size)))


def _stretch(data: bytearray, draw: random.Random) -> tuple[int, int]:
    first = draw.randrange(len(data) + 1)
    return first, min(len(data), first + draw.choice((1, 4, 64, 1024)))


def _with_checksums(data: bytes) -> bytes:
    """Return a PNG whose chunks have the sums that belong to them, so that it is read further."""
    out, place = bytearray(data[:8]), 8
    while place + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        size = min(size, len(data) - place - 12)
        kind_and_data = data[place + 4 : place + 8 + size]
        out += struct.pack(">I", size) + kind_and_data
        out += struct.pack(">I", zlib.crc32(kind_and_data))
        place += 12 + size
    return bytes(out)


# --- good files ----------------------------------------------------------------------------------

Content = dict[str, bytes]
"""Bytes by name; a name with a slash lies in a folder."""


@dataclass(frozen=True)
class Seed:
    """A good input.

    Attributes
    ----------
    name : str
        What kind it is.
    content : dict
        Its files.
    commands : tuple of tuples of str
        Arguments of ``adv2e`` in the folder of the files, one of them is taken.
    archive : str
        Name of the archive that the files are packed into; empty: they lie there.
    """

    name: str
    content: Content
    commands: tuple[tuple[str, ...], ...]
    archive: str = ""

    def write(self, folder: Path, draw: random.Random) -> None:
        """Write the input into a folder, with one of its files changed."""
        content = dict(self.content)
        within = not self.archive or draw.random() < 0.6
        if within:
            changed = draw.choice(sorted(content))
            content[changed] = mutated(content[changed], draw, text=_is_text(changed))
        if self.archive:
            packed = _packed(content)
            content = {self.archive: packed if within else mutated(packed, draw, text=False)}
        for name, data in content.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)


def _is_text(name: str) -> bool:
    return name.endswith((".txt", ".json", ".yaml", ".csv", ".pgm", ".npy", ".y4m"))


def _packed(content: Content) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, data in content.items():
            # without the time of now, so that the same number makes the same file
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def all_seeds(scratch: Path) -> list[Seed]:
    """Return every seed; `scratch` is an empty folder."""
    made = [
        *(_written(scratch, words, make, _of_frames) for words, make in PICTURES.items()),
        *(_written(scratch, words, make, _of_frames) for words, make in MORE_FRAMES.items()),
        *(_written(scratch, words, make, _of_events) for words, make in EVENT_FILES.items()),
        *(_written(scratch, words, make, _of_events) for words, make in MORE_EVENTS.items()),
    ]
    whole = next(seed for seed in made if seed.name == "monash.h5").content["monash.h5"]
    structured = _Structured(
        "structure of HDF5", {"a.h5": whole, "b.h5": whole}, _of_events("a.h5")
    )
    return [*made, *[structured] * 4, *_texts()]


def _written(
    scratch: Path, words: str, make: Make, commands: Callable[..., tuple[tuple[str, ...], ...]]
) -> Seed:
    """Return the seed of what is written under the first of the words, and what lies beside it."""
    name, *options = words.split()
    folder = scratch / re.sub(r"\W", "_", words)
    folder.mkdir()
    with quiet:
        make(folder / name)
    stem = name.partition(".")[0]
    files = {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.glob(f"{stem}*")) + sorted(folder.glob(f"{stem}*/**/*"))
        if path.is_file()
    }
    archive = name if name.endswith((".zip", ".npz")) else ""
    if archive:
        with zipfile.ZipFile(folder / name) as packed:
            files = {one: packed.read(one) for one in packed.namelist()}
    return Seed(words, files, commands(name, *options), archive)


def _of_frames(name: str, *options: str) -> tuple[tuple[str, ...], ...]:
    return ("info", name, *options), ("convert", name, "-o", "out.txt", "-c", "ideal", *options)


def _of_events(name: str, *options: str) -> tuple[tuple[str, ...], ...]:
    info, render = ("info", name, *options), ("render", name, "-o", "out.png")
    return info, info, render, ("compare", name, name), ("convert", name, "-o", "out.txt")


def _strewn(path: Path) -> None:
    """Write frames as FORTRAN has them in memory."""
    np.save(path, np.asfortranarray(pictures(colour=True)))


def _table(path: Path) -> None:
    np.savez(path, e=events())


def _packed_columns(path: Path) -> None:
    """Write columns as others do: chunks, compressed, times as numbers with a point."""
    made = events()
    with h5py.File(path, "w") as file:
        for name, values in (("t", made["t"] * 1e-6), *((one, made[one]) for one in "xyp")):
            how = {"chunks": (256,), "compression": "gzip", "shuffle": True}
            file.create_dataset(f"events/{name}s", data=values, **how)
        file.attrs["sensor_resolution"] = (HEIGHT, WIDTH)


MORE_FRAMES: dict[str, Make] = {
    f"strewn.npy{FPS}": _strewn,
    f"big_endian.npy{FPS}": partial(stack, dtype=">f4"),
    f"double.npy{FPS}": partial(stack, dtype="f8"),
    **{
        f"images_{suffix}{FPS}": partial(images, suffix=f".{suffix}", colour=True)
        for suffix in ("bmp", "webp", "ppm")
    },
    f"images_16{FPS}": partial(images, suffix=".tif", dtype="u2"),
    f"images_pfm{FPS}": partial(images, suffix=".pfm", dtype="f4"),
}
"""Beside what digests are made of."""

MORE_EVENTS: dict[str, Make] = {"table.npz": _table, "packed.h5": _packed_columns}


def _texts() -> list[Seed]:
    config = (Path(__file__).parents[2] / "configs" / "adv2e.yaml").read_bytes()
    shared = b"a: &a {on: 0.3, off: .2}\npixel: {thresholds: *a, refractory: {period_us: 500.0}}\n"
    check = ("config", "check", "a.yaml")
    table = b"light_dn,latency_us\n" + b"".join(
        b"%d,%d\n" % (n, 5000 - 50 * n) for n in range(1, 20)
    )
    return [
        Seed("config", {"a.yaml": config}, (check,)),
        Seed("config small", {"a.yaml": shared[25:]}, (check,)),
        Seed("config aliases", {"a.yaml": shared}, (check,)),
        Seed("table", {"a.csv": table}, (("characterise", "a.csv", "-o", "report"),)),
    ]


class _Structured(Seed):
    """An HDF5 file of which one dataset is of another making."""

    def write(self, folder: Path, draw: random.Random) -> None:
        """Write the file, and one beside it that it may point to."""
        for name, data in self.content.items():
            (folder / name).write_bytes(data)
        with h5py.File(folder / "a.h5", "a") as file:
            names = [f"events/{name}s" for name in "txyp"]
            name = draw.choice([*names, *names, "images/image000000000", "images", "events"])
            whole = file[name]
            shape = whole.shape if isinstance(whole, h5py.Dataset) else (60,)
            del file[name]
            draw.choice(_ODD_OBJECTS)(file, name, shape, draw)


def _odd_array(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    dtype = draw.choice(("u1", "i8", "u8", "f2", "f4", "f8", "S3", "?", ">i4", "c8"))
    other = draw.choice((shape, (), (0,), (1,), shape[:1], (*shape, 2), (2, 2, 2, 2), (*shape, 1)))
    values = np.zeros(other, dtype)
    if values.dtype.kind in "iuf":
        values[...] = draw.choice((0, 1, 100, np.nan if values.dtype.kind == "f" else 2))
        if values.dtype.kind == "f":
            values[...] = draw.choice((np.inf, -1e300 if dtype == "f8" else -1e4, 1e4))
    with np.errstate(all="ignore"):
        file[name] = values


def _huge(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    size = draw.choice((1 << 24, 1 << 31, 1 << 40))
    how = {"chunks": (1 << 16,)} if draw.random() < 0.5 else {}
    file.create_dataset(name, (size,), draw.choice(("u1", "f8")), **how)


def _link(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    file[name] = draw.choice((
        h5py.SoftLink(f"/{name}"), h5py.SoftLink("/none"), h5py.SoftLink("/events/ts"),
        h5py.SoftLink("/"), h5py.ExternalLink("b.h5", f"/{name}"),
        h5py.ExternalLink("none.h5", "/"), h5py.ExternalLink("a.h5", f"/{name}"),
    ))  # fmt: skip


def _virtual(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    layout = h5py.VirtualLayout(shape, "f8")
    layout[:] = h5py.VirtualSource(draw.choice((".", "b.h5", "a.h5")), name, shape)
    file.create_virtual_dataset(name, layout)


def _raw(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    source = draw.choice(("b.h5", "none", "/dev/zero", "/etc/hostname"))
    file.create_dataset(name, shape, "i4", external=[(source, 0, h5py.h5f.UNLIMITED)])


def _nothing(file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random) -> None:
    made = draw.randrange(4)
    if made == 1:
        file.create_group(name)
    elif made == 2:
        file.create_dataset(name, data=h5py.Empty("f8"))
    elif made == 3:
        file[name] = np.dtype("f8")


def _odd_attributes(
    file: h5py.File, name: str, shape: tuple[int, ...], draw: random.Random
) -> None:
    file[name] = np.zeros(shape, "f8")
    value = draw.choice((
        h5py.Empty("f8"), "text", np.zeros((2, 2)), np.nan, 1e300, -1, np.uint64(2**64 - 1),
        "[" * 5000, '{"width": 1e999}', draw.choice(ODD_NUMBERS[:24]), np.array([1e18, 3, 4]),
        json.dumps({"width": 10**30, "height": -3}), json.dumps({"frames": {"encoding": []}}),
    ))  # fmt: skip
    holder, key = draw.choice((
        (file, "sensor_resolution"), (file, "adv2e"), (file[name], "timestamp"),
        (file[name], "timestamp_ns"),
    ))  # fmt: skip
    holder.attrs[key] = value


_ODD_OBJECTS = (_odd_array, _odd_array, _huge, _link, _link, _virtual, _raw, _nothing,
                _odd_attributes, _odd_attributes)  # fmt: skip
