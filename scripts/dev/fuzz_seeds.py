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
from pathlib import Path

import cv2
import h5py
import numpy as np

from adv2e.events import make_events
from adv2e.formats.lookup import layouts
from adv2e.formats.writing import open_sink
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

COUNT, ROWS, COLUMNS = 4, 12, 16
"""Frames of a seed, and their size."""


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
        Arguments of ``adv2e``, one of them is taken; ``{}`` is the folder of the files.
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
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return file.getvalue()


def all_seeds(scratch: Path) -> list[Seed]:
    """Return every seed; `scratch` is a folder for files that only libraries can write."""
    seeds = [*_stacks(), *_events(), *_recordings(), *_images(), *_texts()]
    with quiet:
        return [
            *seeds,
            *_packets(scratch),
            *_hdf5(scratch),
            *_camera_files(scratch),
            *_videos(scratch),
        ]


def _frames(dtype: str = "u1", *, colour: bool = False) -> np.ndarray:
    shape = (COUNT, ROWS, COLUMNS, 3) if colour else (COUNT, ROWS, COLUMNS)
    made = np.random.default_rng(0).random(shape)
    return (made if dtype.startswith("f") else made * 250).astype(dtype)


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _info(name: str, *more: str) -> tuple[str, ...]:
    return ("info", f"{{}}/{name}", *more)


def _convert(name: str, *more: str) -> tuple[str, ...]:
    return ("convert", f"{{}}/{name}", "-o", "{}/out.txt", "-c", "ideal", *more)


def _render(name: str) -> tuple[str, ...]:
    return ("render", f"{{}}/{name}", "-o", "{}/out.png")


def _compare(name: str) -> tuple[str, ...]:
    return ("compare", f"{{}}/{name}", f"{{}}/{name}")


def _stacks() -> list[Seed]:
    both = (_info("a.npy", "--fps", "10"), _convert("a.npy", "--fps", "10"))
    seeds = [
        Seed(f"npy {dtype}", {"a.npy": _npy(_frames(dtype))}, both)
        for dtype in ("u1", "<u2", ">f4", "f8")
    ]
    strewn = np.asfortranarray(_frames(colour=True))
    times = _npy(np.arange(COUNT) * 0.01)
    lines = "".join(f"{n * 0.01:.6f}\n" for n in range(COUNT)).encode()
    return [
        *seeds,
        Seed("npy fortran", {"a.npy": _npy(strewn)}, both),
        Seed("npy times", {"a.npy": _npy(_frames()), "a_ts.npy": times}, (_info("a.npy"),)),
        Seed(
            "npy list",
            {"a.npy": _npy(_frames()), "list.txt": lines},
            (_info("a.npy", "--timestamps", "{}/list.txt"),),
        ),
    ]


def _columns() -> dict[str, np.ndarray]:
    draw = np.random.default_rng(1)
    count = 60
    return {
        "t": np.sort(draw.random(count)), "x": draw.integers(0, COLUMNS, count),
        "y": draw.integers(0, ROWS, count), "p": draw.integers(0, 2, count),
    }  # fmt: skip


def _event_lines(header: str = "") -> bytes:
    rows = zip(*_columns().values(), strict=True)
    return (header + "".join(f"{t:.9f} {x} {y} {p}\n" for t, x, y, p in rows)).encode()


def _of_events(name: str) -> tuple[tuple[str, ...], ...]:
    return (_info(name), _info(name), _render(name), _compare(name))


