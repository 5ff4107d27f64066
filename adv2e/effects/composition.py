"""Many effects as one: their methods called in signal order, and what they return checked."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.courses import Additions, StepLimit, injection_complaint
from adv2e.effects.hooks import Frames, Hooks, Times, View
from adv2e.errors import Adv2eError, DataError
from adv2e.events import EVENT_DTYPE, Events, empty_events

Array = NDArray[Any]

_TIMED = ("gain", "drive", "signal", "thresholds")


def overrides(hook: Hooks, method: str) -> bool:
    """Tell whether `hook` has a `method` of its own."""
    return getattr(type(hook), method) is not getattr(Hooks, method)


def changes_light(hooks: Iterable[Hooks]) -> bool:
    """Tell whether any of `hooks` has to see the light of the frames."""
    return any(overrides(hook, "light") for hook in hooks)


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


def _light(hook: Hooks, frames: Frames, shape: tuple[int, ...]) -> Frames:
    source = _Watched(frames)
    with blamed(hook, source):
        for t_ns, light in hook.light(source):
            if np.shape(light) != shape:
                raise DataError(
                    f"effect {hook.name}: light: a frame of shape {np.shape(light)},"
                    f" must be {shape} as before it"
                )
            yield t_ns, light


def additions_of(hooks: Sequence[Hooks]) -> Additions | None:
    """Return what the effects add inside the pixel, as one; None: nothing."""
    of = {name: [hook for hook in hooks if overrides(hook, name)] for name in (*_TIMED, "inject")}
    if not any(of.values()):
        return None
    timed = list(dict.fromkeys(hook for name in _TIMED for hook in of[name]))
    gains, levels = of["gain"], of["thresholds"]
    return Additions(
        step_us=_shortest(timed),
        gain=_product(gains, "gain", lambda found: found) if gains else None,
        drive=_sum(of["drive"], "drive") if of["drive"] else None,
        signal=_sum(of["signal"], "signal") if of["signal"] else None,
        on=_product(levels, "thresholds", lambda pair: pair[0]) if levels else None,
        off=_product(levels, "thresholds", lambda pair: pair[1]) if levels else None,
        inject=_merge(of["inject"]) if of["inject"] else None,
    )


def _shortest(hooks: Sequence[Hooks]) -> StepLimit:
    def shortest(start_s: float, stop_s: float) -> float:
        return min((_longest_step_us(hook, start_s, stop_s) for hook in hooks), default=np.inf)

    return shortest


def _longest_step_us(hook: Hooks, start_s: float, stop_s: float) -> float:
    with blamed(hook):
        found = float(hook.longest_step_us(start_s, stop_s))
    if not found > 0.0:
        raise DataError(f"effect {hook.name}: longest_step_us: {found:g} us, must be above 0")
    return found


def _sum(hooks: Sequence[Hooks], method: str) -> Callable[[Times], Array]:
    def total(times_s: Times) -> Array:
        values = [_timed(hook, method, times_s, lambda found: found, 0.0) for hook in hooks]
        return _combined(np.add, values)

    return total


def _product(
    hooks: Sequence[Hooks], method: str, part: Callable[[Any], Any]
) -> Callable[[Times], Array]:
    def total(times_s: Times) -> Array:
        values = [_timed(hook, method, times_s, part, 1.0) for hook in hooks]
        for hook, value in zip(hooks, values, strict=True):
            if not np.all(value > 0):
                raise DataError(
                    f"effect {hook.name}: {method}: a factor of {np.min(value):g}, must be above 0"
                )
        return _combined(np.multiply, values)

    return total


def _timed(
    hook: Hooks, method: str, times_s: Times, part: Callable[[Any], Any], neutral: float
) -> Array:
    """Return what a method gives at `times_s`: (n,) or (n, pixels), finite."""
    with blamed(hook):
        found = getattr(hook, method)(times_s)
        if found is None:
            return np.full(times_s.size, neutral)
        value = np.asarray(part(found), np.float64)
    wanted = [(times_s.size,), (times_s.size, hook.view.rows, hook.view.columns)]
    if value.shape not in wanted:
        raise DataError(
            f"effect {hook.name}: {method}: shape {value.shape}, must be {wanted[0]} or"
            f" {wanted[1]}: one value a time, or one a time and pixel"
        )
    if not np.all(np.isfinite(value)):
        raise DataError(f"effect {hook.name}: {method}: values that are NaN or infinite")
    return value.reshape(times_s.size, -1) if value.ndim == 3 else value


def _combined(combine: Callable[[Array, Array], Array], values: Sequence[Array]) -> Array:
    if any(value.ndim == 2 for value in values):
        values = [value if value.ndim == 2 else value[:, None] for value in values]
    total = values[0]
    for value in values[1:]:
        total = combine(total, value)
    return total


def _merge(hooks: Sequence[Hooks]) -> Callable[[float, float], Array]:
    def merged(start_s: float, stop_s: float) -> Array:
        parts = [_injected(hook, start_s, stop_s) for hook in hooks]
        if len(parts) == 1:
            return parts[0]
        together = np.concatenate(parts)
        return together[np.argsort(together["t"], kind="stable")]

    return merged


def _injected(hook: Hooks, start_s: float, stop_s: float) -> Array:
    with blamed(hook):
        found = np.asarray(hook.inject(start_s, stop_s))
    wrong = injection_complaint(found, start_s, stop_s, hook.view.rows, hook.view.columns)
    if wrong:
        raise DataError(f"effect {hook.name}: inject: {wrong}")
    return found


def map_events(hooks: Iterable[Hooks], chunks: Iterable[Events]) -> Iterator[Events]:
    """Yield the events that leave the last of the effects: one array at least."""
    chunks = iter(chunks)
    for hook in hooks:
        if overrides(hook, "events"):
            chunks = _events(hook, chunks)
    return chunks


def _events(hook: Hooks, chunks: Iterator[Events]) -> Iterator[Events]:
    last, nothing = -np.inf, True
    source = _Watched(chunks)
    with blamed(hook, source):
        for events in hook.events(source):
            if not isinstance(events, np.ndarray) or events.dtype != EVENT_DTYPE:
                raise DataError(f"effect {hook.name}: events: must yield arrays of EVENT_DTYPE")
            if events.size:
                times = events["t"]
                if times[0] < last or np.any(times[1:] < times[:-1]):
                    raise DataError(f"effect {hook.name}: events: times must not decrease")
                last = times[-1]
            nothing = False
            yield events
            del events  # or they would stay while the next ones are made
    if nothing:
        yield empty_events()


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
    """Turn what goes wrong in code that is not the package's own into an error that says where."""
    try:
        yield
    except Adv2eError:
        raise
    except Exception as error:
        own = type(hook).__module__
        if own.startswith("adv2e.") or (source is not None and error is source.error):
            raise
        file = str(getattr(sys.modules.get(own), "__file__", ""))
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
        where = f"{file}:{lines[-1]}: " if lines else ""
        text = " ".join(str(error).split())
        raise DataError(f"{where}effect {hook.name}: {type(error).__name__}: {text}") from error
