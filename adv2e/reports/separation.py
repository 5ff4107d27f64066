"""What tells an effect from those that look like it: what to record when data cannot decide."""

from __future__ import annotations

SEPARATIONS = {
    "thresholds": "a scene that returns to where it began, at two contrasts: signed steps then sum"
    " to zero only with the right thresholds, at every speed and brightness",
    "threshold_mismatch": "two different textures: what stays at the same pixels is the sensor,"
    " what moves with the texture is the scene",
    "threshold_drift": "the same motion early and late in a long recording",
    "low_pass": "the same motion in bright and dim light: its lag falls with the light, and so"
    " does the tail after the motion stops",
    "dark_current": "lag over more than one and a half decades of light: it levels off in the dark",
    "source_follower": "fast and slow edges in bright light: it delays and weakens fast changes at"
    " every brightness, while a clock offset shifts slow ones as much",
    "slew_limit": "steps of several sizes (more than a factor of e) at the same light: latency"
    " grows with the size of the step",
    "refractory": "fast, high-contrast edges: no two events of a pixel are nearer than a fixed"
    " time, at every brightness, and more is lost the steeper the edge",
    "reset_overshoot": "edges of different steepness: the first event after a reset comes late or"
    " early by the same contrast, whatever the steepness",
    "leak": "a scene at rest: regular ON events at every brightness, also in the dark",
    "photo_leak": "a scene at rest with bright and dark parts: regular ON events whose rate is"
    " proportional to the light",
    "shot_noise": "a scene at rest: ON and OFF events without order, fewer in bright light",
    "photoreceptor_noise": "a scene at rest: ON and OFF events that alternate, at a rate that falls"
    " steeply with the threshold",
    "hot_pixels": "a scene at rest, or a closed lens: few pixels hold most events",
    "dead_pixels": "a texture moved across the whole sensor: some pixels stay silent",
    "flicker": "the same scene by daylight or direct current: the line in the rate disappears",
    "frame_coupling": "a scene at rest at two frame rates: the bursts stay with the frames",
    "readout": "strong motion of the whole picture: delays grow with the rate of all pixels, and"
    " events come row by row",
    "event_loss": "motion of a small and of a large part of the picture: a share that is lost"
    " everywhere does not depend on the rate",
    "timestamp_tick": "none needed: all times are multiples of the tick",
    "frame_encoding": "one motion over dark and bright parts: the ratio of events between them",
    "black_level": "one motion over very dark parts: contrast is lost there and nowhere else",
    "exposure_blur": "small, fast features at two exposure times",
    "clock_offset": "fast and slow motion: the delay is the same for all pixels, speeds and light",
    "clock_drift": "a long recording: the delay between frames and events grows steadily",
    "misregistration": "motion in two opposite directions: a shift stays, a delay turns round",
}
"""For each effect, by its name in a diagnosis: the recording that would single it out."""


def separation_of(name: str) -> str:
    """Return what would single out the effect `name`, empty if it is not known here."""
    return SEPARATIONS.get(name, "")
