"""Of an array in the .npy format no more is believed than is there."""

import io
import struct

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.files.zips import read_array
from adv2e.sources import open_source


def stored(array, version=None):
    file = io.BytesIO()
    np.lib.format.write_array(file, array, version=version)
    return file.getvalue()


def read(data):
    return read_array(io.BytesIO(data), len(data), "a.npy")


def with_header(text, numbers=b""):
    header = text.encode("latin1").ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + numbers


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">f8", "f4", [("t", "<i8"), ("x", "u2")]])
def test_arrays_are_as_numpy_reads_them(dtype, order, version):
    array = np.arange(24).reshape(2, 3, 4).astype(dtype, order=order)
    data = stored(array, version)
    found, expected = read(data), np.load(io.BytesIO(data))
    assert found.dtype == expected.dtype
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("array", [np.float64(3), np.zeros((0, 4)), np.array("text")])
def test_arrays_of_other_shapes(array):
    assert np.array_equal(read(stored(np.asarray(array))), array)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 4), }", r"not a \.npy array"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (True, 4), }", r"not a \.npy array"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (2.0, 4), }", r"not a \.npy array"),
        ("{'descr': '<f8', 'fortran_order': 1, 'shape': (2, 4), }", r"not a \.npy array"),
        ("{'descr': '<f8', 'shape': (2, 4), }", r"not a \.npy array"),
        ("{'descr': 'V0', 'fortran_order': False, 'shape': (2, 4), }", r"not a \.npy array"),
        ("{'descr': '|O', 'fortran_order': False, 'shape': (2, 4), }", "Python objects"),
        ("{'descr': '<f9', 'fortran_order': False, 'shape': (2, 4), }", r"not a \.npy array"),
        ("{'descr': [], 'fortran_order': False, 'shape': (2, 4), }", r"not a \.npy array"),
        ("__import__('os').abort()", r"not a \.npy array"),
        ("[" * 100, r"not a \.npy array"),
        ("-" * 117, r"not a \.npy array"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (10**12,), }", r"not a \.npy array"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999,), }", "cut short"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (%s, 9), }" % ("9" * 60), "cut short"),
    ],
)  # fmt: skip
def test_headers_that_are_wrong(text, message):
    with pytest.raises(DataError, match=f"^a.npy: .*{message}"):
        read(with_header(text, b"\0" * 64))


@pytest.mark.parametrize(
    "text",
    [
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2L, 3L), }",
        "{'descr': '|u1', 'fortran_order': False, 'shape': (2L, 3L ), }",
    ],
)
def test_a_header_of_python_2_is_read_without_a_word(text):
    assert read(with_header(text, bytes(range(6)))).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_an_l_within_a_name_stays():
    array = np.zeros(2, [("a1L", "<i2"), ("L", "<i4")])
    assert read(stored(array)).dtype == array.dtype


def test_a_header_of_thousands_of_signs(tmp_path):
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", 9000) + b"-" * 9000
    with pytest.raises(DataError, match=r"not a \.npy array"):
        read(data)


@pytest.mark.parametrize("length", [0, 5, 8, 9, 60, 127, 140])
def test_files_cut_short(length):
    with pytest.raises(DataError, match=r"^a\.npy: (cut short|not a)"):
        read(stored(np.arange(8.0))[:length])


@pytest.mark.parametrize("colour", [False, True])
def test_frames_strewn_over_the_file_come_in_any_order(tmp_path, colour):
    shape = (11, 5, 7, 3) if colour else (11, 5, 7)
    stack = np.random.default_rng(0).random(shape).astype(">f4", order="F")
    np.save(tmp_path / "a.npy", np.asfortranarray(stack))
    source = open_source(tmp_path / "a.npy", fps=10)
    for _ in range(2):
        frames = list(source.frames())
        assert all(np.array_equal(f.image, image) for f, image in zip(frames, stack, strict=True))
        assert all(frame.image.dtype == np.float32 for frame in frames)
