"""Pairs of options of ``adv2e convert``: a few rows in which every pair occurs."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest

from adv2e.formats.reading import read_events

NONE: tuple[str, ...] = ()
OF_EVENTS = [
    [NONE, ("--fps", "50"), ("--timestamps", "t.txt", "--time-unit", "ms")],
    [NONE, ("--start", "0.02")],
    [NONE, ("--stop", "0.08")],
    [NONE, ("--crop", "2,4,12,6")],
    [NONE, ("--rotate180",)],
    [NONE, ("--bayer", "grbg")],
    [NONE, ("--size", "8x6"), ("-c", "own.yaml")],
    [NONE, ("--set", "readout.tick_us=10"), ("--set", "frames.encoding=linear")],
    [NONE, ("--seed", "3")],
    [NONE, ("--t0", "zero")],
]
"""Ways to give each option that the events depend on."""
BESIDE = [
    [
        *(("-o", "a.h5", "--layout", "dsec"), ("-o", "a.h5", "--with-frames"), ("-o", "a")),
        *(("-o", "a.txt"), ("-o", "a.raw"), ("-o", "a.zip", "--format", "e2vid")),
    ],
    [NONE, ("--preview", "a.png")],
    [NONE, ("--causes",)],
    [NONE, ("--threads", "1"), ("--threads", "2")],
    [NONE, ("-q",), ("-v",), ("--progress",)],
]
"""And of those that they do not depend on."""


def covering(factors, rng):
    """Yield rows, a way of each factor, until every pair of ways was in one of them."""
    ways = [(f, w) for f, factor in enumerate(factors) for w in range(len(factor))]
    left = {pair for pair in itertools.combinations(ways, 2) if pair[0][0] != pair[1][0]}
    while left:
        row = dict(rng.choice(sorted(left)))
        for f in rng.sample(range(len(factors)), len(factors)):
            gains = [
                sum(tuple(sorted([(f, w), other])) in left for other in row.items())
                for w in range(len(factors[f]))
            ]
            row.setdefault(f, gains.index(max(gains)))
        left -= set(itertools.combinations(sorted(row.items()), 2))
        yield [factors[f][row[f]] for f in range(len(factors))]


@pytest.fixture
def _stack(tmp_path, monkeypatch):
    """Keep raw mosaics of a ramp that moves, 20 ms apart, in the current folder."""
    monkeypatch.chdir(tmp_path)
    rows, columns = np.mgrid[:12, :16]
    frames = [(20 * rows + 17 * columns + 23 * n) % 256 for n in range(6)]
    np.save("s.npy", np.array(frames, np.uint8))
    np.save("s_ts.npy", 5 + np.arange(6) / 50)
    (tmp_path / "t.txt").write_text("".join(f"{7000 + 20 * n}\n" for n in range(6)))
    (tmp_path / "own.yaml").write_text("sensor: {width: 10, height: 8, fit: pad}\n")


@pytest.mark.usefixtures("_stack")
def test_what_is_written_beside_events_does_not_change_them(adv2e):
    for number, row in enumerate(covering([*OF_EVENTS, *BESIDE], random.Random(1))):
        of_events, beside = row[: len(OF_EVENTS)], row[len(OF_EVENTS) :]
        usual, words = sum(of_events, NONE), sum(row, NONE)
        output = f"{number}/{beside[0][1]}"
        for given in ((*usual, "-o", "usual.h5"), (*words, "-o", output)):
            outcome = adv2e("convert", "s.npy", *given, "--overwrite")
            assert outcome.status == 0, (given, outcome.err)
        expected, found = read_events("usual.h5"), read_events(output)
        assert expected.events.size > 0, usual
        assert (found.width, found.height) == (expected.width, expected.height), words
        for name in "txyp":
            same = np.array_equal(found.events[name], expected.events[name])
            assert same, (name, words)
