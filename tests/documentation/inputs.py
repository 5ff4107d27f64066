"""What the commands of a document find in their folder: small files under the text's names.

A recording here has so few pixels and frames that a diagnosis of it takes seconds.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
import onnx_models
from camera import Camera, patchwork
from camera.catalogue import cases
from pictures import picture

from adv2e.config import load_config
from adv2e.conversion.demo import run_demo
from adv2e.events import make_events
from adv2e.formats.writing import open_sink
from adv2e.synthetic import Scene
from adv2e.synthetic.scene import write_video

FRAMES = 12


def video(path: Path) -> None:
    """Make a film of the demonstration's scene."""
    write_video(Scene(), path, width=32, height=24, duration_s=FRAMES / 30.0)


def videos(path: Path) -> None:
    """Make a folder of films."""
    path.mkdir()
    for name in ("one.mp4", "two.mp4"):
        video(path / name)


def stills(path: Path) -> None:
    """Make folders of pictures, one for each class."""
    for number, name in enumerate(("cat/a", "cat/b", "dog/a", "dog/b")):
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path / f"{name}.png"), picture(number))


def images(path: Path) -> None:
    """Make a folder of images."""
    path.mkdir()
    for k in range(FRAMES):
        cv2.imwrite(str(path / f"frame_{k:04d}.png"), picture(k))


def photo(path: Path) -> None:
    """Make a picture."""
    cv2.imwrite(str(path), np.kron(picture(3), np.ones((2, 2), np.uint8)))


def network(path: Path) -> None:
    """Write a network that makes the frame between two."""
    onnx_models.blend_stacked(path)


def listed_images(path: Path) -> None:
    """Make a folder with lists of times and names, and the images in a folder below it."""
    path.mkdir()
    images(path / "rgb")
    lines = "".join(f"{1e9 + k / 30:.6f} rgb/frame_{k:04d}.png\n" for k in range(FRAMES))
    (path / "images.txt").write_text(lines, "ascii")
    (path / "rgb.txt").write_text(f"# color images\n# timestamp filename\n{lines}", "ascii")


def times(path: Path) -> None:
    """Make a list of times of the images of `images`."""
    path.write_text("".join(f"{k / 240:.6f}\n" for k in range(FRAMES)), "ascii")


def stack(path: Path) -> None:
    """Make a file of NumPy."""
    np.save(path, np.stack([picture(k) for k in range(FRAMES)]))


def recording(path: Path) -> None:
    """Make a recording with too long a dead time, and what is declared of it."""
    _record("refractory", path)


def demonstration(path: Path) -> None:
    """Make what ``scripts/demo`` makes: a clip and its events, a recording, what is declared."""
    run_demo(path, load_config())


def echoing(path: Path) -> None:
    """Make a recording with events that come twice, and what is declared of it."""
    _record("echo", path)


def _record(effect: str, path: Path) -> None:
    size = (24, 16)
    Camera(
        patchwork(size, seed=4), hidden=next(cases(effect, size="large")).hidden, size=size,
        duration_s=0.2, fps=300.0, seed=4, step_us=50.0,
    ).record(path)  # fmt: skip
    shutil.copy(path.with_suffix(".declared.yaml"), path.with_name("declared.yaml"))


def recordings(path: Path) -> None:
    """Make a folder of a dozen recordings of events."""
    path.mkdir()
    draw = np.random.default_rng(len(path.name))
    for number in range(12):
        t = np.sort(draw.integers(0, 100_000, 400))
        x, y, p = (draw.integers(0, most, 400) for most in (8, 6, 2))
        with open_sink(path / f"{number:03d}.npz", width=8, height=6, metadata={}) as sink:
            sink.write_events(make_events(t, x, y, p))


def latencies(path: Path) -> None:
    """Make a table of latencies of two cameras."""
    head = "camera,bias,polarity,irradiance_W_m2,latency_us,latency_error_us\n"
    rows = (
        f"CAM{camera},0,{polarity},{light},{1.0 / light + 30.0 + camera:.1f},2\n"
        for camera in (1, 2)
        for polarity in ("ON", "OFF")
        for light in (0.005, 0.05, 0.4)
    )
    path.write_text(head + "".join(rows), "ascii")


def noise_rates(path: Path) -> None:
    """Make a table of rates of noise."""
    rows = ("0.1,7.0,5.0,2500,8.2", "161,0.14,0.004,2500,17.4", "3000,0.23,0.001,2500,19.9")
    head = "illuminance_lux,on_rate_hz,off_rate_hz,pixels,duration_s"
    path.write_text("\n".join([head, *rows, ""]), "ascii")


INPUTS: dict[str, Callable[[Path], None]] = {
    "demo/": demonstration,
    "clip.mp4": video,
    "phone.mp4": video,
    "videos/": videos,
    "stills/": stills,
    "frames/": images,
    "sequence/": listed_images,
    "photo.png": photo,
    "rife.onnx": network,
    "times.txt": times,
    "clip.npy": stack,
    "recording.zip": recording,
    "echo.zip": echoing,
    "real/": recordings,
    "made/": recordings,
    "latency.csv": latencies,
    "noise.csv": noise_rates,
}
"""What may be named by any document, and what makes it."""


def make_inputs(folder: Path, texts: Iterable[str]) -> None:
    """Put into `folder` what `texts` name."""
    text = "\n".join(texts)
    for name, make in INPUTS.items():
        end = "" if name.endswith("/") else r"(?![\w.-])"
        if re.search(rf"(?<![\w./-]){re.escape(name)}{end}", text):
            make(folder / name)
