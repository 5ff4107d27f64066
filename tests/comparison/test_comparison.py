from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from adv2e.comparison import resimulation
from adv2e.comparison.compare import STATISTICS, WARNING, compare
from adv2e.comparison.distances import MEASURES, distances
from adv2e.comparison.report import text
from adv2e.comparison.windows import Windows
from adv2e.errors import DataError, UsageError
from adv2e.events import empty_events
from adv2e.formats.recording import Recording


@pytest.fixture
def measured(random_events):
    times_ns = np.arange(0, 120_000_000, 20_000_000)
    return Recording("real.zip", "monash", 12, 9, random_events(1, 3000), times_ns)


@pytest.fixture
def simulated(random_events):
    return Recording("made.h5", "monash", 12, 9, random_events(2, 2500))


def test_the_windows_are_the_frame_intervals_of_the_measured_recording(measured, simulated):
    windows = compare(measured, simulated)["windows"]
    # the first event comes after the first frame and the last before the last
    assert windows == {
        "kind": "frame intervals",
        "used": 3,
        "total": 5,
        "edges_us": [20_000, 40_000, 60_000, 80_000],
    }


def test_without_frames_windows_are_50_ms(measured, simulated):
    first = int(simulated.events["t"][0])
    later = replace(measured, frame_times_ns=None)
    windows = compare(later, simulated)["windows"]
    assert windows["kind"] == "windows of 0.05 s"
    assert windows["edges_us"] == [first, first + 50_000]


def test_a_window_that_is_asked_for_wins_over_frames(measured, simulated):
    assert compare(measured, simulated, window_s=0.01)["windows"]["used"] == 9


def test_frame_times_that_are_given_win_over_those_of_the_recording(measured, simulated):
    times = np.array([30_000_000, 50_000_000])
    found = compare(measured, simulated, frame_times_ns=times)
    assert found["windows"]["edges_us"] == [30_000, 50_000]


def test_frames_of_a_simulated_stream_belong_to_its_span(measured, simulated):
    quiet = replace(simulated, events=simulated.events[1000:])
    framed = replace(quiet, frame_times_ns=np.array([0, 100_000_000]))
    assert compare(measured, quiet)["windows"]["used"] < 3
    assert compare(measured, framed)["windows"]["used"] == 3


def test_every_measure_has_definition_value_and_floor(measured, simulated):
    report = compare(measured, simulated)
    assert list(report["measures"]) == list(MEASURES)
    for name, measure in report["measures"].items():
        assert measure["definition"] == MEASURES[name].definition
        assert measure["value"] > 0
        assert measure["floor"]["half_split"] > 0
        assert measure["floor"]["two_seeds"] is None
    assert len(report["measures"]["relative_5_bins"]["per_window"]) == 3
    assert list(report["measures"]["error"]["per_sigma_us"]) == ["2000", "10000", "50000", "100000"]
    assert report["warning"] == WARNING


def test_statistics_are_those_of_the_time_compared(measured, simulated):
    statistics = compare(measured, simulated)["statistics"]
    assert list(statistics) == [*STATISTICS, "latency_offset_us"]
    inside = (measured.events["t"] >= 20_000) & (measured.events["t"] < 80_000)
    assert statistics["events"]["measured"] == inside.sum()
    assert statistics["rate"]["measured"] == pytest.approx(inside.sum() / 0.06 / 108)
    assert statistics["latency_offset_us"]["value"] is None


def test_a_configuration_gives_the_floor_of_two_seeds(
    measured, simulated, random_events, monkeypatch
):
    def resimulator(*given, threads):
        return lambda seed: random_events(seed, 2500)

    monkeypatch.setattr(resimulation, "resimulator", resimulator)
    report = compare(measured, simulated, {"seed": 4})
    edges = report["windows"]["edges_us"]
    windows = Windows("", tuple(itertools.pairwise(edges)), len(edges) - 1)
    draws = random_events(4, 2500), random_events(5, 2500)
    expected = distances(*draws, windows, 12, 9, whole=measured.events).values
    found = {name: one["floor"]["two_seeds"] for name, one in report["measures"].items()}
    assert found == expected
    assert found["bins_shared_window"] > 0
    assert "4 and 5" in report["floors"]["two_seeds"]
    assert "two_seeds" in text(report)


def test_how_to_read_is_said_of_files_alone(measured, simulated):
    with pytest.raises(UsageError, match="crop: is of the reading of a file"):
        compare(measured, simulated, crop=(0, 0, 2, 2))
    with pytest.raises(UsageError, match="start_s: is of the reading of a file"):
        compare(measured, "made.h5", start_s=0.1, crop=(0, 0, 2, 2))


def test_the_report_is_plain_json(measured, simulated):
    report = compare(measured, simulated)
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_sizes_that_differ_are_refused_with_both(measured, simulated):
    with pytest.raises(DataError, match=r"made.h5: 16x9 pixels, but real.zip has 12x9"):
        compare(measured, replace(simulated, width=16))


def test_streams_without_common_time_are_refused_with_both_spans(measured, simulated):
    later = simulated.events.copy()
    later["t"] += 1_468_941_032_229_165
    with pytest.raises(DataError, match=r"made.h5: spans 1468941032\.2\d+ to .* no time in common"):
        compare(measured, replace(simulated, events=later))


@pytest.mark.parametrize("which", ["measured", "simulated"])
def test_a_stream_without_events_is_refused(measured, simulated, which):
    streams = {"measured": measured, "simulated": simulated}
    streams[which] = replace(streams[which], events=empty_events())
    with pytest.raises(DataError, match=f"{streams[which].path}: holds no events"):
        compare(streams["measured"], streams["simulated"])


def test_a_simulated_stream_that_kept_still_is_as_far_as_no_events(measured, simulated):
    still = replace(simulated, events=empty_events(), frame_times_ns=np.array([0, 100_000_000]))
    report = compare(measured, still)
    assert report["measures"]["relative_5_bins"]["value"] == pytest.approx(1)
    assert report["statistics"]["on_share"]["simulated"] is None
    assert "made.h5 (monash, 12x9): no events" in text(report)


def test_the_text_names_and_defines_every_number_and_refuses_published_figures(measured, simulated):
    lines = text(compare(measured, simulated))
    for name in MEASURES:
        assert lines.count(name) >= 2
    for name in STATISTICS:
        assert name in lines
    assert "over 3 of 5 frame intervals, 0.02 to 0.08 s" in lines
    assert lines.endswith(WARNING)
