from __future__ import annotations

import numpy as np

from adv2e.events import empty_events, make_events
from adv2e.rendering.styles import Style
from adv2e.rendering.timeline import Timeline

MS = 1_000_000  # ns


class Kept:
    """An album that keeps everything."""

    whole = True

    def __init__(self, every=1):
        self.cells = {}
        self.every = every

    def wanted_from(self, number):
        return -(-number // self.every) * self.every

    def add(self, number, cell):
        self.cells[number] = cell


def timeline(album, *, step_us=100, window_us=100, **more):
    style = Style(window_us=window_us, on=(0, 0, 0))
    return Timeline(album, (4, 2), style, step_us=step_us, **more)


def at(times, x=0, y=0, p=1):
    n = len(times)
    return make_events(times, np.full(n, x), np.full(n, y), np.full(n, p))


def drawn(cell):
    """Return the columns of row 0 that are black in the panel of events."""
    return np.flatnonzero(cell.panels[-1][0, :, 0] == 0).tolist()


def captions(album):
    return [cell.caption for cell in album.cells.values()]


def test_every_event_is_in_one_picture():
    album = Kept()
    line = timeline(album)
    times = np.sort(np.random.default_rng(0).integers(0, 10_000, 500))
    for part in np.array_split(times, 7):
        line.add_events(at(part))
    assert line.finish()
    counts = [int(text.split()[2]) for text in captions(album)]
    assert sum(counts) == 500
    assert len(counts) == -(-(times[-1] + 1 - times[0]) // 100)


def test_instants_come_after_the_start_at_even_steps():
    album = Kept()
    line = timeline(album, step_us=33_333.3, window_us=1)
    line.add_events(at([1_000_000, 1_099_999]))
    line.finish()
    assert [text.split()[0] for text in captions(album)] == ["0.033", "0.067", "0.100"]


def test_instants_do_not_drift():
    album = Kept()
    line = timeline(album, step_us=1e6 / 30, window_us=1)
    line.add_events(at([0, 9_999_999]))
    line.finish()
    assert len(album.cells) == 300
    assert captions(album)[-1].startswith("10.000 s")


def test_chunks_do_not_matter():
    times = np.arange(0, 3000, 7)
    whole, parts = Kept(), Kept()
    line = timeline(whole, window_us=250)
    line.add_events(at(times))
    line.finish()
    line = timeline(parts, window_us=250)
    for time in times:
        line.add_events(at([time]))
        line.add_events(empty_events())
    line.finish()
    assert captions(parts) == captions(whole)


def test_windows_may_overlap():
    album = Kept()
    line = timeline(album, step_us=100, window_us=200, start_us=0)
    line.add_events(at([50, 150, 250, 350]))
    line.finish()
    assert [text.split()[2] for text in captions(album)] == ["1", "2", "2", "2"]


def test_given_instants_are_drawn_even_after_the_end():
    album = Kept()
    line = timeline(album, instants_us=[150, 900], start_us=100)
    line.add_events(at([60, 150, 160]))
    line.finish()
    assert captions(album) == ["0.000 s   1 events", "0.001 s   0 events"]


def test_at_least_one_picture_however_short():
    album = Kept()
    line = timeline(album, step_us=1000, window_us=1000)
    line.add_events(at([5, 6]))
    assert line.finish()
    assert captions(album) == ["0.001 s   2 events"]


def test_nothing_came():
    line = timeline(Kept())
    line.add_events(empty_events())
    assert not line.finish()


def test_frame_beside_is_the_last_one_at_the_instant():
    album = Kept()
    line = timeline(album, step_us=1000, window_us=1000)
    for k in range(4):
        line.add_frame(k * 1500 * 1000, np.full((2, 4), 10 * k, np.uint8))
        line.add_events(at([1500 * k, 1500 * k + 700], x=k))
    line.finish()
    # instants 1 ms apart, frames 1.5 ms apart
    cells = album.cells.values()
    assert [int(cell.panels[0][0, 0, 0]) for cell in cells] == [0, 10, 20, 20, 30, 30]
    assert [drawn(cell) for cell in cells] == [[0], [1], [1], [2], [3], [3]]


def test_frames_that_run_ahead_of_the_events():
    def run(ahead):
        album = Kept()
        line = timeline(album, step_us=1000, window_us=1000, start_us=0)
        frames = iter(range(20))
        for k in range(20):
            while (n := next(frames, None)) is not None:
                line.add_frame(n * MS, np.full((2, 4), n, np.uint8))
                if n >= k + ahead:
                    break
            times = [1000 * k, 1000 * k + 999] if k % 5 == 0 else []
            line.add_events(at(times))
        line.finish()
        return [(int(c.panels[0][0, 0, 0]), c.caption) for c in album.cells.values()]

    # events one interval late, as one call after the next frame, and none at all in most intervals
    assert run(1) == run(0)
    assert [text.split()[2] for _, text in run(1)][:6] == ["2", "0", "0", "0", "0", "2"]


def test_before_the_first_frame_its_panel_is_grey():
    album = Kept()
    line = timeline(album, frames=True)
    line.add_events(at([0, 150]))
    line.add_frame(200_000, np.full((2, 4), 9, np.uint8))
    line.add_events(at([350]))
    line.finish()
    assert [int(cell.panels[0][0, 0, 0]) for cell in album.cells.values()] == [128, 9, 9, 9]


def test_no_panel_for_frames_unless_wanted():
    for frames, panels in ((None, 2), (True, 2), (False, 1)):
        album = Kept()
        line = timeline(album, frames=frames)
        line.add_frame(0, np.zeros((2, 4), np.uint8))
        line.add_events(at([0, 150]))
        line.finish()
        assert len(album.cells[0].panels) == panels


def test_colour_deep_and_large_frames_become_panels():
    colour = np.zeros((2, 4, 3), np.uint8)
    colour[:] = (1, 2, 3)
    deep = np.full((2, 4), 0x7FFF, np.uint16)
    large = np.full((8, 16), 77, np.uint8)
    for image, expected in ((colour, (1, 2, 3)), (deep, (127,) * 3), (large, (77,) * 3)):
        album = Kept()
        line = timeline(album)
        line.add_frame(0, image)
        line.add_events(at([0, 150]))
        line.finish()
        panel = album.cells[0].panels[0]
        assert panel.shape == (2, 4, 3)
        assert tuple(panel[1, 3]) == expected


def test_a_frame_may_be_written_over_by_its_source():
    album = Kept()
    line = timeline(album)
    image = np.full((2, 4), 5, np.uint8)
    line.add_frame(0, image)
    image[:] = 99
    line.add_events(at([150]))
    line.finish()
    assert album.cells[0].panels[0][0, 0, 0] == 5


def test_memory_does_not_grow():
    line = timeline(Kept(every=1 << 40), step_us=1000, window_us=5000, start_us=0, frames=True)
    sparse = timeline(Kept(), instants_us=[250_000], window_us=10)
    for k in range(300):
        for one in (line, sparse):
            one.add_frame(k * MS, np.zeros((2, 4), np.uint8))
            one.add_events(at(np.arange(1000 * k, 1000 * k + 1000, 10)))
    for one in (line, sparse):
        assert one._events.size + sum(chunk[1].size for chunk in one._coming._items) <= 700
        assert len(one._frames) <= 2


def test_frames_do_not_wait_for_events_when_it_is_told_that_there_are_none():
    line = timeline(Kept(), step_us=1000)
    for k in range(300):
        line.add_frame(k * MS, np.zeros((2, 4), np.uint8))
        line.complete_until(1000 * k)
        assert len(line._frames) <= 2
    line.no_more_frames()
    line.add_events(at([500_000]))
    assert not line._frames
    assert len(line._output.cells) == 500


def test_what_waits_beyond_some_memory_waits_on_disk(monkeypatch, tmp_path):
    def run(**more):
        album = Kept()
        line = timeline(album, step_us=1000, window_us=2500, **more)
        for k in range(200):
            line.add_events(at(1000 * k + np.arange(0, 1000, 7)))
        for k in range(200):
            line.add_frame(k * MS, np.full((2, 4), k, np.uint8))
        waiting = len(line._coming) + len(line._frames)
        line.finish()
        line.close()
        return waiting, [(c.caption, int(c.panels[0][0, 0, 0])) for c in album.cells.values()]

    _, expected = run()
    monkeypatch.setattr("adv2e.files.backlog.LIMIT_BYTES", 1000)
    assert run(folder=tmp_path) == (2, expected)
    assert list(tmp_path.iterdir()) == []
