"""Events and noise that come by themselves: shot noise, hot pixels, photoreceptor noise.

The equations are those of the modules of these names in :mod:`adv2e.effects.pixel`.
"""

from __future__ import annotations

import math

from adv2e.causes import HOT_PIXEL, SHOT_NOISE, SIGNAL
from adv2e.compiled import inlined, kernel
from adv2e.kernel import per_pixel, rng

NONE, SHOT, HOT = SIGNAL, SHOT_NOISE, HOT_PIXEL
"""Kinds of noise events: their causes."""


@inlined
def _next_candidate(i, circuit, state):
    state[per_pixel.SHOT_DRAW, i] += 1
    wait = rng.exponential(circuit.seed, rng.SHOT_TIME, i, state[per_pixel.SHOT_DRAW, i])
    state[per_pixel.SHOT_TIME, i] += wait / circuit.shot_rate


@kernel
def hot_rate_of(i, seed, rate, spread):
    """Rate of hot pixel i, in events a us."""
    if spread == 0.0:
        return rate
    return rate * math.exp(spread * rng.normal(seed, rng.HOT_RATE, i, 0))


@inlined
def _next_hot(i, circuit, state):
    state[per_pixel.HOT_DRAW, i] += 1
    wait = rng.exponential(circuit.seed, rng.HOT_TIME, i, state[per_pixel.HOT_DRAW, i])
    rate = hot_rate_of(i, circuit.seed, circuit.hot_rate, circuit.hot_spread)
    state[per_pixel.HOT_TIME, i] += wait / rate


@kernel
def next_noise(i, circuit, state):
    """Kind of the next noise event of pixel i, and when it may come [us]."""
    kind, t = NONE, per_pixel.NEVER
    if circuit.shot_rate > 0.0:
        kind, t = SHOT, state[per_pixel.SHOT_TIME, i]
    if circuit.hot_rate > 0.0 and state[per_pixel.HOT_TIME, i] < t:
        kind, t = HOT, state[per_pixel.HOT_TIME, i]
    return kind, t


@inlined
def noise_within(i, now, t_end, circuit, state):
    """Kind and time of the next noise event of pixel i in [now, t_end); those before are lost."""
    if circuit.shot_rate > 0.0:
        while state[per_pixel.SHOT_TIME, i] < now:
            _next_candidate(i, circuit, state)
    if circuit.hot_rate > 0.0:
        while state[per_pixel.HOT_TIME, i] < now:
            _next_hot(i, circuit, state)
    kind, t = next_noise(i, circuit, state)
    if t >= t_end:
        kind, t = NONE, t_end
    return kind, t


@inlined
def take_noise(i, kind, light, circuit, state):
    """Return the polarity of the present noise event of pixel i, and go on to the next one.

    It is 0 where the light [DN] thins the event out.
    """
    polarity = 1
    if kind == HOT:
        if rng.uniforms(circuit.seed, rng.HOT_CHOICE, i, 0)[1] < circuit.hot_off:
            polarity = -1
        _next_hot(i, circuit, state)
    else:
        u, v = rng.uniforms(circuit.seed, rng.SHOT_KIND, i, state[per_pixel.SHOT_DRAW, i])
        if u >= 1.0 - circuit.shot_fall * light:
            polarity = 0
        elif v >= 0.5:
            polarity = -1
        _next_candidate(i, circuit, state)
    return polarity


@kernel
def fill_first_candidates(lo, hi, seed, rate, start, times, draws):
    """Draw the first candidate time [us] of the pixels lo..hi; rate in events a us.

    `draws`, how often each has drawn since, becomes 0.
    """
    u, spare = times[lo:hi], draws[lo:hi]
    rng.uniforms_of_pixels(seed, rng.SHOT_TIME, lo, u, spare)
    for k in range(hi - lo):
        u[k] = start + -math.log(u[k]) / rate
        spare[k] = 0.0


@kernel
def fill_first_hot_times(seed, fraction, rate, spread, start, times):
    """Choose the hot pixels and draw their first times [us]; the others never fire."""
    for i in range(times.shape[0]):
        times[i] = per_pixel.NEVER
        if rng.uniforms(seed, rng.HOT_CHOICE, i, 0)[0] < fraction:
            own = hot_rate_of(i, seed, rate, spread)
            times[i] = start + rng.exponential(seed, rng.HOT_TIME, i, 0) / own


@kernel
def stationary_noise(i, draw, corner, circuit):
    """Draw noise of pixel i before and behind the second pole, and what the high-pass subtracts.

    All are as they are at any moment, together.  Behind a pole of corner f2, noise of corner f1
    keeps the share f2/(f1 + f2) of its variance, and the covariance of both is that same share.
    Of processes that follow one another, moments are those at which none changes in the mean:
    behind a pole of corner w, d<pq>/dt = w <p(input)> - w <pq> - ...
    """
    rms, second, high = circuit.noise_rms, circuit.follower, circuit.high
    share, spare, slow = 1.0, 0.0, 0.0
    noise = seen = rms * rng.normal(circuit.seed, rng.PHOTORECEPTOR, i, draw)
    if second > 0.0:
        share = second / (second + corner)
        own = rms * math.sqrt(share * (1.0 - share))
        spare = own * rng.normal(circuit.seed, rng.PHOTORECEPTOR_BEHIND, i, draw)
        seen = share * noise + spare
    if high > 0.0:
        # covariances with noise and seen, its part that goes with spare, and what is left [rms^2]
        by_noise = with_seen = high / (high + corner) * share
        own, by_spare = share * (1.0 - share), 0.0
        if second > 0.0:
            with_seen = (second * by_noise + high * share) / (second + high)
            by_spare = (with_seen - by_noise * share) / own if own > 0.0 else 0.0
        left = math.sqrt(max(with_seen - by_noise**2 - by_spare**2 * own, 0.0))
        new = rms * left * rng.normal(circuit.seed, rng.PHOTORECEPTOR_SLOW, i, draw)
        slow = by_noise * noise + by_spare * spare + new
    return noise, seen, slow


@kernel
def fill_first_noise(lo, hi, circuit, light, state):
    """Draw the noise of the pixels lo..hi in `light` [DN]; their references are the signal."""
    for i in range(lo, hi):
        corner = circuit.dark + circuit.per_dn * light[i]
        noise, seen, slow = stationary_noise(i, 0, corner, circuit)
        state[per_pixel.NOISE, i], state[per_pixel.SEEN, i] = noise, seen
        state[per_pixel.REFERENCE, i] += seen - slow
        if circuit.high > 0.0:
            state[per_pixel.SLOW, i] = slow
