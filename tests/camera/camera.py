"""The camera: a scene in, events and frames out.

Example
-------
>>> from camera import Camera, patchwork
>>> scene = patchwork((64, 48), seed=3)
>>> camera = Camera(scene, hidden={"pixel": {"refractory": {"period_us": 5000.0}}}, seed=3)
>>> camera.record("recording.zip")  # doctest: +SKIP
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from camera.comparator import Comparator, Moment, Rules
from camera.drive import drive_stages
from camera.injected import FALL_AT_WHITE, Candidates, dead_pixels, draw_candidates
from camera.light import flicker, light_stages
from camera.photoreceptor import Photoreceptor, corner_of, frame_coupling, gain_of
from camera.readout import Stream, read_out
from camera.recording import members, write
from camera.running import Running, run_before
from camera.scene import AnyScene
from camera.settings import BENCH, Settings, check, find, merged
from camera.shutter import Frame, frames_of
from camera.thresholds import factor_in_time, levels

Array = NDArray[np.float64]

_BLOCK = 24  # steps of light made at once


class Camera:
    """An event camera with a frame camera on the same lens.

    Parameters
    ----------
    scene : AnyScene
    declared : mapping
        What is known of the camera, in the keys of the package's configuration.
    hidden : mapping
        What is not known: laid over `declared`.
    size : (width, height)
    duration_s, fps : float
        Length of the recording and rate of its frames.  The first frame is at 0, the last at the
        end.
    seed : int
        Of everything random.
    step_us : float
        Time step.
    """

    def __init__(
        self,
        scene: AnyScene,
        declared: Settings = BENCH,
        *,
        hidden: Settings | None = None,
        size: tuple[int, int] = (64, 48),
        duration_s: float = 1.5,
        fps: float = 500.0,
        seed: int = 0,
        step_us: float = 25.0,
    ) -> None:
        self.scene, self.size, self.seed = scene, size, seed
        self.declared = merged(declared)
        self.truth = merged(declared, hidden or {})
        check(self.truth)
        self.steps = round(duration_s * 1e6 / step_us)
        self.step_s = step_us * 1e-6
        self.duration_s = self.steps * self.step_s
        self.frame_times = np.arange(int(np.floor(duration_s * fps + 1e-6)) + 1) / fps

    def random(self, purpose: str) -> np.random.Generator:
        """Return the random numbers for one `purpose`; others do not depend on them."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode())])

    def lamp(self, times: Array) -> Array:
        """Return the factor on the light at `times` [s] that the lamp makes."""
        frequency = find(self.truth, "frames.flicker.frequency_hz", 0.0)
        depth = find(self.truth, "frames.flicker.depth", 0.0)
        return flicker(frequency, depth, self.random("lamp").uniform(0, 2 * np.pi))(times)

    def frames(self) -> Iterator[Frame]:
        """Yield the frames."""
        return frames_of(self.scene, self.truth, self.size, self.frame_times, self.lamp)

    def events(self) -> Stream:
        """Return the events as they leave the camera, in the order of their stamps."""
        time, pixel, polarity = _Run(self).events()
        stream = Stream(time * self.step_s, pixel, polarity)
        return read_out(stream, self.truth, self.size[0], self.random)

    def record(self, path: str | Path) -> None:
        """Write the recording to `path`, a zip archive or a folder that does not exist yet.

        Beside it: ``<stem>.declared.yaml``, what is known of the camera, and ``<stem>.truth.yaml``,
        all of it.
        """
        path = Path(path)
        write(path, members(self.events(), self.frames(), self.size[0]))
        for name, settings in (("declared", self.declared), ("truth", self.truth)):
            text = yaml.safe_dump(_plain(settings), sort_keys=False)
            path.with_name(f"{path.stem}.{name}.yaml").write_text(text, "utf-8")


