import numpy as np
import pytest

from adv2e.events import make_events
from adv2e.files.backlog import Backlog


@pytest.mark.parametrize("limit", [0, 500, 1 << 20])
def test_arrays_come_out_as_they_went_in(tmp_path, limit):
    arrays = [np.full((k % 3, 5), k, np.uint16) for k in range(40)]
    arrays.append(make_events([1, 2], [3, 4], [5, 6], [0, 1]))
    waiting = Backlog(tmp_path, limit)
    for time, array in enumerate(arrays):
        waiting.append(time, array)
    arrays[5][:] = 0  # of its owner, who may use it again
    waiting.drop()
    assert (len(waiting), waiting.time(0), waiting.time(1)) == (40, 1, 2)
    for k, array in enumerate(arrays[1:], 1):
        found = waiting.take()
        assert found.dtype == array.dtype
        assert np.array_equal(found, np.full((2, 5), 5) if k == 5 else array)
    waiting.close()


def test_the_disk_is_given_back_when_nothing_waits_there(tmp_path):
    waiting = Backlog(tmp_path, limit=1000)
    for time in range(20):
        waiting.append(time, np.zeros(900, np.uint8))
    size = waiting._file.seek(0, 2)
    for _ in range(20):
        waiting.take()
    assert size == 19 * 900
    assert waiting._file.seek(0, 2) == 0
    waiting.close()
    assert list(tmp_path.iterdir()) == []
