"""The study of known pictures: its table and its picture, of recordings that hold chance alone."""

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from studies import film

from adv2e import write_events
from adv2e.diagnosis.film.nearness import DISTANCES
from adv2e.events import EVENT_DTYPE
from adv2e.geometry import Size


def _recording(random, count):
    events = np.zeros(count, EVENT_DTYPE)
    events["t"] = np.sort(random.integers(0, 60_000, count))
    events["x"], events["y"] = random.integers(0, 12, (2, count))
    events["p"] = random.integers(0, 2, count)
    return events


@pytest.mark.thorough
def test_each_configuration_has_its_distances_and_its_events(tmp_path):
    random = np.random.default_rng(4)
    for k in range(4):
        write_events(tmp_path / f"{k}.npz", _recording(random, 500), (12, 12))
        picture = cv2.GaussianBlur(random.uniform(0, 255, (12, 12)), (0, 0), 1.5)
        assert cv2.imwrite(str(tmp_path / f"{k}.png"), picture.astype(np.uint8))
    labels = "".join(f"{k}.npz {k}.png {k % 2}\n" for k in range(4))
    (tmp_path / "labels.txt").write_text("# file picture class\n" + labels)
    arguments = [
        tmp_path,
        "--size",
        "12x12",
        "--suffix",
        ".npz",
        "--simulators",
        "ideal",
        "--train",
        tmp_path,
        "-o",
        tmp_path / "a.md",
    ]
    outcome = CliRunner().invoke(film.main, list(map(str, arguments)))
    assert outcome.exit_code == 0, outcome.output
    found = json.loads((tmp_path / "a.json").read_text("utf-8"))["ideal"]
    assert list(found["distances"]) == list(DISTANCES)
    assert 0.0 <= found["classes"] <= 1.0
    assert found["without pictures"]["the same, measured "] == pytest.approx(0.5, abs=0.05)
    assert "| ideal |" in (tmp_path / "a.md").read_text("utf-8")
    # two rows of two recordings that judge, six times as large, with a border
    assert cv2.imread(str(tmp_path / "a.png")).shape == (2 * 80, 2 * 80, 3)


def test_on_is_red_and_off_is_blue():
    events = np.zeros(24, EVENT_DTYPE)
    events["x"][12:], events["p"][12:] = 1, 1
    drawn = film.drawn([[events]], Size(2, 1))
    # OpenCV's order of colours
    np.testing.assert_array_equal(drawn[6, 6], (255, 0, 0))
    np.testing.assert_array_equal(drawn[6, 12], (0, 0, 255))
    np.testing.assert_array_equal(drawn[0, 0], (153, 153, 153))
