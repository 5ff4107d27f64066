"""What the stamps of coded pictures say, as OpenCV gives them."""

from __future__ import annotations

from adv2e.sources.video.packets import Jump, arranged, read_packets

MS = 10**6


def test_pictures_in_the_order_of_decoding_are_sorted():
    found = arranged([0, 120 * MS, 40 * MS, 80 * MS], tiny=1)
    assert found.known_ns == [0, 40 * MS, 80 * MS, 120 * MS]
    assert (found.count, found.complete, found.tiny, found.back) == (4, True, 1, None)


def test_pictures_without_times_are_not_taken_to_be_at_zero():
    found = arranged([0, 0, 0, 0, 160 * MS, 0])
    assert found.known_ns == [0, 160 * MS]
    assert (found.count, found.complete, found.back) == (6, False, None)


def test_times_that_begin_again_are_found_where_they_do():
    step = 40 * MS
    times = [n * step for n in range(30)]
    found = arranged(times + times)
    assert found.back == Jump(30, 29 * step, 0)
    assert not found.complete
    late = [t + 10**12 for t in times]
    assert arranged(late + times).back == Jump(30, late[-1], 0)
    assert arranged(times + late).back is None  # a gap
    wrapped = [t + (2**33 * 10**5 // 9) - 10**9 for t in times]
    assert arranged(times + wrapped).back == Jump(30, times[-1], wrapped[0])


def test_no_pictures():
    found = arranged([])
    assert (found.count, found.known_ns, found.complete, found.back) == (0, [], False, None)


def test_pictures_of_a_file_are_counted(write_video, picture, tmp_path):
    path = write_video("clip.avi", [picture(n, (32, 32, 3)) for n in range(7)], 25, "mp4v")
    stream, found = read_packets(str(path), 32, listed=False)
    assert (stream.codec, stream.clear, stream.interlaced) == ("MPEG-4", True, False)
    assert found.known_ns == [40 * MS * n for n in range(7)]
    assert (found.count, found.complete) == (7, True)
    (tmp_path / "none.avi").write_bytes(b"nothing")
    assert read_packets(str(tmp_path / "none.avi"), 0, listed=False)[1].count == 0
    assert read_packets(str(path), 32, listed=True) == (stream, None)
