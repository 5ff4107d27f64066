"""Whether two sets of events can be told apart: known laws, and a slow twin of the classifier."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

import adv2e as package
from adv2e.comparison import two_samples
from adv2e.comparison.features import described, features
from adv2e.comparison.two_samples import Samples
from adv2e.events import empty_events, make_events, sort_events
from adv2e.formats.recording import Recording
from adv2e.formats.writing import open_sink

SIZE = (20, 15)
LENGTH_US = 200_000


def scene(seed):
    """Rates of the pixels of one scene [events a us], (rows, columns)."""
    draw = np.random.default_rng(seed)
    return draw.gamma(1.0, 4.0, SIZE[::-1]) / LENGTH_US


def recorded(rates, draw, *, dead_us=0, kept=1.0, length_us=LENGTH_US):
    """Poisson events of a scene, after each of which a pixel is dead, thinned."""
    found = []
    for y, x in np.ndindex(rates.shape):
        count = draw.poisson(rates[y, x] * length_us)
        last = -dead_us
        for t in np.sort(draw.integers(0, length_us, count)):
            if t - last >= dead_us:
                found.append((t, x, y, draw.random() < 0.5))
                last = t
    events = sort_events(make_events(*np.array(found, np.int64).reshape(-1, 4).T))
    return events[draw.random(len(events)) < kept]


def one_set(seed, count=24, **law):
    """Recordings of `count` scenes, those of one number of one scene in every set."""
    draw = np.random.default_rng(seed)
    return [
        Recording(f"{k:02d}.h5", "array", *SIZE, recorded(scene(1000 + k), draw, **law))
        for k in range(count)
    ]


def told_apart(*sets):
    return package.compare(*sets)["told_apart"]


@pytest.fixture(scope="module")
def measured():
    return one_set(1)


def test_sets_of_one_law_cannot_be_told_apart(measured):
    found = [told_apart(measured, one_set(seed)) for seed in range(2, 10)]
    # so many decisions are right as with a coin, within four of its standard deviations
    decisions = 2 * len(measured) * len(found)
    assert abs(np.mean([one["value"] for one in found]) - 0.5) < 4 * np.sqrt(0.25 / decisions)
    assert sum(low <= 0.5 <= high for low, high in (one["interval_95"] for one in found)) >= 7
    assert [one["differences"]["largest"] for one in found] == [[]] * len(found)
    assert abs(found[0]["floor"]["half_split"] - 0.5) < 0.25


def test_a_thinned_set_is_told_apart_by_its_events(measured):
    found = told_apart(measured, one_set(20, kept=0.7))
    assert found["value"] > 0.8
    assert 0.5 < found["interval_95"][0] < found["value"] < found["interval_95"][1] <= 1
    largest = found["differences"]["largest"]
    assert "events" in [one["feature"] for one in largest]
    events = next(one for one in largest if one["feature"] == "events")
    assert events["simulated"] / events["measured"] == pytest.approx(0.7, rel=0.02)


def test_a_set_with_another_dead_time_is_told_apart_by_the_gaps(measured):
    found = told_apart(measured, one_set(21, dead_us=10_000))
    first = found["differences"]["largest"][0]
    assert first["feature"] == "share of times between events of a pixel of 5.6 ms to 10 ms"
    assert first["simulated"] == 0 < first["measured"]
    assert first["text"].startswith(f"{first['feature']}: 0 % against ")
    assert found["interval_95"][0] > 0.8


def test_a_set_is_not_told_from_itself(measured):
    found = told_apart(measured, measured)
    assert found["value"] == 0.5
    assert found["differences"]["largest"] == []


def test_neither_order_nor_repetition_change_a_number(measured):
    other = one_set(3)
    assert told_apart(measured, other) == told_apart(measured[::-1], other[5:] + other[:5])


# ---- A twin that shares no code: loops, and least squares in the place of normal equations.


def slow_right(values, is_simulated, group, place=None):
    found = np.zeros(len(values), bool)
    for sample in range(len(values)):
        part = group[sample] % 5
        asked = [k for k in range(len(values)) if group[k] % 5 == part]
        learnt = [k for k in range(len(values)) if group[k] % 5 != part]
        if place is not None:
            learnt = [
                k for k in learnt if all(abs(place[k] - place[other]) != 1 for other in asked)
            ]
        simulated = sum(is_simulated[k] for k in learnt)
        half = [0.5 / (simulated if is_simulated[k] else len(learnt) - simulated) for k in learnt]
        rows, targets, asked_row = [], [], []
        means, deviations = [], []
        for column in values.T:
            mean = sum(w * column[k] for w, k in zip(half, learnt, strict=True))
            means.append(mean)
            square = sum(w * (column[k] - mean) ** 2 for w, k in zip(half, learnt, strict=True))
            deviations.append(square**0.5)
        used = [j for j, deviation in enumerate(deviations) if deviation > 1e-6]
        for w, k in zip(half, learnt, strict=True):
            rows.append([w**0.5 * (values[k, j] - means[j]) / deviations[j] for j in used])
            targets.append(w**0.5 * (-1 if is_simulated[k] else 1))
        for number in range(len(used)):  # what ridge adds to the sum of squares
            rows.append([float(number == other) for other in range(len(used))])
            targets.append(0.0)
        weights = np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0]
        asked_row = [(values[sample, j] - means[j]) / deviations[j] for j in used]
        found[sample] = (float(np.dot(weights, asked_row)) > 0) != is_simulated[sample]
    return found


@pytest.mark.parametrize("in_time", [False, True])
def test_what_is_right_is_what_a_slow_twin_puts_right(in_time):
    draw = np.random.default_rng(4)
    values = draw.normal(size=(66, 6))
    values[:, 2] = 1.0  # the same everywhere
    is_simulated = draw.permutation(np.arange(66) < 30)
    values[is_simulated, 0] += 0.7
    place = draw.permutation(np.tile(np.arange(33), 2)) if in_time else None
    group = place // 3 if in_time else draw.integers(0, 20, 66)
    found = two_samples.right(Samples(values, is_simulated, group, place))
    assert found.tolist() == slow_right(values, is_simulated, group, place).tolist()
    assert 0.55 < found.mean() < 0.95


def test_the_interval_is_that_of_as_many_samples_as_there_are_groups():
    group = np.repeat(np.arange(200), 2)  # both of a group are right, or both are wrong
    samples = Samples(np.zeros((400, 1)), np.arange(400) % 2 == 1, group)
    found = two_samples.interval(samples, group < 150)
    known = binomtest(150, 200).proportion_ci(method="wilson")
    assert found == pytest.approx((known.low, known.high), abs=0.001)
    everything = two_samples.interval(samples, np.ones(400, bool))
    assert everything == pytest.approx((1 / (1 + 1.96**2 / 200), 1.0), abs=1e-4)


# ---- Features of any sensor and any length.


@pytest.mark.parametrize("size", [(1, 1), (34, 34), (346, 260), (8192, 4096)])
@pytest.mark.parametrize("parts", [4, 32])
def test_each_value_is_described(size, parts):
    draw = np.random.default_rng(5)
    span = (7, 10**9)
    places = (draw.integers(0, side, 900) for side in size)
    events = sort_events(make_events(draw.integers(*span, 900), *places, draw.integers(0, 2, 900)))
    about = described(size, parts)
    values = features(events, size, span, parts)
    assert values.shape == (len(about),) == features(events[:0], size, span, parts).shape
    assert len({one.words for one in about}) == len(about)
    for family in ("course", "ON course", "columns", "rows", "gaps"):
        shares = [v for v, one in zip(values, about, strict=True) if one.family == family]
        assert sum(shares) == pytest.approx(
            1 if family != "gaps" or size == (1, 1) else sum(shares)
        )
    assert np.isfinite(values).all()
    assert not features(empty_events(), size, span, parts).any()


def test_known_events_have_known_values():
    events = make_events([0, 10, 2000, 3_000_000], [3, 3, 3, 0], [1, 1, 1, 0], [1, 0, 1, 1])
    values = features(events, (4, 2), (0, 4_000_000), 4)
    named = {one.words: one.natural(v) for one, v in zip(described((4, 2), 4), values, strict=True)}
    assert named["events"] == pytest.approx(4)
    assert named["share of ON events"] == 0.75
    assert named["time from the first event to the last [s]"] == 3
    assert named["share of events in part 1 of 4 of the time"] == 0.75
    assert named["share of ON events in part 4 of 4 of the time"] == pytest.approx(1 / 3)
    assert named["share of events in columns 3"] == 0.75
    assert named["share of events in rows 0"] == 0.25
    assert named["share of times between events of a pixel of 10 us to 18 us"] == 0.5
    assert named["share of times between events of a pixel of 1.8 ms to 3.2 ms"] == 0.5
    busiest = [named[f"events of the pixel at place {k} of the busiest"] for k in (1, 2, 4, 8)]
    assert busiest == pytest.approx([3, 1, 0, 0])


# ---- Two recordings, in windows of time.


def pair(draw, **law):
    rates = scene(7)
    for how in ({}, law):
        events = recorded(rates, draw, length_us=2_500_000, **how)
        yield Recording("array", "array", *SIZE, events)


def test_two_recordings_are_told_apart_in_windows_of_time():
    draw = np.random.default_rng(8)
    same = told_apart(*pair(draw))
    assert same["groups"] == 20
    assert same["samples"][0] == same["samples"][1] >= 60
    assert abs(same["value"] - 0.5) < 4 * np.sqrt(0.25 / same["samples"][0])
    assert abs(same["floor"]["half_split"] - 0.5) < 0.15
    thinned = told_apart(*pair(draw, kept=0.7))
    assert thinned["value"] > 0.9
    assert thinned["interval_95"][0] > 0.7
    assert thinned["differences"]["largest"]


def test_a_recording_of_few_events_says_why_it_is_not_told_apart():
    one, other = (part[0:0.9] for part in pair(np.random.default_rng(9)))
    found = told_apart(one, other)
    assert found["value"] is found["interval_95"] is None
    assert "windows of 100 events need 6,000 of each" in found["why_none"]


# ---- The command.


@pytest.fixture
def folders(tmp_path, measured):
    """Two folders of files, and a file beside those of the first that is no recording."""
    for name, recordings in (("real", measured[:12]), ("made", one_set(20, 12, kept=0.6))):
        (tmp_path / name).mkdir()
        for one in recordings:
            path = (
                tmp_path / name / one.path.replace(".h5", ".events.h5" * (name == "made") or ".txt")
            )
            with open_sink(path, width=SIZE[0], height=SIZE[1], metadata={}) as sink:
                sink.write_events(one.events)
    (tmp_path / "real" / ".hidden.h5").touch()
    (tmp_path / "real" / "notes.md").touch()
    return tmp_path / "real", tmp_path / "made"


def test_folders_and_patterns_are_sets_and_names_make_pairs(adv2e, folders):
    real, made = folders
    status, out, err = adv2e("compare", real, made, "--size", "20x15")
    assert status == 0
    assert "measured   12 recordings of 20x15 pixels" in out
    assert "12 pairs have one name" in out
    row = next(line for line in out.splitlines() if line.startswith("told_apart"))
    assert float(row.split()[1]) > 0.6
    assert "events: " in out
    assert err.count("\n") == len({line.split(": ", 1)[1] for line in err.splitlines()})
    words = (real / "*.txt", f"{made}/*.h5", "--size", "20x15", "--json")
    report = json.loads(adv2e("compare", *words).out)
    assert report["told_apart"]["value"] == pytest.approx(float(row.split()[1]), abs=0.005)
    assert report == package.compare(*words[:2], size=(20, 15), doubt=lambda text: None)


def test_a_file_that_is_no_recording_is_not_left_out_in_silence(adv2e, folders):
    (folders[0] / "labels.txt").write_text("01.txt seven\n")
    status, _, err = adv2e("compare", *folders, "--size", "20x15")
    assert status == 1
    assert "labels.txt" in err
    assert "with a pattern" in err


@pytest.mark.parametrize(
    ("words", "status", "says"),
    [
        (("real", "made/00.events.h5"), 2, "SIMULATED: is one recording, and the other is a set"),
        (("real/00.txt", "made"), 2, "MEASURED: is one recording"),
        (("real", "made", "--window", "0.1"), 2, "--window is of two recordings"),
        (("real", "made", "--start", "0"), 2, "--start is of two recordings"),
        (("real", "made", "-c", "ideal"), 2, "-c is of two recordings"),
        (("real/0*.txt", "made/0[0-3]*"), 1, "4 recordings; a set that is compared"),
        (("real/*.zip", "made"), 1, "0 recordings"),
        (
            ("real", "made"),
            1,
            "99.txt: 4x3 pixels, but others have 20x15: sets are compared on one size",
        ),
    ],
)
def test_sets_that_do_not_fit_are_refused_in_one_line(
    adv2e, folders, monkeypatch, words, status, says
):
    monkeypatch.chdir(folders[0].parent)
    if words == ("real", "made"):
        (folders[0] / "99.txt").write_text("0.1 3 2 1\n")
    found, out, err = adv2e("compare", *words)
    assert (found, out) == (status, "")
    assert says in err


def test_sets_of_other_names_have_no_pairs(measured):
    other = [Recording("array", "array", *SIZE, one.events) for one in one_set(2)]
    report = package.compare(measured, other)
    assert report["pairs"] == 0
    assert report["told_apart"]["groups"] == len(measured) + len(other)
    assert 0.2 < report["told_apart"]["value"] < 0.8


FOLDER = os.environ.get("ADV2E_REAL_DATA")


@pytest.mark.skipif(not FOLDER, reason="ADV2E_REAL_DATA does not name a folder of recordings")
def test_real_recordings_are_told_from_thinned_ones_and_not_from_others():
    files = sorted((Path(FOLDER) / "atis-nmnist" / "known").glob("*.bin"))
    quiet = {"doubt": lambda text: None}
    halves = package.compare(files[:25], files[25:], **quiet)["told_apart"]
    assert halves["interval_95"][0] < 0.5 < halves["interval_95"][1]
    assert halves["differences"]["largest"] == []
    draw, thinned = np.random.default_rng(1), []
    for one in map(package.read_events, files):
        events = one.events[draw.random(len(one)) < 0.85]
        thinned.append(Recording(one.path, "array", one.width, one.height, events))
    found = package.compare(files, thinned, **quiet)
    assert found["pairs"] == 50
    assert found["told_apart"]["value"] == pytest.approx(0.77, abs=0.05)
