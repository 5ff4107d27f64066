"""First guess of a view: where the camera looked in each short time, told by edges and events.

Where the light's logarithm has the slope g and the film moves by d, a pixel has about g d / C
events more of ON than of OFF.  In each short time, the position is sought at whose slopes some
motion d explains the events best, and a path through these positions is drawn that is both likely
and short.
The motion that events tell must be that of the path; where it is the opposite, the film was shown
inverted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adv2e.diagnosis.data.splits import Stream
from adv2e.diagnosis.film.residual import places_of
from adv2e.diagnosis.film.view import KNOT_NS, Films, View

Array = NDArray[np.float64]

_STEP_PX = 0.5
"""Between the positions that are tried."""
_MOST_FILMS = 16
_SMALL = 10.0
"""Largest share of the sensor's shorter side that is tried, as one in so many; at least 4 px."""
_SLOW_PX = 0.5
"""Motion in the time of a knot that counts as one deviation."""
_COURSE_US, _SOFT, _TURNS = 1000, 7, 10
"""Of courses in time: bins, those that are averaged, and rounds of alignment at most."""
_LASTS, _HARDLY, _BUSY = 10, 0.2, 0.9
"""Of a rest: bins of the course over which it is averaged, the largest share of the rate that is
exceeded in a tenth of the time."""
_KERNEL = np.array([0.25, 0.5, 0.25])


