"""What is measured: settings of adv2e and of other tools, each on a clip."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.clips import Clip, as_srgb, stored
from benchmarks.processes import Job

THRESHOLD = 0.2
CUTOFF_HZ = 300.0
KNEE_DN = 20.0
SHIPPED_KNEE_DN = 2.72

IDEAL = (
    "frames.encoding=linear",
    "sampling.L=1",
    f"pixel.log_response.linear_below={KNEE_DN:g}",  # frames have 8 bits
    f"pixel.thresholds={{on: {THRESHOLD:g}, off: {THRESHOLD:g}, mismatch: 0}}",
    f"pixel.low_pass={{cutoff_hz: {CUTOFF_HZ:g}, dark_cutoff_hz: 21.8}}",
    "pixel.refractory=null",
    "pixel.leak=null",
    "pixel.shot_noise=null",
    "pixel.initial_reference=settled",
)
"""The pixel of every setting, without noise; the settings add to it."""

MISMATCH = ("pixel.thresholds.mismatch=0.03",)
LEAK = ("pixel.leak={rate_hz: 0.1, jitter: 0}",)
JITTER = ("pixel.leak.jitter=0.1",)
DEAD_TIME = ("pixel.refractory.period_us=500",)
SHOT = ("pixel.shot_noise.rate_hz=5",)
SHOT_WEAK = ("pixel.shot_noise.rate_hz=0.1",)
ALL = (*MISMATCH, *LEAK, *DEAD_TIME, *SHOT)
ALL_WEAK = (*MISMATCH, *LEAK, *DEAD_TIME, *SHOT_WEAK)
POLES_HZ = 300, 1000, 10_000
POLE = "pixel.source_follower.cutoff_hz=1000"
NOISE = "pixel.photoreceptor_noise.rms=0.03"
TWO_POLES = (
    "pixel.dark_current.dn=10",
    "pixel.low_pass={cutoff_hz: 2200, dark_cutoff_hz: 0.1}",
    "pixel.source_follower.cutoff_hz=100",
)
"""What still pixels of a DAVIS346 say; see configs/davis346.yaml."""
MEASURED_NOISE = "pixel.photoreceptor_noise.rms=0.055"

EVERYTHING = (
    *ALL,
    "pixel.initial_reference=random",
    "pixel.leak={rate_hz: 0.1, photo_rate_hz: 0.1, jitter: 0.1}",
    "pixel.photoreceptor_noise.rms=0.03",
    "pixel.source_follower.cutoff_hz=1000",
    "pixel.hot_pixels={fraction: 0.01, rate_hz: 10}",
)
"""All effects there are."""

OFF_NAME = "exact, noise off"
"""The setting that others are compared with."""

AT_REST = "346x260, 9/10 at rest"
CAMERAS = {
    "240x180": Clip(width=240, height=180, frames=480),
    "346x260": Clip(width=346, height=260, frames=480),
    "1280x720": Clip(width=1280, height=720, frames=97),
    AT_REST: Clip(width=346, height=260, frames=1920, moving=0.1),
}
"""Clips by name."""


def stepped(form: str, K: int) -> tuple[str, ...]:
    """Return what chooses a form of the filter that takes K steps a frame."""
    return (f"pixel.low_pass.update={form}", f"sampling.K={K}")


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A configuration of adv2e on a clip.

    Attributes
    ----------
    name, clip : str
        What the table calls it; one of :data:`CAMERAS`.
    sets : tuple of str
        What it adds to :data:`IDEAL`.
    share : float
        Share of the clip's frames, for slow ones.
    stride : int
        Every how many frames are taken.
    """

    name: str
    clip: str
    sets: tuple[str, ...] = ()
    share: float = 1.0
    stride: int = 1


def settings() -> Iterator[Setting]:
    """Yield all settings of adv2e."""
    main = {
        OFF_NAME: (),
        "all effects, shot 5 Hz": ALL,
        "all effects, shot 0.1 Hz": ALL_WEAK,
    }
    for clip in CAMERAS:
        for name, sets in main.items():
            yield Setting(name=name, clip=clip, sets=sets)
        for name, sets in main.items():
            # pixels that pass the knee between two frames are solved one by one: few at this one
            shipped = (*sets, f"pixel.log_response.linear_below={SHIPPED_KNEE_DN:g}")
            yield Setting(name=f"knee 2.72: {name}", clip=clip, sets=shipped)
    one = "346x260"
    alone = {
        "mismatch 0.03": MISMATCH,
        "leak 0.1 Hz": LEAK,
        "dead time 0.5 ms": DEAD_TIME,
        "shot 5 Hz": SHOT,
        "all effects, shot 0.1 Hz, jitter of the leak": (*ALL_WEAK, *JITTER),
        "exact, K = 1": stepped("exact", 1),
        "exact, K = 100": stepped("exact", 100),
    }
    for name, sets in alone.items():
        yield Setting(name=name, clip=one, sets=sets)
    for form in ("first_order_hold", "paper"):
        for K, share in ((1, 1.0), (10, 0.5), (100, 0.1)):
            yield Setting(name=f"{form}, K = {K}", clip=one, sets=stepped(form, K), share=share)
    cascade = {
        **{f"second pole {hz} Hz": (f"pixel.source_follower.cutoff_hz={hz}",) for hz in POLES_HZ},
        "overshoot 0.1": ("pixel.reset_overshoot.fraction=0.1",),
        "second pole 1000 Hz, all effects, shot 0.1 Hz": (*ALL_WEAK, POLE),
    }
    for name, sets in cascade.items():
        yield Setting(name=name, clip=one, sets=sets)
    noisy = {
        "photoreceptor noise 0.03": (NOISE,),
        "photoreceptor noise 0.03, second pole 1000 Hz": (NOISE, POLE),
        "two poles as measured": TWO_POLES,
        "two poles and noise as measured": (*TWO_POLES, MEASURED_NOISE),
    }
    for name, sets in noisy.items():
        yield Setting(name=name, clip=one, sets=sets)
        yield Setting(name=name, clip=AT_REST, sets=sets, share=0.25)
    shipped = f"pixel.log_response.linear_below={SHIPPED_KNEE_DN:g}"
    decoded = ("frames.encoding=srgb", shipped, "sampling.L=10")
    yield Setting(name="sRGB decoded, L = 10, noise off", clip=one, sets=decoded, stride=10)