def _events() -> list[Seed]:
    columns = _columns()
    whole = columns | {"t_us": (columns["t"] * 1e6).astype(np.int64), "width": np.int64(20)}
    del whole["t"]
    text = {"a.txt": _event_lines()}
    described = {"a.txt.json": json.dumps({"adv2e": "0", "width": 20, "height": 20}).encode()}
    table = np.zeros(60, [("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
    table["x"], table["y"] = columns["x"], columns["y"]
    npz = {f"{name}.npy": _npy(np.asarray(values)) for name, values in columns.items()}
    return [
        Seed("text", text, _of_events("a.txt")),
        Seed("text described", text | described, _of_events("a.txt")),
        Seed("text sized", {"a.txt": _event_lines("20 20\n")}, _of_events("a.txt")),
        Seed("text zip", text, _of_events("a.zip"), archive="a.zip"),
        Seed("npz", npz, _of_events("a.npz"), archive="a.npz"),
        Seed(
            "npz us",
            {f"{name}.npy": _npy(np.asarray(values)) for name, values in whole.items()},
            _of_events("a.npz"),
            archive="a.npz",
        ),
        Seed(
            "csv", {"a.csv": _event_lines("t_s x y p\n").replace(b" ", b",")}, _of_events("a.csv")
        ),
        Seed("npz table", {"e.npy": _npy(table)}, _of_events("a.npz"), archive="a.npz"),
    ]


def _image(suffix: str, frame: np.ndarray, *how: int) -> bytes:
    done, data = cv2.imencode(suffix, frame, how)
    assert done, suffix
    return data.tobytes()


def _recordings() -> list[Seed]:
    frames = _frames()
    content = {
        "events.txt": _event_lines(),
        "images.txt": "".join(f"{n * 0.2} images/{n}.png\n" for n in range(COUNT)).encode(),
        "adv2e.json": json.dumps(
            {"adv2e": "0.1.0", "seed": 1, "width": COLUMNS, "height": ROWS,
             "source": {"name": "a", "encoding": "srgb"},
             "frames": {"encoding": "gamma:2.2", "full_scale": 255.0}}
        ).encode(),
        **{f"images/{n}.png": _image(".png", frame) for n, frame in enumerate(frames)},
    }  # fmt: skip
    folder = {f"r/{name}": data for name, data in content.items()}
    return [
        Seed("recording zip", content, (*_of_events("a.zip"), _convert("a.zip")), archive="a.zip"),
        Seed("recording folder", folder, (*_of_events("r"), _convert("r"))),
    ]


def _images() -> list[Seed]:
    grey, colour, deep = _frames(), _frames(colour=True), _frames("u2")
    kinds: dict[str, Callable[[int], bytes]] = {
        "png": lambda n: _image(".png", colour[n]),
        "png 16": lambda n: _image(".png", deep[n]),
        "jpg": lambda n: _image(".jpg", colour[n]),
        "tif": lambda n: _image(".tif", deep[n]),
        "tif float": lambda n: _image(".tif", _frames("f4")[n]),
        "bmp": lambda n: _image(".bmp", colour[n]),
        "webp": lambda n: _image(".webp", colour[n]),
        "pfm": lambda n: _image(".pfm", _frames("f4")[n]),
        "hdr": lambda n: _image(".hdr", _frames("f4", colour=True)[n]),
        "ppm": lambda n: _image(".ppm", colour[n]),
        "pgm": lambda n: (
            f"P2\n{COLUMNS} {ROWS}\n255\n".encode() + " ".join(map(str, grey[n].ravel())).encode()
        ),
    }
    both = (_info("f", "--fps", "10"), _convert("f", "--fps", "10"))
    seeds = []
    for kind, encode in kinds.items():
        suffix = kind.split()[0]
        files = {f"f/{n:03d}.{suffix}": encode(n) for n in range(COUNT)}
        seeds.append(Seed(f"images {kind}", files, both))
    files = {f"f/{n:03d}.png": _image(".png", frame) for n, frame in enumerate(grey)}
    named = "".join(f"{n * 0.01} {n:03d}.png\n" for n in range(COUNT)).encode()
    plain = "".join(f"{n * 0.01}\n" for n in range(COUNT)).encode()
    in_us = "".join(f"f/{n:03d}.png {n * 10_000}\n" for n in range(COUNT)).encode()
    for name, lines in (("images", named), ("timestamps", plain), ("info", in_us)):
        seeds.append(Seed(f"list {name}", files | {f"f/{name}.txt": lines}, (_info("f"),)))
    return seeds


def _texts() -> list[Seed]:
    config = (Path(__file__).parents[2] / "configs" / "adv2e.yaml").read_bytes()
    shared = b"a: &a {on: 0.3, off: .2}\npixel: {thresholds: *a, refractory: {period_us: 500.0}}\n"
    check = ("config", "check", "{}/a.yaml")
    table = b"light,latency_us\n" + b"".join(b"%d,%d\n" % (n, 5000 - 50 * n) for n in range(1, 20))
    return [
        Seed("config", {"a.yaml": config}, (check,)),
        Seed("config small", {"a.yaml": shared[25:]}, (check,)),
        Seed("config aliases", {"a.yaml": shared}, (check,)),
        Seed("table", {"a.csv": table}, (("characterise", "{}/a.csv", "-o", "{}/report"),)),
    ]


def _packets(scratch: Path) -> list[Seed]:
    """Files of packets, as this program writes them."""
    columns = _columns()
    events = make_events((columns["t"] * 1e6).astype(int), *(columns[name] for name in "xyp"))
    seeds = []
    for name in ("a.aedat4", "a.bag"):
        path, size = scratch / name, {"width": COLUMNS, "height": ROWS}
        with open_sink(path, **size, metadata={}, with_frames=True, overwrite=True) as sink:
            for n, frame in enumerate(_frames()):
                sink.write_frame(n * 200_000_000, frame)
            sink.write_events(events)
        commands = (*_of_events(name), _convert(name))
        seeds.append(Seed(path.suffix[1:], {name: path.read_bytes()}, commands))
    return seeds


def _hdf5(scratch: Path) -> list[Seed]:
    commands = (*_of_events("a.h5"), _convert("a.h5"))
    seeds = []
    for packed in (False, True):
        path = scratch / "a.h5"
        _write_hdf5(path, packed=packed)
        name = "hdf5 packed" if packed else "hdf5"
        seeds += [Seed(name, {"a.h5": path.read_bytes()}, commands[:4])] * 2
    for layout in layouts()[1:]:
        path = scratch / f"{layout}.h5"
        _write_layout(path, layout)
        seeds.append(Seed(f"hdf5 {layout}", {"a.h5": path.read_bytes()}, commands[:4]))
    _write_ddd(scratch / "ddd.h5")
    seeds.append(Seed("hdf5 ddd", {"a.h5": (scratch / "ddd.h5").read_bytes()}, commands[:4]))
    return [*seeds, _Structured("hdf5 structure", {}, commands[:4])]


def _write_ddd(path: Path) -> None:
    times, x, y, p = (np.rint(c * 1e6).astype("<u4") if c.dtype.kind == "f" else c.astype("<u4")
                      for c in _columns().values())  # fmt: skip
    words = np.stack([x << 17 | y << 2 | p << 1 | 1, times], axis=1).astype("<u4")
    packets = [(1, 8, words.tobytes())]
    for n, frame in enumerate(_frames()):
        head = np.array([3, 0, 0, n * 200_000, n * 200_000 + 9, COLUMNS, ROWS, 0, 0], "<i4")
        packets.append((2, 36 + 2 * frame.size, head.tobytes() + frame.astype("<u2").tobytes()))
    with h5py.File(path, "w") as file:
        data = file.create_dataset("dvs/data", (16, 3), h5py.vlen_dtype(np.uint8), chunks=(8, 3))
        for row, (kind, size, body) in enumerate(packets):
            number = len(body) // size
            parts = b"15", struct.pack("<hhiiiiii", kind, 1, size, 4, 0, *[number] * 3), body
            for column, part in enumerate(parts):
                data[row, column] = np.frombuffer(part, np.uint8)
        file["dvs/timestamp"] = np.arange(16)


def _write_layout(path: Path, layout: str) -> None:
    with open_sink(
        path, width=COLUMNS, height=ROWS, metadata={}, layout=layout, with_frames=True,
        overwrite=True,
    ) as sink:  # fmt: skip
        for n, frame in enumerate(_frames()):
            sink.write_frame(200_000_000 * n, frame)
        columns = _columns()
        sink.write_events(make_events(np.rint(columns.pop("t") * 1e6), **columns))


def _write_hdf5(path: Path, *, packed: bool) -> None:
    with h5py.File(path, "w") as file:
        how = {"chunks": (16,), "compression": "gzip", "shuffle": True} if packed else {}
        for name, values in _columns().items():
            file.create_dataset(f"events/{name}s", data=values, **how)
        file.attrs["sensor_resolution"] = (ROWS, COLUMNS)
        file.attrs["adv2e"] = json.dumps({"adv2e": "0", "width": COLUMNS, "height": ROWS})
        for n, frame in enumerate(_frames()):
            file[f"images/image{n:09d}"] = frame
            file[f"images/image{n:09d}"].attrs["timestamp"] = 0.2 * n


def _camera_files(scratch: Path) -> list[Seed]:
    t, x, y, p = _columns().values()
    events = make_events((t * 1e6).astype(np.int64), x, y, p)
    seeds = []
    for name, suffix in (
        ("evt3", ".raw"),
        ("evt2", ".raw"),
        ("dat", ".dat"),
        ("es", ".es"),
        ("aedat2", ".aedat"),
    ):
        path = scratch / f"a{suffix}"
        with open_sink(
            path, width=COLUMNS, height=ROWS, metadata={}, format=name, overwrite=True
        ) as sink:
            sink.write_events(events)
        seeds.append(Seed(name, {path.name: path.read_bytes()}, _of_events(path.name)))
    return seeds


class _Structured(Seed):
    """An HDF5 file of which one dataset is of another making."""

    def write(self, folder: Path, draw: random.Random) -> None:
        """Write the file, and one beside it that it may point to."""
        _write_hdf5(folder / "b.h5", packed=False)
        _write_hdf5(folder / "a.h5", packed=draw.random() < 0.5)
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


def _videos(scratch: Path) -> list[Seed]:
    seeds = []
    for suffix, code in (("mp4", "mp4v"), ("avi", "MJPG"), ("mkv", "mp4v"), ("mov", "mp4v")):
        path = scratch / f"a.{suffix}"
        writer = cv2.VideoWriter(
            str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25.0, (64, 48)
        )
        if not writer.isOpened():
            continue
        for frame in np.random.default_rng(3).integers(0, 255, (COUNT, 48, 64, 3), np.uint8):
            writer.write(frame)
        writer.release()
        name = f"a.{suffix}"
        seeds.append(
            Seed(f"video {suffix}", {name: path.read_bytes()}, (_info(name), _convert(name)))
        )
    planes = b"".join(
        b"FRAME\n" + frame.tobytes() + bytes(ROWS * COLUMNS // 2) for frame in _frames()
    )
    y4m = f"YUV4MPEG2 W{COLUMNS} H{ROWS} F25:1 Ip C420jpeg\n".encode() + planes
    return [*seeds, Seed("video y4m", {"a.y4m": y4m}, (_info("a.y4m"), _convert("a.y4m")))]