def first_delays(stream: Stream, recordings: int) -> Array:
    """Return by how much each recording is late, told by the courses of their events [us].

    Each course is moved along the mean of all others', in turn until none moves any more.
    """
    number, _, _ = places_of(stream, recordings)
    first, last = int(stream.t[0]), int(stream.t[-1])
    bins = (last - first) // _COURSE_US + 1
    place = number * bins + (stream.t - first) // _COURSE_US
    rows = np.bincount(place, minlength=recordings * bins).reshape(recordings, bins)
    rows = rows / np.maximum(rows.sum(axis=1, keepdims=True), 1)
    wide = np.pad(rows, ((0, 0), (bins, bins)))
    soft = np.apply_along_axis(np.convolve, 1, wide, np.ones(_SOFT) / _SOFT, "same")
    waves, late = np.fft.rfft(soft, axis=1), np.zeros(recordings, np.intp)
    turn = np.fft.rfftfreq(soft.shape[1])
    for _ in range(_TURNS):
        moved = waves * np.exp(2j * np.pi * turn * late[:, None])
        mean = moved.mean(axis=0) if late.any() else np.fft.rfft(np.median(soft, axis=0))
        alike = np.fft.irfft(waves * np.conj(mean), soft.shape[1], axis=1)
        at = alike.argmax(axis=1)
        found = np.where(at > soft.shape[1] // 2, at - soft.shape[1], at)
        if np.array_equal(found, late):
            break
        late = found
    return np.asarray((late - np.round(np.median(late))) * float(_COURSE_US))


def rests(stream: Stream, recordings: int, delays_us: Array) -> list[float]:
    """Return the times at which the camera rests between two motions [us].

    There hardly anything is seen, less than a share of what there is at most times.
    """
    number, _, _ = places_of(stream, recordings)
    t = stream.t - delays_us[number]
    bins = np.arange(t.min(), t.max() + 2 * _COURSE_US, _COURSE_US)
    rate = np.convolve(np.histogram(t, bins)[0], np.ones(_LASTS) / _LASTS, "same")
    quiet = rate < _HARDLY * np.quantile(rate, _BUSY)
    borders = np.flatnonzero(np.diff(np.r_[False, quiet, False]))
    spans = borders.reshape(-1, 2)
    between = [span for span in spans if span[0] > 0 and span[1] < len(quiet)]
    return [float(bins[low] + bins[high]) / 2 for low, high in between]


def first_view(films: Films, measured: Stream) -> View:
    """Return a view from which a fit finds its way: path and inversion; all else is usual.

    Of a video, the shift that explains most.
    """
    some = films.of(slice(None, _MOST_FILMS))
    blurred = View(np.zeros((len(films.knots_ns), 2)), blur_px=0.8, black=0.05)
    offsets = _offsets(films)
    if not films.moves:
        return View(_best_shift(some, measured, blurred, offsets)[None])
    count = len(films.knots_ns)
    slopes = [_slopes(some, blurred, offset) for offset in offsets]
    gains, motions = np.zeros((count, len(offsets))), np.zeros((count, len(offsets), 2))
    for k, knot_ns in enumerate(films.knots_ns.tolist()):
        begin, end = ((knot_ns + side * KNOT_NS / 2) * 1e-3 for side in (-1, 1))
        signed = _signed(some, measured.between(begin, end), len(films.pictures)).ravel()
        for j, slope in enumerate(slopes):
            along = slope @ signed
            motions[k, j] = np.linalg.solve(slope @ slope.T + 1e-6 * np.eye(2), along)
            gains[k, j] = along @ motions[k, j]
    chosen = _likely(gains / max(float(gains.max()), 1e-9), offsets)
    path = np.array([offsets[j] for j in chosen])
    told = motions[np.arange(count), chosen]
    moved = np.gradient(path, axis=0)
    # what brightens a pixel is motion along the slope; that is what these events tell of the film
    return View(path, inverted=float(np.sum(told * moved)) < 0.0)


def _offsets(films: Films) -> Array:
    reach = min(max(4.0, min(films.size) / _SMALL), films.reach_px)
    steps = np.arange(-reach, reach + 1e-9, _STEP_PX)
    return np.array([(x, y) for y in steps for x in steps])


def _slopes(films: Films, view: View, offset: Array) -> Array:
    """Return the slopes of ln light on all pixels, (2, pixels), of films seen from a position."""
    parts = []
    for frames in films.pictures:
        seen = np.log(films.seen(view, films.screen(view, frames[0]), offset))
        rise_y, rise_x = np.gradient(seen.astype(np.float64))
        parts.append(np.stack([rise_x, rise_y]).reshape(2, -1))
    return np.concatenate(parts, axis=1)


def _signed(films: Films, stream: Stream, recordings: int) -> Array:
    """Return ON less OFF events, smoothed, (recordings, rows, columns), of the first recordings."""
    width, height = films.size
    number, y, x = places_of(stream, recordings)
    inside = number < len(films.pictures)
    signed = np.zeros((len(films.pictures), height, width))
    sign = 2.0 * stream.on[inside] - 1.0
    np.add.at(signed, (number[inside], y[inside], x[inside]), sign)
    for axis in (1, 2):
        signed = np.apply_along_axis(np.convolve, axis, signed, _KERNEL, "same")
    return signed


def _likely(gains: Array, offsets: Array) -> NDArray[np.intp]:
    """Return the position of each knot on the likeliest path (dynamic programming)."""
    apart = ((offsets[:, None] - offsets[None]) ** 2).sum(axis=2) / (2.0 * _SLOW_PX**2)
    weight = 20.0  # of the largest gain, in deviations of motion
    total, back = weight * gains[0], []
    for row in gains[1:]:
        reached = total[None, :] - apart
        back.append(reached.argmax(axis=1))
        total = reached.max(axis=1) + weight * row
    chosen = [int(total.argmax())]
    for best in reversed(back):
        chosen.append(int(best[chosen[-1]]))
    return np.array(chosen[::-1], np.intp)


def _best_shift(films: Films, measured: Stream, view: View, offsets: Array) -> Array:
    """Return the shift at which changes of the light and signed events go together best."""
    (frames,) = films.pictures
    borders_us = films.times_ns * 1e-3
    found = np.zeros((len(offsets), 3))
    screens = [films.screen(view, frame) for frame in frames]
    signed = [
        _signed(films, measured.between(*borders_us[k : k + 2]), 1)[0]
        for k in range(len(frames) - 1)
    ]
    for j, offset in enumerate(offsets):
        seen = [np.log(films.seen(view, screen, offset)) for screen in screens]
        for k, events in enumerate(signed):
            change = seen[k + 1] - seen[k]
            found[j] += np.sum(change * events), np.sum(change**2), np.sum(events**2)
    return np.asarray(offsets[int(np.argmax(found[:, 0] / np.sqrt(found[:, 1] + 1e-9)))])
