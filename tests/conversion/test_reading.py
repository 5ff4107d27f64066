import time

import numpy as np
import pytest
from threads import own_threads, wait_until

from adv2e.conversion import reading as module
from adv2e.conversion.reading import Decoding, Reading
from adv2e.effects.frames.encoding import LightDecoder
from adv2e.errors import DataError
from adv2e.sources.base import Source

FRAMES = np.random.default_rng(3).integers(0, 256, (40, 6, 8, 3), dtype=np.uint8)


@pytest.fixture
def stack(tmp_path):
    np.save(tmp_path / "stack.npy", FRAMES)
    return str(tmp_path / "stack.npy")


@pytest.fixture
def loaded(monkeypatch):
    """Names of the frames that were loaded so far."""
    labels = []
    read = Source._frame

    def counted(self, shot, t_ns):
        labels.append(shot.label)
        return read(self, shot, t_ns)

    monkeypatch.setattr(Source, "_frame", counted)
    return labels


def as_light(source, *, coded=False, with_pictures=False):
    decoder = LightDecoder("srgb", source.full_scale, source.dtype, source.colour)
    return Decoding(decoder, coded, with_pictures)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("early", [0, 300, 1 << 20])
@pytest.mark.parametrize("coded", [False, True])
def test_frames_do_not_depend_on_how_many_were_read_early(
    stack, monkeypatch, threads, early, coded
):
    monkeypatch.setattr(module, "EARLY_BYTES", early)
    with Reading(stack, fps=10, threads=threads) as reading:
        decoding = as_light(reading.source, coded=coded, with_pictures=True)
        decoded = list(reading.decoded(decoding))
    assert [t_ns for (t_ns, _), _ in decoded] == [k * 10**8 for k in range(len(FRAMES))]
    for ((_, light), picture), frame in zip(decoded, FRAMES, strict=True):
        assert np.array_equal(picture, frame)
        assert np.array_equal(light, frame if coded else decoding.decoder.decode(frame))
    assert own_threads() == []


def test_reading_begins_before_it_is_known_what_for_and_stops_at_its_limit(
    stack, loaded, monkeypatch
):
    monkeypatch.setattr(module, "EARLY_BYTES", 10 * FRAMES[0].nbytes)
    with Reading(stack, fps=10, threads=2) as reading:
        wait_until(lambda: len(loaded) >= 10)
        time.sleep(0.05)
        # a source looks at its second frame before it hands out the first
        assert len(loaded) <= 11
        assert len(list(reading.decoded(as_light(reading.source)))) == len(FRAMES)


def test_with_one_thread_nothing_is_read_before_it_is_asked_for(stack, loaded):
    with Reading(stack, fps=10, threads=1) as reading:
        assert own_threads() == []
        assert loaded == []
        next(reading.decoded(as_light(reading.source)))
        assert len(loaded) <= 3


def test_leaving_before_it_is_known_what_for_ends_the_thread(stack):
    with pytest.raises(ZeroDivisionError), Reading(stack, fps=10, threads=2):
        assert own_threads()
        raise ZeroDivisionError
    assert own_threads() == []


@pytest.mark.parametrize("threads", [1, 2])
def test_what_is_wrong_with_a_frame_is_told_when_it_is_taken(tmp_path, threads):
    frames = np.ones((5, 4, 4), np.float32)
    frames[3, 0, 0] = np.nan
    np.save(tmp_path / "stack.npy", frames)
    with Reading(str(tmp_path / "stack.npy"), fps=10, threads=threads) as reading:
        decoded = reading.decoded(as_light(reading.source))
        assert next(decoded)[0][0] == 0
        with pytest.raises(DataError, match="NaN"):
            list(decoded)


@pytest.mark.parametrize("threads", [1, 2])
def test_what_cannot_be_opened_is_told_when_it_is_asked_for(tmp_path, threads):
    missing = Reading(str(tmp_path / "none.npy"), threads=threads)
    with missing as reading, pytest.raises(DataError, match=r"none\.npy"):
        _ = reading.source
    assert own_threads() == []


def test_a_configuration_is_looked_at_before_the_input(adv2e, tmp_path):
    outcome = adv2e("convert", tmp_path / "none.mp4", "--set", "pixel.leek=1")
    assert "pixel.leek" in outcome.err
    outcome = adv2e("convert", tmp_path / "none.mp4")
    assert "none.mp4: no such file" in outcome.err
