"""Many effects as one: their methods called in signal order, and what they return checked."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import reduce
from itertools import chain, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.causes import CAUSED_DTYPE, FRAME_COUPLING, OWN_EFFECT, with_cause
from adv2e.effects.hooks import INJECTED_DTYPE, Frames, Hooks, LightFrame, Times, View
from adv2e.errors import Adv2eError, ConfigError, DataError, one_line
from adv2e.events import EVENT_DTYPE, Events

Array = NDArray[Any]

COURSES: dict[str, tuple[str, int | None, np.ufunc]] = {
    "gain": ("gain", None, np.multiply),
    "drive": ("drive", None, np.add),
    "signal": ("signal", None, np.add),
    "on": ("thresholds", 0, np.multiply),
    "off": ("thresholds", 1, np.multiply),
}
"""Courses by time that act on the pixels: method, index in its result, and how effects combine."""


_IN_PARTS = {"light": ("light_now",), "events": ("events_now", "events_left")}
"""Methods that may stand in the place of another."""


def overrides(hook: Hooks, method: str) -> bool:
    methods = (method, *_IN_PARTS.get(method, ()))
    return any(getattr(type(hook), one) is not getattr(Hooks, one) for one in methods)


def begin(hooks: Sequence[Hooks], frames: Frames, seed: int) -> Frames:
    """Tell each effect of the recording that begins; return the frames as the pixel sees them.

    Raises
    ------
    DataError
        No frames, or frames of another size come out of an effect.
    """
    first = next(frames, None)
    if first is None:
        raise DataError("no frames: at least two are needed")
    t_ns, light = first
    for hook in hooks:
        with blamed(hook):
            rows, columns = light.shape
            hook.begin(View(rows, columns, seed, t_ns * 1e-9))
        if overrides(hook, "light"):
            frames = _light(hook, chain([(t_ns, light)], frames), light.shape)
            t_ns, light = next(frames, (t_ns, light))
    return chain([(t_ns, light)], frames)


def light_now(hooks: Sequence[Hooks], t_ns: int, light: Array) -> LightFrame:
    """Return a frame after the first as the pixel sees it, where no effect looks ahead."""
    for hook in hooks:
        if overrides(hook, "light"):
            ((t_ns, light),) = _light(hook, iter([(t_ns, light)]), light.shape, now=True)
    return t_ns, light


def _light(hook: Hooks, frames: Frames, shape: tuple[int, ...], now: bool = False) -> Frames:
    source = _Watched(frames)
    with blamed(hook, source):
        for t_ns, light in starmap(hook.light_now, source) if now else hook.light(source):
            if np.shape(light) != shape:
                raise DataError(
                    f"effect {hook.name}: light: a frame of shape {np.shape(light)},"
                    f" must be {shape} as before it"
                )
            yield t_ns, light


def inside_pixel(hooks: Iterable[Hooks]) -> list[Hooks]:
    """Return the effects that act inside the pixel; if there are none, it is solved faster."""
    return [hook for hook in hooks if _is_timed(hook) or overrides(hook, "inject")]


def _is_timed(hook: Hooks) -> bool:
    return any(overrides(hook, method) for method, *_ in COURSES.values())


def cause_of_signal(hooks: Sequence[Hooks]) -> int:
    return OWN_EFFECT if any(map(_is_own, _adding(hooks))) else FRAME_COUPLING


def check_causes(hooks: Sequence[Hooks]) -> None:
    """Raise ConfigError where causes cannot be told: effects of ours and of others in one sum."""
    own = [hook for hook in _adding(hooks) if _is_own(hook)]
    if own and len(own) < len(_adding(hooks)):
        raise ConfigError(
            f"causes: readout.frame_coupling and the effect {own[0].name} both add to the signal,"
            " so their events cannot be told apart: switch one of them off"
        )


def _adding(hooks: Sequence[Hooks]) -> list[Hooks]:
    return [hook for hook in hooks if overrides(hook, "signal")]


def _is_own(hook: Hooks) -> bool:
    return not type(hook).__module__.startswith("adv2e.")


def longest_step_us(hooks: Sequence[Hooks], start_s: float, stop_s: float) -> float:
    """Return the longest time step that resolves the courses of all `hooks` [us]."""
    shortest = np.inf
    for hook in filter(_is_timed, hooks):
        with blamed(hook):
            found = float(hook.longest_step_us(start_s, stop_s))
        if not found > 0.0:
            raise DataError(f"effect {hook.name}: longest_step_us: {found:g} us, must be above 0")
        shortest = min(shortest, found)
    return shortest


def course(hooks: Sequence[Hooks], name: str, times_s: Times) -> Array | None:
    """Return a course of all `hooks` together at times [s], (n, 1) or (n, pixels); None: no course.

    It is a straight line between the ends of a step; pixels are in row-major order.
    """
    method, part, combine = COURSES[name]
    of = [hook for hook in hooks if overrides(hook, method)]
    values = (_values(hook, method, part, combine, times_s) for hook in of)
    return np.asarray(reduce(combine, values)) if of else None


def _values(hook: Hooks, method: str, part: int | None, combine: np.ufunc, times_s: Times) -> Array:
    with blamed(hook):
        found = getattr(hook, method)(times_s)
        if found is None:
            return np.full((times_s.size, 1), float(combine.identity))
        value = np.asarray(found if part is None else found[part], np.float64)
    wanted = [(times_s.size,), (times_s.size, hook.view.rows, hook.view.columns)]
    if value.shape not in wanted:
        raise DataError(
            f"effect {hook.name}: {method}: shape {value.shape}, must be {wanted[0]} or"
            f" {wanted[1]}: one value a time, or one a time and pixel"
        )
    if not np.all(np.isfinite(value)):
        raise DataError(f"effect {hook.name}: {method}: values that are NaN or infinite")
    if combine is np.multiply and not np.all(value > 0):
        raise DataError(
            f"effect {hook.name}: {method}: a factor of {np.min(value):g}, must be above 0"
        )
    return value.reshape(times_s.size, -1)


def injected(hooks: Sequence[Hooks], start_s: float, stop_s: float) -> Array:
    parts = [np.empty(0, INJECTED_DTYPE)]
    for hook in (hook for hook in hooks if overrides(hook, "inject")):
        with blamed(hook):
            found = np.asarray(hook.inject(start_s, stop_s))
        wrong = _injection_complaint(found, start_s, stop_s, hook.view)
        if wrong:
            raise DataError(f"effect {hook.name}: inject: {wrong}")
        parts.append(found)
    together = np.concatenate(parts)
    return together[np.argsort(together["t"], kind="stable")]


def _injection_complaint(found: Array, start_s: float, stop_s: float, view: View) -> str | None:
    if found.dtype != INJECTED_DTYPE or found.ndim != 1:
        return f"must be (n,) of INJECTED_DTYPE, got {found.dtype} of shape {found.shape}"
    times = found["t"]
    inside = (times >= start_s) & (times < stop_s)
    if not (np.all(inside) and np.all(times[1:] >= times[:-1])):
        return f"times must be sorted and from {start_s:.6f} s to before {stop_s:.6f} s"
    if np.any(found["x"] >= view.columns) or np.any(found["y"] >= view.rows):
        return f"x must be below {view.columns} and y below {view.rows}"
    return None


def map_events(
    hooks: Iterable[Hooks], chunks: Iterable[Events], causes: bool = False, *, ends: bool = True
) -> Iterator[Events]:
    """Yield the events that leave the last of the effects: one array at least.

    With `causes`, all know theirs: what an effect returns without is its own.  Where it does not
    end, effects that do not look ahead keep what may follow others that are still to come.
    """
    chunks = iter(chunks)
    for hook in hooks:
        if overrides(hook, "events"):
            chunks = _events(hook, chunks, CAUSED_DTYPE if causes else EVENT_DTYPE, ends)
    return chunks


def _events(
    hook: Hooks, chunks: Iterator[Events], dtype: np.dtype[Any], ends: bool
) -> Iterator[Events]:
    last, nothing = -np.inf, True
    source = _Watched(chunks)
    with blamed(hook, source):
        for made in hook.events(source) if ends else map(hook.events_now, source):
            if not isinstance(made, np.ndarray) or made.dtype not in (EVENT_DTYPE, dtype):
                raise DataError(f"effect {hook.name}: events: must yield arrays of EVENT_DTYPE")
            events = made if made.dtype == dtype else with_cause(made, OWN_EFFECT)
            del made
            if events.size:
                times = events["t"]
                if times[0] < last or np.any(times[1:] < times[:-1]):
                    raise DataError(f"effect {hook.name}: events: times must not decrease")
                last = times[-1]
            nothing = False
            yield events
            del events  # or they would stay while the next ones are made
    if nothing:
        yield np.empty(0, dtype)


class _Watched:
    """An iterator that remembers what went wrong before it, which is no fault of who reads it."""

    def __init__(self, source: Iterator[Any]) -> None:
        self._source = source
        self.error: Exception | None = None

    def __iter__(self) -> _Watched:
        return self

    def __next__(self) -> Any:
        try:
            return next(self._source)
        except StopIteration:
            raise
        except Exception as error:
            self.error = error
            raise


@contextmanager
def blamed(hook: Hooks, source: _Watched | None = None) -> Iterator[None]:
    """Turn exceptions in code of a user's own effect into a DataError with file and line."""
    try:
        yield
    except Adv2eError:
        raise
    except Exception as error:
        if not _is_own(hook) or (source is not None and error is source.error):
            raise
        file = str(getattr(sys.modules.get(type(hook).__module__), "__file__", ""))
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
        where = f"{file}:{lines[-1]}: " if lines else ""
        what = f"effect {hook.name}: {type(error).__name__}"
        raise DataError(f"{where}{what}: {one_line(error)}") from error
