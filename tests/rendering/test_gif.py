from __future__ import annotations

import struct

import numpy as np
import pytest

from adv2e.errors import UsageError
from adv2e.rendering.gif import GifWriter, compress, palette
from adv2e.rendering.styles import Style


def decompress(data):
    """Undo LZW with 8 bits a pixel, slowly, by the book."""
    bits = int.from_bytes(data, "little")
    place, width = 0, 9
    table: list[bytes] = []
    out = b""
    before = b""
    while True:
        code = bits >> place & ((1 << width) - 1)
        place += width
        if code == 256:
            table = [bytes([k]) for k in range(256)] + [b"", b""]
            width, before = 9, b""
            continue
        if code == 257:
            assert place <= 8 * len(data) < place + 8
            return out
        entry = table[code] if code < len(table) else before + before[:1]
        assert code <= len(table)
        if before and len(table) < 4096:
            table.append(before + entry[:1])
        if len(table) == 1 << width and width < 12:
            width += 1
        out += entry
        before = entry


def read(data):
    """Return size, palette and, of each picture, the delay [1/100 s] and its pixels."""
    assert data[:6] == b"GIF89a"
    width, height, flags = struct.unpack("<HHB", data[6:11])
    assert flags == 0xF7
    colours = np.frombuffer(data[13:781], np.uint8).reshape(256, 3)
    place, pictures, delay = 781, [], None
    while data[place] != 0x3B:
        kind = data[place : place + 2]
        if kind == b"\x21\xf9":
            delay = struct.unpack("<H", data[place + 4 : place + 6])[0]
            place += 2
        elif kind == b"\x21\xff":
            assert data[place + 3 : place + 14] == b"NETSCAPE2.0"
            place += 2
        else:
            assert data[place] == 0x2C
            assert data[place + 10] == 8
            place += 11
        blocks = b""
        while size := data[place]:
            blocks += data[place + 1 : place + 1 + size]
            place += 1 + size
        place += 1
        if kind[0] == 0x2C:
            index = np.frombuffer(decompress(blocks), np.uint8).reshape(height, width)
            pictures.append((delay, colours[index]))
    assert place == len(data) - 1
    return (width, height), pictures


@pytest.mark.parametrize("count", [1, 2, 3, 511, 513, 5000])
def test_lzw_of_noise(count):
    pixels = np.random.default_rng(count).integers(0, 256, count).astype(np.uint8)
    assert decompress(compress(pixels)) == pixels.tobytes()


@pytest.mark.parametrize("tables", [0, 5])
@pytest.mark.parametrize("count", [254, 255, 256, 766, 767, 768, 1791, 3838, 3839])
def test_lzw_that_ends_where_the_codes_become_longer(tables, count):
    # no pair of pixels comes twice in a table, so that each pixel is a code; a table has 3839, and
    # after five of them a code of the wrong length would not be hidden by the bits that fill a byte
    steps = np.repeat(np.arange(1, 256, 2), 256)
    pixels = np.cumsum(steps)[: tables * 3839 + count].astype(np.uint8)
    assert decompress(compress(pixels)) == pixels.tobytes()


def test_lzw_of_flat_pictures_over_many_tables():
    pixels = np.zeros(300_000, np.uint8)
    pixels[::1000] = 7
    data = compress(pixels)
    assert len(data) < 3000
    assert decompress(data) == pixels.tobytes()
    noise = np.random.default_rng(1).integers(0, 4, 60_000).astype(np.uint8)
    assert decompress(compress(noise)) == noise.tobytes()


def test_film_holds_size_times_and_colours(tmp_path):
    path = tmp_path / "film.gif"
    style = Style()
    film = GifWriter(path, 30, palette(style))
    rng = np.random.default_rng(0)
    choice = np.array([style.on, style.off, style.background, (0, 0, 0), (128, 128, 128)], np.uint8)
    pictures = [choice[rng.integers(0, 5, (13, 31))] for _ in range(6)]
    for picture in pictures:
        film.add(picture)
    film.finish()
    size, found = read(path.read_bytes())
    assert size == (31, 13)
    # thirtieths of a second in whole hundredths, without drifting away
    assert [delay for delay, _ in found] == [3, 4, 3, 3, 4, 3]
    for (_, shown), picture in zip(found, pictures, strict=True):
        assert np.abs(shown.astype(int) - picture).max() <= 4


def test_palette_has_the_colours_of_the_style():
    for name in ("white", "black", "grey", "surface"):
        style = Style(name=name, on=(1, 200, 3), off=(250, 120, 0))
        colours = palette(style)
        assert colours.shape == (256, 3)
        for colour in (*style.colours, style.background, (0, 0, 0), (255, 255, 255)):
            assert np.any(np.all(colours == colour, axis=1))


def test_too_fast_for_a_gif(tmp_path):
    with pytest.raises(UsageError, match="at most 50 pictures a second, not 60"):
        GifWriter(tmp_path / "film.gif", 60, palette(Style()))
