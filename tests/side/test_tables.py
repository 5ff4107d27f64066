"""Poses, IMU and exposures of each data set, against what NumPy reads of the same text."""

import numpy as np
import pytest

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.side.placement import Clock, Placement
from adv2e.side.tables import parse_table

NOW = Clock(np.zeros(0, np.int64))

PLACE = Placement(Size(4, 3), Size(4, 3))

EUROC_IMU = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    "1403636579758555392,-0.099,0.147,0.0272,8.1476,-0.375,-2.4026\n"
    "1403636579763555584,-0.100,0.146,0.0274,8.0333,-0.408,-2.4353\n"
)
EUROC_POSES = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [],"
    " q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1],"
    " b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2],"
    " b_a_RS_S_z [m s^-2]\n"
    "1403636580838555648,4.6,-1.7,0.7,0.53,-0.15,-0.82,-0.06,1,2,3,4,5,6,7,8,9\n"
    "1403636580843555648,4.7,-1.8,0.8,0.54,-0.16,-0.83,-0.07,1,2,3,4,5,6,7,8,9\n"
)
UZH_IMU = (
    "# id timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z\n"
    "0 1540821840.102 1.5 2.5 3.5 4.5 5.5 6.5\n1 1540821840.104 11 12 13 14 15 16\n"
)
TUM = (
    "# ground truth trajectory\n# file: 'rgbd_dataset.bag'\n# timestamp tx ty tz qx qy qz qw\n"
    "1305031098.6659 1.3563 0.6305 1.6380 0.6132 0.5962 -0.3311 -0.3986\n"
)
DAVIS_IMU = "0.001 -0.09 9.57 -0.24 -1.4e-3 0.02 0.03\n0.002 -0.08 9.5 -0.2 0.1 0.2 0.3\n"


def written(text, kind):
    ((_, data),) = parse_table(text, "a.txt", kind).written(PLACE, NOW)
    return data.decode()


def test_a_part_without_any_is_told():
    later = Clock(np.zeros(0, np.int64), begin=10**10)
    with pytest.raises(DataError, match="none of its times is in the part"):
        list(parse_table(DAVIS_IMU, "a.txt", "imu").written(PLACE, later))


@pytest.mark.parametrize(
    ("text", "kind", "mark", "unit", "order"),
    [
        (EUROC_IMU, "imu", ",", 1, [4, 5, 6, 1, 2, 3]),
        (EUROC_POSES, "poses", ",", 1, [1, 2, 3, 5, 6, 7, 4]),
        (UZH_IMU, "imu", None, 10**9, [5, 6, 7, 2, 3, 4]),
        (TUM, "poses", None, 10**9, range(1, 8)),
        (DAVIS_IMU, "imu", None, 10**9, range(1, 7)),
        ("# t ax ay az\n1.5 1 2 3\n", "accelerometer", None, 10**9, range(1, 4)),
    ],
    ids=["euroc-imu", "euroc-poses", "uzh-imu", "tum", "davis-imu", "tum-accelerometer"],
)
def test_a_data_set_is_read_as_numpy_reads_it(text, kind, mark, unit, order, tmp_path):
    (tmp_path / "out.txt").write_text(written(text, kind))
    rows = [line for line in text.splitlines() if not line.startswith("#")]
    known = np.loadtxt(rows, delimiter=mark, ndmin=2)
    made = np.loadtxt(tmp_path / "out.txt", ndmin=2)
    assert np.array_equal(made[:, 1:], known[:, list(order)])
    time = 1 if "id" in text.split("\n")[0].split() else 0
    whole = [line.replace(mark or " ", " ").split()[time] for line in rows]
    exact = [line.split()[0] for line in (tmp_path / "out.txt").read_text().splitlines()]
    if unit == 1:
        assert [one.replace(".", "") for one in exact] == whole
    else:
        assert [float(one) for one in exact] == [float(one) for one in whole]


def test_exposures_have_two_times():
    text = "# exposure_start_timestamp_us, exposure_end_timestamp_us\n49599300523, 49599315524\n"
    assert written(text, "exposures") == "49599.300523000 49599.315524000\n"


def test_what_is_left_out_is_told():
    table = parse_table(EUROC_POSES, "poses.csv", "poses")
    assert table.told == [
        "poses.csv: columns that are not carried: v_RS_R_x, v_RS_R_y, v_RS_R_z, b_w_RS_S_x,"
        " b_w_RS_S_y, b_w_RS_S_z, b_a_RS_S_x, b_a_RS_S_y, b_a_RS_S_z"
    ]
    assert parse_table(UZH_IMU, "imu.txt", "imu").told == []


def test_a_unit_that_is_a_guess_is_told():
    (line,) = parse_table("5000 1 2 3\n10000 1 2 3\n", "a.txt", "accelerometer").told
    assert "taken as us" in line
    assert "'time [ns]' settles it" in line


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "a.txt: no lines of numbers"),
        ("# nothing\n", "a.txt: no lines of numbers"),
        ("1 2 3 4 5 6\n", "a.txt: 6 columns that no heading tells: must be t ax ay az gx gy gz"),
        ("# a b c d e f g\n1 2 3 4 5 6 7\n", "7 columns that no heading tells"),
        (DAVIS_IMU + "0.003 1 2 3\n", "a.txt line 3: must be 7 numbers"),
        (DAVIS_IMU + "0.003 1 2 3 4 5 nan\n", "a.txt line 3: must be 7 numbers"),
        ("1e30 1 2 3 4 5 6\n", "a.txt line 1: .* out of range"),
    ],
)
def test_what_is_no_table_is_refused(text, told):
    with pytest.raises(DataError, match=told):
        parse_table(text, "a.txt", "imu")
