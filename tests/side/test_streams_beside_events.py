"""What cameras' own files hold beside events and frames is named when they are converted."""

import h5py
import numpy as np
import pytest
from ddd_files import frame, imu, polarity, write_ddd
from streams import random_events

from adv2e import convert
from adv2e.formats.writing import write_events

CONFIG = ["ideal", {"frames": {"encoding": "linear"}}]
GREYS = [np.full((260, 346), level, np.uint16) for level in (9000, 9000, 30000)]


def told(source, output, config=CONFIG, **options):
    with pytest.warns() as warned:
        convert(source, output, config, overwrite=True, **options)
    return [line for line in (str(one.message) for one in warned) if "not carried" in line]


def test_ddd(tmp_path):
    path = tmp_path / "drive.hdf5"
    frames = [frame(1000 * (1 + 40 * n), grey) for n, grey in enumerate(GREYS)]
    write_ddd(path, [polarity([(900, 1, 1, 1)]), imu(), imu(), *frames])
    (line,) = told(path, tmp_path / "out.h5")
    assert line == f"{path}: not carried: IMU in dvs/data, vehicle_speed"
    assert not (tmp_path / "out.h5.side").exists()
    assert told(path, tmp_path / "out.h5", side="none") == []
    # and where its events are copied
    (line,) = told(path, tmp_path / "copied.h5", None, take="events")
    assert "IMU in dvs/data" in line


def test_mvsec(tmp_path):
    path = tmp_path / "drive.h5"
    write_events(tmp_path / "a.h5", random_events(1, 50), (346, 260))
    convert(tmp_path / "a.h5", path, layout="mvsec")
    with h5py.File(path, "a") as file:
        file["davis/left/imu"], file["davis/left/imu_ts"] = np.zeros((3, 6)), np.zeros(3)
        file["velodyne/scans"] = np.zeros(3)
    (line,) = told(path, tmp_path / "out.h5", None)
    assert line == f"{path}: not carried: davis/left/imu, davis/left/imu_ts, velodyne"


def test_aedat4(tmp_path):
    library = pytest.importorskip("dv_processing")
    path = tmp_path / "a.aedat4"
    config = library.io.MonoCameraWriter.Config("DAVIS346_sample")
    config.addEventStream((346, 260))
    config.addImuStream()
    writer = library.io.MonoCameraWriter(str(path), config)
    store = library.EventStore()
    for n in range(9):
        store.push_back(1000 + n, n, n, True)
    writer.writeEvents(store)
    del writer
    (line,) = told(path, tmp_path / "out.h5", None)
    assert line == f"{path}: not carried: imu (IMUS)"


def test_bag(tmp_path):
    pytest.importorskip("rosbags")
    from rosbags import rosbag1
    from rosbags.typesys import Stores, get_typestore

    path = tmp_path / "a.bag"
    write_events(path, random_events(1, 50), (346, 260))
    types = get_typestore(Stores.ROS1_NOETIC)
    text = types.types["std_msgs/msg/String"](data="a")
    with rosbag1.Reader(path) as old, rosbag1.Writer(tmp_path / "b.bag") as new:
        for connection, time, data in old.messages():
            kept = {one.topic: one for one in new.connections}
            topic = kept.get(connection.topic) or new.add_connection(
                *(connection.topic, connection.msgtype),
                msgdef=connection.msgdef.data,
                md5sum=connection.digest,
            )
            new.write(topic, time, data)
        topic = new.add_connection("/dvs/imu", "std_msgs/msg/String", typestore=types)
        new.write(topic, 1, types.serialize_ros1(text, "std_msgs/msg/String"))
    (line,) = told(tmp_path / "b.bag", tmp_path / "out.h5", None)
    assert line == f"{tmp_path / 'b.bag'}: not carried: /dvs/imu (std_msgs/msg/String)"