class _Run:
    """One run of all pixels over all steps."""

    def __init__(self, camera: Camera) -> None:
        width, height = camera.size
        truth, step_s = camera.truth, camera.step_s
        pixels = width * height
        self._truth, self._step_s, self._steps = truth, step_s, camera.steps
        self._view = camera.scene.view(np.arange(width) + 0.0, np.arange(height) + 0.0)
        self._stages = (
            light_stages(truth, step_s, camera.lamp),
            drive_stages(truth, step_s, camera.size, camera.random("columns")),
        )
        self._corner = corner_of(truth)
        self._middle = 0.5 if self._corner is not None else 1.0
        _, x = self._drive(np.zeros(1))
        self._poles = Photoreceptor(truth, x[0], step_s, camera.random("photoreceptor"))
        ends = np.arange(camera.steps + 1) * step_s
        self._disturbance = self._coupled(camera, ends)
        self._factor = factor_in_time(truth, ends)
        self._on, off = levels(truth, camera.size, camera.random("thresholds"))
        share = find(truth, "pixel.dead_pixels.fraction", 0.0)
        self._comparator = Comparator(
            self._on,
            off,
            self._first_reference(off, camera.random("reference")),
            dead_pixels(share, pixels, camera.random("dead")),
            self._rules(),
            camera.random("leak"),
            self._run_before(camera.random("before")),
        )
        self._noise = draw_candidates(truth, pixels, camera.duration_s, camera.random)

    def _drive(self, times: Array) -> tuple[Array, Array]:
        """Return light at the photodiodes and the drive at `times`, both (times, pixels)."""
        light = self._view.light(times)
        for stage in self._stages[0]:
            light = stage(times, light)
        x = light
        for stage in self._stages[1]:
            x = stage(times, x)
        return light, x

    def _coupled(self, camera: Camera, ends: Array) -> Array | None:
        amplitude = find(self._truth, "readout.frame_coupling.amplitude", 0.0)
        if not amplitude:
            return None
        exposure = find(self._truth, "frames.exposure_us", 0.0) * 1e-6
        tau = self._truth["readout"]["frame_coupling"]["tau_us"] * 1e-6
        delay = find(self._truth, "readout.frame_coupling.delay_us", 0.0) * 1e-6
        width = find(self._truth, "readout.frame_coupling.width_us", 0.0) * 1e-6
        period = find(self._truth, "readout.frame_coupling.period_us", 0.0) * 1e-6
        leaps = camera.frame_times + 0.5 * exposure + delay
        if period:  # another camera's frames, whatever was filmed
            leaps = np.arange(delay % period, camera.duration_s, period)
        disturbance = frame_coupling(amplitude, tau, leaps[leaps >= 0.0], ends)
        if width:
            disturbance -= frame_coupling(amplitude, tau, leaps[leaps >= 0.0] + width, ends)
        return disturbance

    def _first_reference(self, off: Array, rng: np.random.Generator) -> Array:
        """Return the signal; with ``random``, references about it, uniform between thresholds."""
        signal = self._poles.signal
        if find(self._truth, "pixel.initial_reference", "settled") != "random":
            return signal
        return signal - (rng.random(len(signal)) * (self._on + off) - off)

    def _run_before(self, rng: np.random.Generator) -> Running | None:
        """Return what leak has done before; only ``running`` knows."""
        light = self._drive(np.zeros(1))[0]
        leak = self._leak(light)
        if leak is None or find(self._truth, "pixel.initial_reference", "settled") != "running":
            return None
        leak_hz = np.broadcast_to(leak[0], self._on.shape) / self._step_s
        shot = find(self._truth, "pixel.shot_noise.rate_hz", 0.0)
        noise_hz = shot * (1.0 - FALL_AT_WHITE * light[0] / 255.0)
        # noise of the photoreceptor soon takes a pixel over the rest of the way
        rms = find(self._truth, "pixel.photoreceptor_noise.rms", 0.0)
        overshoot = self._rules().overshoot
        way = np.maximum(1.0 + overshoot - 3.0 * rms / self._on, 0.05)
        dead = find(self._truth, "pixel.refractory.period_us", 0.0) * 1e-6
        jitter = find(self._truth, "pixel.leak.jitter", 0.0)
        before = run_before(np.maximum(leak_hz, 1e-9), noise_hz, way, dead, jitter, rng)
        return before._replace(fallen=before.fallen - overshoot)

    def _rules(self) -> Rules:
        dead = find(self._truth, "pixel.refractory.period_us", 0.0) * 1e-6 / self._step_s
        return Rules(
            dead=(dead, dead * find(self._truth, "outside.off_dead_time.factor", 1.0)),
            overshoot=find(self._truth, "pixel.reset_overshoot.fraction", 0.0),
            leak_jitter=find(self._truth, "pixel.leak.jitter", 0.0),
        )

    def events(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
        """Run; return times [steps], pixels and polarities."""
        signal = self._poles.signal
        for start in range(0, self._steps, _BLOCK):
            numbers = np.arange(start, min(start + _BLOCK, self._steps))
            times = (numbers + self._middle) * self._step_s
            light, x = self._drive(times)
            gain = None
            if self._corner is not None:
                gain = gain_of(self._corner(times, light), self._step_s)
            leak = self._leak(light)
            noise = self._noise_of(numbers, light)
            for j, number in enumerate(numbers.tolist()):
                output = self._poles.advance(x[j], None if gain is None else gain[j])
                if self._disturbance is not None:
                    output = output + self._disturbance[number + 1]
                factor = None if self._factor is None else float(self._factor[number + 1])
                self._comparator.step(
                    number, signal, output, None if leak is None else leak[j], factor, noise[j]
                )
                signal = output
        return self._comparator.events()

    def _leak(self, light: Array) -> Array | None:
        """Return the leak events of each step and pixel at nominal speed."""
        constant = find(self._truth, "pixel.leak.rate_hz", 0.0) * self._step_s
        photo = find(self._truth, "pixel.leak.photo_rate_hz", 0.0) * self._step_s
        if not constant and not photo:
            return None
        if not photo:
            return np.full((len(light), 1), constant)
        return constant + photo / 255.0 * light

    def _noise_of(self, numbers: NDArray[np.int64], light: Array) -> list[Moment]:
        """Return the noise events that the light lets through, step by step."""
        noise: Candidates = self._noise
        ends = np.searchsorted(noise.time, np.append(numbers, numbers[-1] + 1) * self._step_s)
        result = []
        for j in range(len(numbers)):
            part = slice(int(ends[j]), int(ends[j + 1]))
            pixel = noise.pixel[part]
            kept = noise.draw[part] < 1.0 - noise.fall[part] * light[j, pixel] / 255.0
            fraction = np.clip(noise.time[part] / self._step_s - numbers[j], 0.0, 1.0)
            result.append(Moment(pixel[kept], fraction[kept], noise.polarity[part][kept]))
        return result


def _plain(value: Any) -> Any:
    """Return `value` with plain lists and numbers, as YAML writes them."""
    if isinstance(value, dict):
        return {key: _plain(below) for key, below in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(below) for below in value]
    return value.item() if isinstance(value, np.generic) else value
