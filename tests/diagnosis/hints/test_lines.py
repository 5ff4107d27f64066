"""Lines in the rate: found where they are, also in time with the frames, and none where none is."""

import numpy as np
import pytest
from made_up.streams import random_stream, scene_of, some_scene, stream_of

from adv2e.diagnosis.hints.lamps import strongest_lines


def lit(hz, seconds, seed, depth=0.5, events=8000):
    """Return events whose ON share swings."""
    draw = np.random.default_rng(seed)
    t = draw.integers(0, int(seconds * 1e6), events)
    on = draw.random(events) < 0.5 * (1.0 + depth * np.sin(2 * np.pi * hz * t * 1e-6))
    return stream_of(t, *draw.integers(0, 12, (2, events)), on)


def seen_at(fps, seconds):
    frames = int(fps * seconds) + 1
    light = np.random.default_rng(1).uniform(20, 200, (frames, 16, 16)).astype(np.float32)
    return scene_of(light, 1.0 / fps)


@pytest.mark.parametrize(
    ("hz", "fps"), [(100.0, 23.7), (100.0, 25.0), (100.0, 50.0), (120.0, 24.0), (120.0, 30.0)]
)
@pytest.mark.quick_cases(1)
def test_lamps_are_found_whatever_the_frame_rate(hz, fps):
    pilot = [random_stream(8000, seed, stop_us=1_000_000) for seed in range(8)]
    found = strongest_lines(lit(hz, 1.0, 3), pilot, seen_at(fps, 1.0))
    assert found[0] == pytest.approx(hz, abs=0.5)


def test_a_line_of_all_events_and_of_their_signs_is_as_high_as_the_higher():
    """A lamp shows in both, or a faint line of all events would put a strong one behind others."""
    draw = np.random.default_rng(4)
    lamp, other = lit(100.0, 1.0, 3, depth=0.9), lit(141.0, 1.0, 4, depth=0.35)
    t = draw.integers(0, 1_000_000, 30_000)
    t = t[draw.random(t.size) < 0.5 + 0.07 * np.cos(2e-4 * np.pi * t)]
    beside = stream_of(t, *draw.integers(0, 12, (2, t.size)), draw.integers(0, 2, t.size))
    parts = (lamp, other, beside)
    stream = stream_of(
        np.concatenate([one.t for one in parts]), 0, 0, np.concatenate([one.on for one in parts])
    )
    pilot = [random_stream(len(stream), seed, stop_us=1_000_000) for seed in range(8)]
    found = strongest_lines(stream, pilot, seen_at(23.7, 1.0))
    assert found[0] == pytest.approx(100.0, abs=0.5)


def test_what_simulations_have_in_time_with_the_frames_is_no_lamp():
    pilot = [lit(100.0, 1.0, seed, depth=0.5) for seed in range(8)]
    found = strongest_lines(lit(100.0, 1.0, 9, depth=0.45), pilot, seen_at(25.0, 1.0))
    assert all(abs(hz - 100.0) > 2.0 for hz in found)
    found = strongest_lines(lit(100.0, 1.0, 9, depth=0.45), pilot, seen_at(23.7, 1.0))
    assert found[0] == pytest.approx(100.0, abs=0.5)  # not in time with them: the strongest line


@pytest.mark.parametrize("frames", [3, 5, 8])
def test_lines_of_short_recordings_are_frequencies(frames):
    scene = some_scene(frames=frames)
    one, other = (random_stream(1500, k, stop_us=10_000 * (frames - 1)) for k in (1, 2))
    found = strongest_lines(one, [other], scene)
    assert found
    assert all(hz > 0.0 for hz in found)


@pytest.mark.parametrize("fps", [1.0, 2.0, 3.0])
@pytest.mark.thorough
def test_recordings_with_few_frames_a_second_have_no_wrong_lines(fps):
    pilot = [random_stream(8000, seed, stop_us=4_000_000) for seed in range(8)]
    scene = seen_at(fps, 4.0)
    assert all(hz > 30.0 for hz in strongest_lines(pilot[0], pilot[1:], scene))
    assert strongest_lines(lit(100.0, 4.0, 3), pilot, scene)[0] == pytest.approx(100.0, abs=0.5)


def test_recordings_too_short_for_lines_have_none():
    scene = seen_at(5000.0, 0.0006)
    streams = [random_stream(500, seed, stop_us=600) for seed in range(2)]
    assert strongest_lines(streams[0], streams[1:], scene) == ()
