"""Intrinsics: a point of the world falls on the same light before and after."""

import numpy as np
import pytest
import yaml

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.side.calibration import parse_calibration
from adv2e.side.placement import Clock, Placement

NOW = Clock(np.zeros(0, np.int64))
WHOLE = Size(752, 480)
SENSOR = """%YAML:1.0
# General sensor definitions.
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.25, 0.0, 0.0, 1.0, 0.125, 0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
"""


def project(point, numbers):
    """Return the pixel of a point before a camera, middles of pixels being whole (OpenCV)."""
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = numbers
    x, y = point[0] / point[2], point[1] / point[2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.array([fx * u + cx, fy * v + cy])


@pytest.mark.parametrize("turned", [False, True])
def test_a_point_of_the_world_falls_where_its_light_falls(turned):
    place = Placement(WHOLE, Size(296, 104), turned, (0.5, 0.25), (34.0, 12.0))
    files = dict(parse_calibration(SENSOR, "sensor.yaml").written(place, NOW))
    before = [458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359]
    before += [1.76187114e-05, 0]
    after = np.array(files["calib.txt"].split(), float)
    told = yaml.safe_load(files["sensor.yaml"])
    assert told["resolution"] == [296, 104]
    assert told["rate_hz"] == 20
    assert [*told["intrinsics"], *told["distortion_coefficients"], 0] == pytest.approx(after)
    old = np.reshape(yaml.safe_load(SENSOR.split("\n", 1)[1])["T_BS"]["data"], (4, 4))
    new = np.reshape(told["T_BS"]["data"], (4, 4))
    for body in ((0.9, 0.6, 2.0, 1), (-0.3, 0.9, 2.5, 1), (1.1, 0.1, 1.7, 1)):
        x, y = project(np.linalg.solve(old, body), before) + 0.5
        if turned:
            x, y = 752 - x, 480 - y
        there = (x - 34) * 0.5, (y - 12) * 0.25
        assert project(np.linalg.solve(new, body), after) + 0.5 == pytest.approx(there, abs=1e-6)


def test_what_has_no_text_keeps_its_yaml():
    text = SENSOR.replace("radial-tangential", "equidistant")
    place = Placement(WHOLE, WHOLE)
    assert [name for name, _ in parse_calibration(text, "a.yaml").written(place, NOW)] == [
        "sensor.yaml"
    ]


def test_a_chain_of_kalibr_gives_its_first_camera():
    chain = {"cam0": {"camera_model": "omni", "intrinsics": [1.5, 80, 81, 30, 20]}, "cam1": {}}
    chain["cam0"] |= {"distortion_coeffs": [1, 2, 3, 4], "distortion_model": "radtan"}
    chain["cam0"]["T_cam_imu"] = np.diag([1.0, 2, 3, 1]).tolist()
    found = parse_calibration(yaml.safe_dump(chain), "camchain.yaml")
    place = Placement(Size(64, 48), Size(64, 48), turned=True)
    told = yaml.safe_load(dict(found.written(place, NOW))["sensor.yaml"])
    assert told["intrinsics"] == [1.5, 80, 81, 33, 27]
    assert told["distortion_coeffs"] == [1, 2, -3, -4]
    assert np.diag(told["T_cam_imu"]).tolist() == [-1, -2, 3, 1]


@pytest.mark.parametrize(
    ("text", "label", "told"),
    [
        ("1 2 3", "calib.txt", "must be fx fy cx cy k1 k2 p1 p2 k3, has 3"),
        ("80 90 a 4", "calib.txt", "'a' is not a number"),
        ("a: [", "sensor.yaml", "no sensor.yaml as of EuRoC"),
        ("a: 1", "sensor.yaml", "no sensor.yaml as of EuRoC"),
        ("intrinsics: [1, 2, 3]", "sensor.yaml", "camera_model pinhole of 3 numbers"),
        (SENSOR.replace("pinhole", "line"), "sensor.yaml", "camera_model line of 4 numbers"),
    ],
)
def test_what_is_no_calibration_is_refused(text, label, told):
    with pytest.raises(DataError, match=told):
        parse_calibration(text, label)


def test_a_calibration_of_other_frames_is_refused():
    place = Placement(Size(640, 480), Size(640, 480))
    with pytest.raises(DataError, match="of pictures of 752x480, and the frames are 640x480"):
        parse_calibration(SENSOR, "sensor.yaml").placed(place)
    with pytest.raises(DataError, match="cannot be"):
        parse_calibration("80 90 700 3", "calib.txt").placed(place)
