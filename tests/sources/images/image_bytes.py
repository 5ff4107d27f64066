"""Image files put together byte by byte: what no library writes on request."""

from __future__ import annotations

import struct
import zlib

import numpy as np

SHORT, LONG, TEXT = 3, 4, 2


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(rows, kind, depth=8, chunks=()):
    """Return a PNG of (rows, columns[, channels]) numbers, `kind` its colour type."""
    rows = np.asarray(rows)
    lines = rows.reshape(len(rows), -1).astype(">u2" if depth == 16 else np.uint8)
    if depth < 8:
        bits = np.unpackbits(lines[..., np.newaxis], axis=-1)[..., -depth:]
        lines = np.packbits(bits.reshape(len(rows), -1), axis=1)
    header = struct.pack(">IIBBBBB", rows.shape[1], len(rows), depth, kind, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header)
    data += b"".join(_chunk(name, content) for name, content in chunks)
    packed = zlib.compress(b"".join(b"\0" + line.tobytes() for line in lines))
    return data + _chunk(b"IDAT", packed) + _chunk(b"IEND", b"")


def directory(tags, at, order="<", following=0, big=False):
    """Return the bytes of a TIFF directory that lies at `at`: its entries, then what they hold."""
    entry, pointer = (20, "Q") if big else (12, "I")
    room = 8 if big else 4
    beyond = at + (8 if big else 2) + entry * len(tags) + room
    entries, held = b"", b""
    for tag, kind, values in sorted(tags):
        form = {SHORT: "H", LONG: "I", TEXT: "B"}[kind]
        content = struct.pack(f"{order}{len(values)}{form}", *values)
        if len(content) > room:
            place = struct.pack(order + pointer, beyond + len(held))
            held += content + b"\0" * (len(content) % 2)
        else:
            place = content.ljust(room, b"\0")
        entries += struct.pack(f"{order}HH{pointer}", tag, kind, len(values)) + place
    count = struct.pack(order + ("Q" if big else "H"), len(tags))
    return count + entries + struct.pack(order + pointer, following) + held


def tiff(rows, *, order="<", tags=(), bits=None, big=False, pages=1):
    """Return a TIFF whose pages all are `rows`, (rows, columns[, channels]) numbers."""
    rows = np.asarray(rows)
    channels = rows.shape[2] if rows.ndim == 3 else 1
    bits = bits or 8 * rows.dtype.itemsize
    if bits in (10, 12, 14):
        lines = rows.reshape(len(rows), -1).astype(">u2")[..., np.newaxis]
        each = np.unpackbits(lines.view(np.uint8), axis=-1)[..., -bits:]
        body = np.packbits(each.reshape(len(rows), -1), axis=1).tobytes()
    else:
        body = rows.astype(rows.dtype.newbyteorder(order)).tobytes()
    start = 16 if big else 8
    start += len(body) + len(body) % 2
    own = {
        256: (LONG, [rows.shape[1]]),
        257: (LONG, [rows.shape[0]]),
        258: (SHORT, [bits] * channels),
        259: (SHORT, [1]),
        262: (SHORT, [2 if channels > 2 else 1]),
        273: (LONG, [16 if big else 8]),
        277: (SHORT, [channels]),
        278: (LONG, [rows.shape[0]]),
        279: (LONG, [len(body)]),
        339: (SHORT, [3 if rows.dtype.kind == "f" else 1] * channels),
    }
    own.update({tag: (kind, values) for tag, kind, values in tags})
    listed = [(tag, kind, values) for tag, (kind, values) in own.items()]
    head = (b"II" if order == "<" else b"MM") + (
        struct.pack(order + "HHHQ", 43, 8, 0, start)
        if big
        else struct.pack(order + "HI", 42, start)
    )
    data = head + body.ljust(start - len(head), b"\0")
    for page in range(pages):
        last = page == pages - 1
        size = len(directory(listed, start, order, 0, big))
        data += directory(listed, start, order, 0 if last else start + size, big)
        start += size
    return data


def exif(orientation, order="<"):
    """Return the content of Exif: a TIFF that holds nothing but an orientation."""
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8)
    return head + directory([(274, SHORT, [orientation])], 8, order)


def with_exif(jpeg, orientation, order="<"):
    """Return a JPEG with an Exif segment."""
    content = b"Exif\0\0" + exif(orientation, order)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content + jpeg[2:]


def webp(chunks):
    """Return the container of a WebP around chunks (name, content)."""
    body = b"".join(
        name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
        for name, content in chunks
    )
    return b"RIFF" + struct.pack("<I", len(body) + 4) + b"WEBP" + body
