"""Small recordings as DDD17 and DDD20 hold them, made packet by packet, and a twin that reads them.

The twin walks over each item with ``struct``; nothing in it is shared with what it tests.
"""

import struct

import h5py
import numpy as np

BYTES = h5py.vlen_dtype(np.uint8)
T0_US = 1_487_339_175_000_000
SPECIAL, POLARITY, FRAME, IMU = range(4)


def packet(kind, items, wraps=0, room=0, number=None, size=None):
    """Return head and body; `room` items more than there are have space in the body."""
    size = size or len(items[0])
    capacity = len(items) + room
    number = len(items) if number is None else number
    head = struct.pack("<hhiiiiii", kind, 1, size, 4, wraps, capacity, number, number)
    return head, b"".join(items) + b"\xab" * (size * room)


def polarity(events, wraps=0, room=0, valid=1):
    """Return a packet of events, of (t, x, y, p) each."""
    words = [(x << 17 | y << 2 | p << 1 | valid, t) for t, x, y, p in events]
    return packet(POLARITY, [struct.pack("<Ii", *word) for word in words], wraps, room)


def special(kind, t=2**31 - 1):
    return packet(SPECIAL, [struct.pack("<Ii", kind << 1 | 1, t)])


def frame(t_us, image, exposure_us=4000, wraps=0, info=0b11, room=0):
    """Return a packet with a frame whose exposure is around a time."""
    rows, columns = image.shape
    begin, end = t_us - exposure_us // 2, t_us + exposure_us // 2
    head = struct.pack("<I8i", info, begin - 50, end + 9000, begin, end, columns, rows, 0, 0)
    return packet(FRAME, [head + image.astype("<u2").tobytes()], wraps, room)


def imu():
    return packet(IMU, [struct.pack("<Ii7f", 1, 5, *[0.5] * 7)])


def write_ddd(path, packets, rows=None, chunk=128, compression=None):
    """Write rows of packets; those behind the last are unused."""
    rows = rows or 2048 * -(-max(len(packets), 1) // 2048)
    with h5py.File(path, "w") as file:
        data = file.create_dataset(
            *("dvs/data", (rows, 3), BYTES),
            maxshape=(None, 3), chunks=(chunk, 3), compression=compression,
        )  # fmt: skip
        times = np.zeros(rows, np.int64)
        for row, parts in enumerate(packets):
            times[row] = T0_US + 1000 * row
            for column, part in enumerate((str(times[row]).encode(), *parts)):
                data[row, column] = np.frombuffer(part, np.uint8)
        file["dvs/timestamp"] = times
        file["vehicle_speed/data"] = np.zeros((2048, 2))
        file["vehicle_speed/timestamp"] = np.zeros(2048, np.int64)
    return path


def twin(path):
    """Return events (t, x, y, p) and frames (t, image), without any care for clocks set back."""
    events, frames = [], []
    with h5py.File(path) as file:
        for stamp, head, body in file["dvs/data"]:
            if not stamp.size:
                continue
            fields = struct.unpack("<hhiiiiii", head.tobytes())
            kind, _, size, _, wraps, _, number, _ = fields
            for n in range(number):
                item = body.tobytes()[n * size : (n + 1) * size]
                if kind == POLARITY:
                    word, t = struct.unpack("<Ii", item)
                    place = word >> 17, word >> 2 & 0x7FFF, word >> 1 & 1
                    events.append((t + wraps * 2**31, *place))
                elif kind == FRAME:
                    words = struct.unpack("<I8i", item[:36])
                    columns, rows = words[5:7]
                    pixels = struct.unpack(f"<{rows * columns}H", item[36:])
                    t = words[3] + (words[4] - words[3]) // 2 + wraps * 2**31
                    frames.append((t, np.reshape(pixels, (rows, columns))))
    return events, frames