@dataclass(frozen=True)
class Peers:
    """Where other tools are: their Python, which tools it has, and v2e's sources."""

    python: str
    tools: tuple[str, ...]
    v2e: Path | None = None


def peer_arguments(peers: Peers, threads: int | None) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield (name, tool, options) of the other tools, set as nearly alike as they can be."""
    quiet = {"sigma_thres": 0.0, "leak_rate_hz": 0.0, "shot_noise_rate_hz": 0.0}
    noisy = {"sigma_thres": 0.03, "leak_rate_hz": 0.1, "shot_noise_rate_hz": 5.0}
    both = {"pos_thres": THRESHOLD, "neg_thres": THRESHOLD, "cutoff_hz": CUTOFF_HZ}
    if "eventcv" in peers.tools:
        for steps in ("off", "10", "adaptive"):
            given = {**both, **quiet, "refractory_us": 0, "upsample": steps}
            yield f"EventCV, sub-steps {steps}, noise off", "eventcv", {"arguments": given}
        given = {**both, **noisy, "refractory_us": 500, "upsample": "10"}
        yield "EventCV, sub-steps 10, all effects", "eventcv", {"arguments": given}
    if "evlib" in peers.tools:
        levels = {"positive_threshold": THRESHOLD, "negative_threshold": THRESHOLD}
        given = {**levels, "refractory_period_ms": 0.0}
        yield "evlib ESIM, no filter", "evlib", {"arguments": given, "threads": threads}
    if peers.v2e is not None:
        folder = {"folder": str(peers.v2e), "threads": threads}
        clean = {**both, **quiet, "sigma_thres": 1e-4}  # with 0 its emulator stops
        yield "v2e, noise off", "v2e", {**folder, "arguments": clean}
        given = {**both, **noisy, "refractory_period_s": 500e-6}
        yield "v2e, all effects", "v2e", {**folder, "arguments": given}


@dataclass(frozen=True)
class Plan:
    """How jobs are made: folder of the clips, length, threads, rounds."""

    folder: Path
    quick: bool
    threads: int | None
    rounds: int = 1

    def job(self, name: str, clip: Clip, sets: Sequence[str], **more: Any) -> Job:
        """Return the job of a clip and of what is added to the ideal pixel."""
        threads = more.setdefault("threads", self.threads)
        options = {"sets": [*IDEAL, *sets], "threads": threads}
        path = str(stored(clip, self.folder))
        return Job(name=name, clip=path, fps=clip.fps, options=options, **more)

    def clip(self, name: str) -> Clip:
        """Return the clip of that name, in quick mode a short one."""
        clip = CAMERAS[name]
        return replace(clip, frames=25 if clip.width > 400 else 49) if self.quick else clip

    def warm(self) -> list[Job]:
        """Return short jobs that compile all there is."""
        clip = Clip(width=64, height=48, frames=8)
        pixels = {"every effect": EVERYTHING, "the exact circuit": ALL}
        return [self.job(name, clip, sets) for name, sets in pixels.items()]

    def jobs(self) -> Iterator[Job]:
        """Yield the jobs of adv2e."""
        for setting in settings():
            clip = self.clip(setting.clip)
            frames = max(8, round(setting.share * clip.frames / setting.stride))
            name = f"{setting.clip}: {setting.name}"
            yield self.job(name, clip, setting.sets, frames=frames, stride=setting.stride)

    def peer_jobs(self, peers: Peers) -> Iterator[Job]:
        """Yield the jobs of the other tools, on frames in memory."""
        for camera in ("346x260", "1280x720"):
            path = stored(self.clip(camera), self.folder)
            for name, tool, options in peer_arguments(peers, self.threads):
                yield Job(
                    name=f"{camera}: {name}",
                    tool=tool,
                    python=peers.python,
                    clip=str(as_srgb(path) if tool == "eventcv" else path),
                    options=options,
                    threads=self.threads,
                )
