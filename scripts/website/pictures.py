"""Pictures of the effects: the same stimulus without an effect and with it, simulated and drawn.

A picture is made anew only if the program or this file has changed since.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from writing import load_pyplot, save_figure

import adv2e
from adv2e import load_config, simulate

ROWS, COLUMNS = 16, 24
FPS = 500
ON, OFF = "#c1272d", "#1f5fa8"

_ALWAYS = ("frames.encoding=linear", "pixel.log_response.linear_below=2.72")

Frames = np.ndarray
"""Linear light, 0 to 1, (frames, rows, columns)."""


def _light(level: Callable[[np.ndarray], np.ndarray], seconds: float = 0.3) -> Frames:
    """Return frames that are the same at every pixel: `level` [DN] of the time [s]."""
    times = np.arange(round(seconds * FPS)) / FPS
    frames = np.empty((len(times), ROWS, COLUMNS), np.float32)
    frames[:] = (level(times) / 255)[:, None, None]
    return frames


def constant(dn: float = 30.0) -> Frames:
    return _light(lambda t: np.full(len(t), dn))


def steps(low: float = 20.0, high: float = 80.0) -> Frames:
    return _light(lambda t: np.where((t > 0.1) & (t < 0.2), high, low))


def ramp(low: float = 5.0, high: float = 200.0) -> Frames:
    return _light(lambda t: low * (high / low) ** (t / t[-1]))


def from_black() -> Frames:
    return _light(lambda t: 40 * t / t[-1])


def wave(mean: float = 60.0, hertz: float = 10.0) -> Frames:
    return _light(lambda t: mean * np.exp(0.8 * np.sin(2 * np.pi * hertz * t)))


def slow_then_fast() -> Frames:
    return _light(lambda t: 20 * np.where(t < 0.2, 1 + 10 * t, np.where(t < 0.25, 9.0, 3.0)))


def bar(blur_s: float = 0.0) -> Frames:
    """Return a bright bar that moves to the right, as a camera with an exposure sees it."""
    frames, inside = np.zeros((60, ROWS, COLUMNS), np.float32), 40
    x = (np.arange(COLUMNS * 8) + 0.5) / 8
    for k in range(len(frames)):
        for j in range(inside):
            left = 150.0 * (k / FPS + blur_s * ((j + 0.5) / inside - 0.5)) - 2
            row = np.where((x > left) & (x < left + 6), 150.0, 30.0)
            frames[k] += row.reshape(COLUMNS, 8).mean(1) / inside / 255
    return frames


def blurred_bar() -> Frames:
    return bar(0.03)


@dataclass(frozen=True)
class Shown:
    """How an effect is shown.

    Attributes
    ----------
    stimulus : function
    sets : tuple of str
        What switches the effect on, as of ``--set``.
    drawn : {'times', 'path', 'picture'}
        A line for each pixel against the time; the column against the time; counts of a pixel.
    caption : str
        What is to be seen.
    both : tuple of str
        Set without the effect, too.
    """

    stimulus: Callable[[], Frames]
    sets: tuple[str, ...]
    drawn: str
    caption: str
    both: tuple[str, ...] = ()


SHOWN = {
    "encoding": Shown(
        ramp, ("frames.encoding=srgb",), "times",
        "The same numbers, taken as linear light and as sRGB. As sRGB, they mean more contrast.",
    ),
    "clock_drift": Shown(
        wave, ("frames.clock_drift_ppm=2e5",), "times",
        "A clock that is slow by a fifth, which is far too much: events come later and later.",
    ),
    "clock_offset": Shown(
        wave, ("frames.clock_offset_us=2e4",), "times", "All events come 20 ms later.",
    ),
    "black_level": Shown(
        lambda: wave(4.0), ("frames.black_level_dn=10",), "times",
        "10 DN more light in the dark: less contrast, and fewer events.",
    ),
    "exposure_blur": Shown(
        blurred_bar, ("frames.exposure_us=3e4",), "path",
        "A bar that frames of 30 ms exposure have blurred. With the effect, its edges are narrower."
        " A few events beside them are wrong.",
    ),
    "misregistration": Shown(
        bar, ("frames.shift_px=[5,3]",), "path",
        "The event pixels see the bar 5 columns further left than the frames show it.",
    ),
    "flicker": Shown(
        constant, ("frames.flicker.frequency_hz=20", "frames.flicker.depth=0.4"), "times",
        "A lamp at 20 Hz, so slow to be seen here, before constant frames.",
    ),
    "dark_current": Shown(
        lambda: wave(8.0), ("pixel.dark_current.dn=8",), "times",
        "A constant light of 8 DN beside 8 DN of the scene: half the contrast.",
    ),
    "log_response": Shown(
        from_black, ("pixel.log_response.linear_below=20",), "times",
        "Light that rises from black, before a logarithm everywhere and before one with a linear"
        " foot below 20 DN.",
        ("pixel.log_response.linear_below=0",),
    ),
    "photoreceptor_noise": Shown(
        constant, ("pixel.photoreceptor_noise.rms=0.1",), "times",
        "Constant light: all events are noise.", ("pixel.low_pass.cutoff_hz=300",),
    ),
    "low_pass": Shown(
        steps, ("pixel.low_pass.cutoff_hz=30", "pixel.low_pass.dark_cutoff_hz=3"), "times",
        "The step up and the step down reach the comparator late, and later in the dark.",
    ),
    "slew_limit": Shown(
        steps, ("pixel.slew_limit.per_s=50",), "times", "The signal needs 28 ms for each step.",
        ("pixel.low_pass.cutoff_hz=1000", "pixel.low_pass.dark_cutoff_hz=1000"),
    ),
    "source_follower": Shown(
        steps, ("pixel.source_follower.cutoff_hz=20",), "times",
        "A pole at 20 Hz delays both steps alike, whatever the light.",
    ),
    "high_pass": Shown(
        slow_then_fast, ("pixel.high_pass.cutoff_hz=5",), "times",
        "The slow rise is forgotten. After each step, events of the other polarity follow.",
    ),
    "initial_reference": Shown(
        ramp, ("pixel.initial_reference=random",), "times",
        "Each pixel begins somewhere between its thresholds, so first events do not come together.",
    ),
    "thresholds": Shown(
        ramp, ("pixel.thresholds.mismatch=0.05",), "times",
        "Every pixel has thresholds of its own.",
    ),
    "threshold_drift": Shown(
        ramp, ("pixel.thresholds.drift_per_s=4",), "times",
        "Thresholds that grow by 400 % a second, far too fast: fewer and fewer events.",
    ),
    "refractory": Shown(
        ramp, ("pixel.refractory.period_us=3e4",), "times",
        "After each event the pixel is dead for 30 ms. What changes meanwhile is lost.",
    ),
    "reset_overshoot": Shown(
        ramp, ("pixel.reset_overshoot.fraction=0.5",), "times",
        "Each new reference lies half a threshold beyond the signal, so the next event is later.",
        ("pixel.refractory.period_us=100",),
    ),
    "leak": Shown(
        constant, ("pixel.leak.rate_hz=20",), "times",
        "Constant light: each pixel sends ON events in its own rhythm.",
        ("pixel.initial_reference=random",),
    ),
    "shot_noise": Shown(
        constant, ("pixel.shot_noise.rate_hz=10",), "times",
        "Constant light: ON and OFF events at random.",
    ),
    "hot_pixels": Shown(
        bar, ("pixel.hot_pixels.fraction=0.03", "pixel.hot_pixels.rate_hz=200"), "picture",
        "Events a pixel while a bar passes. A few pixels fire by themselves.",
    ),
    "dead_pixels": Shown(
        bar, ("pixel.dead_pixels.fraction=0.1",), "picture",
        "Events a pixel while a bar passes. A tenth of the pixels is silent.",
    ),
    "frame_coupling": Shown(
        constant,
        (
            "readout.frame_coupling.amplitude=0.5", "readout.frame_coupling.tau_us=1e4",
            "readout.frame_coupling.period_us=1e5",
        ), "times",
        "Constant light: each readout of a frame, every 100 ms, makes events.",
    ),
    "readout": Shown(
        steps, ("readout.arbiter.event_ns=2e4", "readout.arbiter.row_ns=5e5"), "times",
        "All pixels want to be read out at once. The slow readout spreads them over milliseconds.",
    ),
    "double_read": Shown(
        bar, ("readout.double_read.on=0.3", "readout.double_read.off=0.3"), "picture",
        "Events a pixel while a bar passes. Three in ten come twice.",
    ),
    "event_loss": Shown(
        bar, ("readout.loss.fraction=0.4",), "picture",
        "Events a pixel while a bar passes. Four in ten are lost.",
    ),
    "timestamp_tick": Shown(
        ramp, ("readout.tick_us=2e4",), "times", "A clock with ticks of 20 ms.",
        ("pixel.thresholds.mismatch=0.05",),
    ),
}  # fmt: skip
"""How each effect is shown, by its name."""


def events_of(shown: Shown, sets: Sequence[str]) -> np.ndarray:
    """Return the events of a stimulus, before the ideal pixel with `sets`."""
    config = load_config("ideal", [*_ALWAYS, *shown.both, *sets])
    return np.concatenate(list(simulate(shown.stimulus(), fps=FPS, config=config, seed=3)))


@cache
def state_of_the_program() -> str:
    """Return a digest of all that a picture depends on."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted(Path(adv2e.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def make_picture(name: str, path: Path) -> None:
    """Draw an effect, unless that is done."""
    stamp = path.with_suffix(".made")
    if path.exists() and stamp.exists() and stamp.read_text("ascii") == state_of_the_program():
        return
    shown = SHOWN[name]
    path.parent.mkdir(parents=True, exist_ok=True)
    draw(shown, events_of(shown, ()), events_of(shown, shown.sets), path)
    stamp.write_text(state_of_the_program(), "ascii")


