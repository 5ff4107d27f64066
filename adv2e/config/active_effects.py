"""Active effects of a configuration that work through hooks, in signal order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from adv2e.config.model import Config, Frames, Pixel, Readout, Sampling
from adv2e.config.user_effects import user_effects
from adv2e.effects import STAGES
from adv2e.effects.frames.black_level import BlackLevelHooks
from adv2e.effects.frames.clock_drift import ClockDriftHooks
from adv2e.effects.frames.clock_offset import ClockOffsetHooks
from adv2e.effects.frames.exposure_blur import ExposureBlurHooks
from adv2e.effects.frames.flicker import FlickerHooks
from adv2e.effects.frames.misregistration import MisregistrationHooks
from adv2e.effects.hooks import Hooks
from adv2e.effects.pixel.dark_current import DarkCurrentHooks
from adv2e.effects.pixel.dead_pixels import DeadPixelsHooks
from adv2e.effects.readout.arbiter import ArbiterHooks
from adv2e.effects.readout.double_read import DoubleReadHooks
from adv2e.effects.readout.event_loss import EventLossHooks
from adv2e.effects.readout.frame_coupling import FrameCouplingHooks
from adv2e.effects.readout.timestamp_tick import TimestampTickHooks


def active_hooks(
    config: Config, extra: Sequence[Hooks] = (), exposures_us: Sequence[float] = ()
) -> list[Hooks]:
    """Return the effects that are on in `config`, and the `extra` ones besides, in signal order.

    Those that are not the package's own follow its own of their stage, in the order given; the
    tick of the time stamps is the last of all.  `exposures_us`: see :func:`frame_hooks`.
    """
    extra = [*user_hooks(config), *extra]
    own: dict[str, Iterable[Hooks]] = {
        "frames": frame_hooks(config.frames, config.sampling, exposures_us),
        "pixel": _pixel_hooks(config.pixel),
        "readout": _readout_hooks(config.readout, config.frames) if config.readout else [],
    }
    hooks: list[Hooks] = []
    for stage in STAGES:
        hooks += [*own[stage], *(hook for hook in extra if hook.stage == stage)]
    if config.readout is not None and config.readout.tick_us > 0:
        hooks.append(TimestampTickHooks(config.readout.tick_us))
    return hooks


def frame_hooks(
    frames: Frames, sampling: Sampling, exposures_us: Sequence[float] = ()
) -> Iterator[Hooks]:
    """Yield the effects on the light of the frames, in signal order.

    `exposures_us` are those of the frames, where they are known of each.
    """
    if frames.clock_drift_ppm:
        yield ClockDriftHooks(frames.clock_drift_ppm)
    if frames.clock_offset_us:
        yield ClockOffsetHooks(frames.clock_offset_us)
    if frames.exposure_us and sampling.interpolation != "linear":
        # imported late: few conversions need it, and all would load its compiled loops
        from adv2e.effects.frames.motion_blur import MotionBlurHooks  # noqa: PLC0415

        yield MotionBlurHooks(frames.exposure_us, exposures_us)
    elif frames.exposure_us:
        yield ExposureBlurHooks(frames.exposure_us, exposures_us)
    # after the frames are sharp: over a pedestal the dark would hardly become so in as many steps
    if frames.black_level_dn or frames.black_depth_dn:
        yield BlackLevelHooks(frames.black_level_dn, frames.black_depth_dn)
    if any(frames.shift_px):
        yield MisregistrationHooks(frames.shift_px)
    if frames.flicker is not None and frames.flicker.depth:
        yield FlickerHooks(frames.flicker)


def _pixel_hooks(pixel: Pixel) -> Iterator[Hooks]:
    if pixel.dark_current is not None and pixel.dark_current.dn:
        yield DarkCurrentHooks(pixel.dark_current)
    if pixel.dead_pixels is not None and pixel.dead_pixels.fraction:
        yield DeadPixelsHooks(pixel.dead_pixels)


def _readout_hooks(readout: Readout, frames: Frames) -> Iterator[Hooks]:
    if readout.frame_coupling is not None and readout.frame_coupling.amplitude:
        yield FrameCouplingHooks(readout.frame_coupling, 0.5 * frames.exposure_us)
    if readout.arbiter is not None:
        yield ArbiterHooks(readout.arbiter)
    twice = readout.double_read
    if twice is not None and (twice.on or twice.off):
        yield DoubleReadHooks(twice)
    if readout.loss is not None and readout.loss.fraction:
        yield EventLossHooks(readout.loss)


def user_hooks(config: Config) -> list[Hooks]:
    user = getattr(config, "user", None)
    sections = ((effect, getattr(user, name)) for name, effect in user_effects(config).items())
    return [effect(section) for effect, section in sections if section is not None]


def user_sources(config: Config) -> list[Mapping[str, str]]:
    """Return name, file and SHA-256 of each effect of the user's own that is on in `config`."""
    return [type(hook).source for hook in user_hooks(config) if type(hook).source]
