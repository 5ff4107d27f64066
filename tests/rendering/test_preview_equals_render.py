"""A stream gives the pictures of the whole, whatever the order and size of its pieces."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.config import load_config
from adv2e.conversion.pipeline import convert_reading
from adv2e.conversion.reading import Reading
from adv2e.errors import OutputError
from adv2e.events import empty_events, make_events
from adv2e.formats.reading import Recording, read_events
from adv2e.rendering.recording import open_preview, render_recording
from adv2e.rendering.styles import Style
from adv2e.rendering.timeline import Timeline
from adv2e.synthetic import Scene
from adv2e.synthetic.scene import write_video

WIDTH, HEIGHT = 16, 12


def at(times):
    times = np.sort(np.array(times, np.int64))
    places = np.arange(times.size)
    return make_events(times, places % WIDTH, places // 3 % HEIGHT, places % 2)


def film(events, frames):
    """Return a recording of `events` and of frames at the times [ns]."""
    images = [np.full((HEIGHT, WIDTH), k % 256, np.uint8) for k in range(len(frames))]
    times = np.array(frames, np.int64) if frames else None
    return Recording("rec", "text", WIDTH, HEIGHT, events, times, images=lambda: iter(images))


@st.composite
def pieces(draw):
    """Draw events and frames, cut into pieces that come in any order of one to the other."""
    begin = draw(st.sampled_from([0, 1_470_000_000_000_000]))
    spread_us = draw(st.sampled_from([900, 40_000, 400_000]))
    moments = st.integers(0, spread_us)
    bursts = draw(st.lists(st.tuples(moments, st.integers(1, 40)), max_size=6))
    events = at([begin + t + k for t, count in bursts for k in range(count)])
    apart = st.lists(st.integers(0, spread_us * 1000), max_size=12, unique=True)
    frames = [begin * 1000 + t for t in sorted(draw(apart))]
    cuts = sorted(draw(st.lists(st.integers(0, events.size), max_size=8)))
    parts = np.split(events, cuts)
    order = draw(st.permutations([0] * len(parts) + [1] * len(frames)))
    return events, frames, parts, order


@settings(max_examples=60, deadline=None)
@given(
    pieces(),
    st.sampled_from(["film.avi", "sheet.png"]),
    st.sampled_from([None, True, False]),
    st.sampled_from([1, 10_000, 33_333]),
    st.booleans(),
)
@pytest.mark.thorough
def test_pieces_in_any_order(made, name, with_frames, window_us, told):
    events, frames, parts, order = made
    if not frames:
        with_frames = None  # there is nothing that render could show
    shown = {"style": Style(window_us=window_us), "fps": 50.0, "scale": 1}
    with TemporaryDirectory() as folder:
        one, other = Path(folder, "a" + name), Path(folder, "b" + name)
        feed = iter(zip(frames, film(events, frames).frames(), strict=True)) if frames else iter([])
        rest = iter(parts)
        try:
            with open_preview(one, WIDTH, HEIGHT, frames=with_frames, **shown) as preview:
                for kind in order:
                    if kind:
                        t_ns, frame = next(feed)
                        preview.add_frame(t_ns, frame.image)
                        continue
                    part = next(rest)
                    preview.add_events(part)
                    if told and part.size:
                        preview.complete_until(int(part["t"][-1]))
        except OutputError as error:
            assert "no events or frames to draw" in str(error)
            assert not events.size
            assert not frames or with_frames is False
            return
        render_recording(film(events, frames), other, frames=with_frames is not False, **shown)
        assert one.read_bytes() == other.read_bytes()


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Return a clip that moves, rests, and moves again."""
    path = tmp_path_factory.mktemp("clip") / "clip.avi"
    write_video(Scene(), path, width=48, height=36, fps=60.0, duration_s=0.5)
    return path


SETTINGS = {
    "default": (),
    "no noise": ("pixel.shot_noise=null", "pixel.leak=null"),
    "events later than their frames": ("frames.clock_offset_us=70000",),
    "events earlier than their frames": ("frames.clock_offset_us=-70000",),
    "events changed": ("pixel.dead_pixels={fraction: 0.2}", "readout={tick_us: 5000}"),
}


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("sets", SETTINGS.values(), ids=SETTINGS.keys())
@pytest.mark.quick_cases(1)
def test_preview_of_a_conversion_is_what_render_makes_of_its_file(clip, tmp_path, sets, threads):
    for target, preview in (("out.zip", "film.avi"), ("out.h5", "sheet.png")):
        output, made, expected = (tmp_path / name for name in (target, preview, "_" + preview))
        with Reading(str(clip), threads=threads) as reading:
            convert_reading(
                reading,
                str(output),
                config=load_config([], sets),
                with_frames=True,
                preview=str(made),
            )
        render_recording(read_events(output), expected)
        assert made.read_bytes() == expected.read_bytes()


def test_a_scene_at_rest_is_drawn_while_it_lasts(tmp_path, monkeypatch):
    """No event comes for long, and yet no frame waits for one."""
    waiting = []
    original = Timeline.complete_until

    def complete_until(self, t_us):
        original(self, t_us)
        waiting.append(len(self._frames))

    monkeypatch.setattr(Timeline, "complete_until", complete_until)
    np.save(tmp_path / "still.npy", np.full((500, 6, 8), 90, np.uint8))
    times = np.arange(500) / 1000
    np.save(tmp_path / "still_ts.npy", times)
    with Reading(str(tmp_path / "still.npy"), threads=1) as reading:
        convert_reading(
            reading,
            str(tmp_path / "out.txt"),
            config=load_config(["ideal"]),
            preview=str(tmp_path / "film.avi"),
        )
    assert len(waiting) > 10
    assert max(waiting) < 100


def test_nothing_but_empty_pieces(tmp_path):
    with (
        pytest.raises(OutputError, match="no events or frames"),
        open_preview(tmp_path / "film.avi", WIDTH, HEIGHT) as preview,
    ):
        preview.add_events(empty_events())
        preview.complete_until(1000)
        preview.no_more_frames()
