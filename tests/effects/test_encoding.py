from __future__ import annotations

import math

import numpy as np
import pytest

from adv2e.effects.frames.encoding import (
    LightDecoder,
    check_encoding,
    decode_values,
    encoding_of_images,
    full_scale_of,
)
from adv2e.errors import ConfigError, DataError

RGB = np.array([0.2126, 0.7152, 0.0722])


def srgb(value):
    """Light of an encoded value in 0..1, as IEC 61966-2-1 writes it, for one number."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def test_linear_bytes_are_dn_exactly():
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    light = LightDecoder("linear", 255.0, np.uint8, colour=False).decode(codes)
    assert light.dtype == np.float32
    assert np.array_equal(light, codes)


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535)])
def test_srgb_table_holds_the_standard(dtype, white):
    codes = np.array([[0, 1, white // 25, white // 24, white // 2, white]], dtype=dtype)
    light = LightDecoder("srgb", white, dtype, colour=False).decode(codes)
    expected = [255 * srgb(code / white) for code in codes[0].tolist()]
    assert np.allclose(light[0], expected, rtol=1e-6, atol=0)


def test_gamma_of_sixteen_bits():
    codes = np.array([[0, 1000, 40000, 65535]], dtype=np.uint16)
    light = LightDecoder("gamma:2.2", 65535.0, np.uint16, colour=False).decode(codes)
    assert np.allclose(light[0], 255 * (codes[0] / 65535) ** 2.2, rtol=1e-6, atol=0)


def camera(light, encoding):
    """Value that stands for light in 0..1, by the other direction of the recommendations."""
    if encoding == "bt709":
        # the constants as BT.2020 prints them for twelve bits
        return 4.5 * light if light < 0.0181 else 1.0993 * light**0.45 - 0.0993
    if encoding == "hlg":  # the constants as BT.2100 prints them
        if light <= 1 / 12:
            return math.sqrt(3 * light)
        return 0.17883277 * math.log(12 * light - 0.28466892) + 0.55991073
    power = light**0.1593017578125  # pq: the constants as ST 2084 prints them
    return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375


@pytest.mark.parametrize("encoding", ["bt709", "hlg", "pq"])
def test_curves_of_video_undo_those_of_the_recommendations(encoding):
    light = np.concatenate([[0.0, 1e-5, 1e-3, 1 / 12, 1.0], np.linspace(0.002, 1, 400)])
    values = np.array([camera(each, encoding) for each in light.tolist()])
    decoded = decode_values(values, encoding, 1.0)
    assert np.allclose(decoded, 255 * light, rtol=1e-3 if encoding == "bt709" else 1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("encoding", "value", "share"),
    [
        *[("pq", 0.25, 5.1549e-4), ("pq", 0.5, 92.2457e-4), ("pq", 0.75, 983.38e-4), ("pq", 1, 1)],
        *[("hlg", 0.5, 1 / 12), ("hlg", 0.75, 0.26496), ("hlg", 1, 1)],
        *[("bt709", 0.5, 0.25960), ("bt709", 0.045, 0.01), ("bt709", 1, 1)],
    ],
)
def test_curves_of_video_at_published_points(encoding, value, share):
    codes = np.array([[float(value)]])
    light = LightDecoder(encoding, 1.0, np.float64, colour=False).decode(codes)
    assert light[0, 0] == pytest.approx(255 * share, rel=5e-4)


@pytest.mark.parametrize("encoding", ["srgb", "bt709", "hlg", "pq", "gamma:2.2"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_curves_rise_with_every_code(encoding, dtype):
    codes = np.arange(np.iinfo(dtype).max + 1, dtype=dtype).reshape(256, -1)
    light = LightDecoder(encoding, float(codes.max()), dtype, colour=False).decode(codes).ravel()
    assert light[0] == 0
    assert light[-1] == pytest.approx(255)
    assert (np.diff(light) > 0).all()


@pytest.mark.parametrize("encoding", ["bt709", "hlg", "pq"])
def test_curves_of_video_stay_finite_far_above_white(encoding):
    light = decode_values(np.array([1.0, 2.0, 1e9], np.float32), encoding, 1.0)
    assert np.isfinite(light).all()
    assert (np.diff(light) >= 0).all()


@pytest.mark.parametrize("encoding", ["linear", "srgb", "bt709", "hlg", "pq", "gamma:2.2"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_floats_keep_their_type_and_agree_with_whole_numbers(encoding, dtype):
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    whole = LightDecoder(encoding, 255.0, np.uint8, colour=False).decode(codes)
    light = LightDecoder(encoding, 1.0, dtype, colour=False).decode(
        codes.astype(dtype) / dtype(255)
    )
    assert light.dtype == dtype
    assert np.allclose(light, whole, rtol=1e-4 if encoding == "pq" else 2e-6, atol=1e-6)


def test_float64_is_computed_in_float64():
    value = np.array([[0.3, 0.01]])
    light = LightDecoder("srgb", 1.0, np.float64, colour=False).decode(value)
    assert np.allclose(light[0], [255 * srgb(0.3), 255 * srgb(0.01)], rtol=1e-14)


@pytest.mark.parametrize("encoding", ["linear", "srgb", "gamma:2.2"])
def test_values_above_white_are_kept(encoding):
    light = LightDecoder(encoding, 1.0, np.float32, colour=False).decode(np.float32([[2.0]]))
    assert light[0, 0] > 255


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_colour_is_weighed_after_decoding_in_the_order_rgb(dtype):
    white = full_scale_of(dtype)
    image = np.array([[[0.2, 0.5, 0.9], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]]) * white
    image = image.astype(dtype)
    light = LightDecoder("srgb", white, dtype, colour=True).decode(image)
    decoded = np.array([[srgb(v) for v in pixel] for pixel in (image[0] / white).tolist()])
    assert light.shape == (1, 5)
    assert light.dtype == (np.float64 if dtype == np.float64 else np.float32)
    assert np.allclose(light[0], 255 * decoded @ RGB, rtol=1e-6)


def test_full_scale_says_what_white_is():
    codes = np.array([[0, 1023, 2046]], dtype=np.uint16)
    light = LightDecoder("linear", 1023.0, np.uint16, colour=False).decode(codes)
    assert light[0].tolist() == [0, 255, 510]


def test_the_frame_is_not_written_to():
    image = np.full((2, 2), 0.5, np.float32)
    LightDecoder("linear", 1.0, np.float32, colour=False).decode(image)
    assert np.all(image == 0.5)


@pytest.mark.parametrize(
    "image", [np.zeros((2, 2), np.uint16), np.zeros((2, 2, 3), np.uint8), np.zeros(4, np.uint8)]
)
def test_a_frame_of_another_kind_is_refused(image):
    with pytest.raises(ValueError, match="for a decoder of uint8, grey"):
        LightDecoder("linear", 255.0, np.uint8, colour=False).decode(image)


def test_other_data_types_have_no_white():
    with pytest.raises(DataError, match="int32"):
        full_scale_of(np.int32)
    with pytest.raises(DataError, match="int32"):
        LightDecoder("linear", 1.0, np.int32, colour=False)


def test_auto_must_be_settled_before():
    with pytest.raises(ConfigError, match="auto"):
        LightDecoder("auto", 255.0, np.uint8, colour=False)


@pytest.mark.parametrize("encoding", ["sRGB", "gamma", "gamma:", "gamma:0", "gamma:nan", "log", ""])
def test_unknown_encodings_are_refused(encoding):
    with pytest.raises(ConfigError, match="encoding"):
        check_encoding(encoding)


@pytest.mark.parametrize(
    ("dtype", "encoding"), [(np.uint8, "srgb"), (np.uint16, "linear"), (np.float32, "linear")]
)
def test_meaning_of_auto_for_images(dtype, encoding):
    assert encoding_of_images(dtype) == encoding


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_colour_by_table_agrees_with_decoding_then_weighing(dtype):
    full_scale = full_scale_of(dtype)
    image = np.random.default_rng(4).integers(0, full_scale, (7, 5, 3), dtype, endpoint=True)
    image.flags.writeable = False
    dn = decode_values(image.astype(np.float64), "srgb", full_scale)
    expected = dn @ RGB
    decoder = LightDecoder("srgb", full_scale, dtype, colour=True)
    for part in (np.s_[:, :], np.s_[::-1, ::2]):  # strided, too
        light = decoder.decode(image[part])
        assert light.dtype == np.float32
        np.testing.assert_allclose(light, expected[part], rtol=3e-7)