def draw(shown: Shown, without: np.ndarray, with_it: np.ndarray, path: Path) -> None:
    pyplot = load_pyplot()
    pyplot.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    seconds = len(frames := shown.stimulus()) / FPS
    figure, axes = pyplot.subplots(1, 2, figsize=(7.2, 2.6), sharex=True, sharey=True)
    sets = "\n".join(shown.sets)
    for part, events, title in zip(
        axes, (without, with_it), ("without", f"with {sets}"), strict=True
    ):
        part.set_title(f"{title}", fontsize=8, loc="left")
        if shown.drawn == "picture":
            counts = np.zeros((ROWS, COLUMNS), int)
            np.add.at(counts, (events["y"], events["x"]), 1)
            image = part.imshow(
                counts, cmap="viridis", vmin=0, vmax=max(4, _most(without, with_it))
            )
            part.set_xlabel("column")
            continue
        if shown.drawn == "times":
            light = part.twinx()
            light.plot(np.arange(len(frames)) / FPS * 1e3, 255 * frames[:, 0, 0], color="0.6", lw=1)
            light.set_ylim(0, None)
            light.tick_params(colors="0.5")
            if part is axes[1]:
                light.set_ylabel("light [DN]", color="0.5")
            else:
                light.set_yticklabels([])
            part.set_zorder(light.get_zorder() + 1)
            part.patch.set_visible(False)
        height = events["y"].astype(int) * COLUMNS + events["x"]
        for polarity, colour in ((1, ON), (0, OFF)):
            chosen = events["p"] == polarity
            where = events["x"] if shown.drawn == "path" else height
            part.plot(events["t"][chosen] / 1e3, where[chosen], ".", color=colour, ms=2.4, mew=0)
        part.set_xlabel("time [ms]")
        part.set_xlim(0, max(seconds * 1e3, 1))
        part.set_ylim(-1, COLUMNS if shown.drawn == "path" else ROWS * COLUMNS)
    axes[0].set_ylabel({"times": "pixel", "path": "column", "picture": "row"}[shown.drawn])
    figure.tight_layout()
    if shown.drawn == "picture":
        figure.colorbar(image, ax=axes, label="events", shrink=0.8)
    save_figure(figure, path)


def _most(*streams: np.ndarray) -> int:
    """Return a count of events that few pixels have more of."""
    counts = [np.bincount(e["y"].astype(int) * COLUMNS + e["x"]) for e in streams if len(e)]
    return int(max((np.percentile(one, 98) for one in counts), default=1))
