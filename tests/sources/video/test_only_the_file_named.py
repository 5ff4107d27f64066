"""Nothing but the file that was named is opened: texts that name others are no videos."""

from __future__ import annotations

import http.server
import json
import shutil
import threading

import av
import cv2
import numpy as np
import pytest
from video_files import pictures, written

from adv2e.errors import DataError
from adv2e.sources import VIDEO_SUFFIXES, open_source
from adv2e.sources.video.opening import FORMATS


@pytest.fixture
def asked():
    """Serve nothing on this machine, and note what is asked for: (addresses asked, port)."""
    found = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            found.append(self.path)
            self.send_error(404)

        def log_message(self, *_):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield found, server.server_port
        server.shutdown()
        thread.join()


PLAYLIST = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{}\n#EXT-X-ENDLIST\n"
TEXTS = {
    "concat": "ffconcat version 1.0\nfile 'private.avi'\n",
    "hls": PLAYLIST.format("private.ts"),
    "hls of an address": PLAYLIST.format("http://127.0.0.1:PORT/private.ts"),
    "dash": '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011" type="static"><Period>'
    '<AdaptationSet mimeType="video/mp4"><Representation id="1" bandwidth="1">'
    "<BaseURL>http://127.0.0.1:PORT/private.mp4</BaseURL>"
    "</Representation></AdaptationSet></Period></MPD>",
    "sdp": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\n"
    "m=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
    "lavfi": "testsrc\n",
}


@pytest.mark.parametrize("kind", TEXTS)
@pytest.mark.quick_cases(1)
def test_texts_that_name_others_are_no_videos(tmp_path, monkeypatch, kind, asked):
    requests, port = asked
    monkeypatch.chdir(tmp_path)
    for name in ("private.avi", "private.ts", "private.mp4"):
        written(tmp_path / name, "mpeg4", 25)
    for suffix in VIDEO_SUFFIXES:
        path = tmp_path / f"clip{suffix}"
        path.write_text(TEXTS[kind].replace("PORT", str(port)))
        with pytest.raises(DataError, match="not a video") as caught:
            open_source(path)
        assert "\n" not in str(caught.value)
    assert requests == []


@pytest.mark.parametrize("name", ["a%03d.png.mp4", "a%03d.mp4", "http:x.mp4", "pipe:0.mp4"])
def test_names_that_look_like_others_are_names(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for n in range(3):
        cv2.imwrite(f"a{n:03d}.png", np.zeros((8, 8, 3), np.uint8))
    plain = written(tmp_path / "plain.mp4", "mpeg4", 25)
    try:
        shutil.copy(plain, name)
    except OSError:
        pytest.skip("the file system does not allow this name")
    for path in (name, tmp_path / name):
        source = open_source(path)
        assert (source.width, source.height, len(list(source.frames()))) == (64, 48, 36)


def test_formats_are_known_to_ffmpeg():
    known = {part for name in av.formats_available for part in name.split(",")}
    assert set(FORMATS) <= known


def animated(path, codec, kind):
    with av.open(str(path), "w", format=kind) as film:
        stream = film.add_stream(codec, rate=25)
        stream.width, stream.height = 64, 48
        stream.pix_fmt = "rgb24" if codec == "apng" else "yuv420p"
        for n, image in enumerate(pictures(5)):
            frame = av.VideoFrame.from_ndarray(image, "rgb24")
            frame.pts = n
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("name", ["clip.apng", "clip.png"])
def test_animated_png_is_a_film(tmp_path, name):
    source = open_source(animated(tmp_path / name, "apng", "apng"))
    frames = list(source.frames())
    assert (source.kind, source.width, source.height, len(frames)) == ("video", 64, 48, 5)
    assert [frame.t_ns for frame in frames] == [40_000_000 * n for n in range(5)]
    assert all(np.array_equal(f.image, g) for f, g in zip(frames, pictures(5), strict=True))


def test_info_takes_an_animated_png_for_what_convert_does(adv2e, tmp_path):
    path = animated(tmp_path / "clip.png", "apng", "apng")
    told = json.loads(adv2e("info", path, "--json").out)
    assert told["frames"]["count"] == len(list(open_source(path).frames()))
    cv2.imwrite(str(tmp_path / "still.png"), np.zeros((4, 4), np.uint8))
    outcome = adv2e("info", tmp_path / "still.png")
    assert (outcome.status, "a single picture makes no events" in outcome.err) == (1, True)


def test_animated_webp_is_refused(tmp_path):
    path = animated(tmp_path / "clip.webp", "libwebp_anim", "webp")
    with pytest.raises(DataError, match=r"clip\.webp: animated WebP is not read"):
        open_source(path)


@pytest.mark.parametrize(("codec", "kind"), [("apng", "apng"), ("libwebp_anim", "webp")])
def test_animated_pictures_are_no_frames_of_a_folder(tmp_path, codec, kind):
    suffix = "png" if kind == "apng" else "webp"
    for n in range(3):
        animated(tmp_path / f"{n}.{suffix}", codec, kind)
    with pytest.raises(DataError, match=r"0\..*: 5 pictures in it; give each frame a file"):
        list(open_source(tmp_path, fps=10).frames())
