r"""Rate of noise events: band-limited noise that crosses the thresholds of a pixel at rest.

White noise behind two poles is a signal z, here of standard deviation 1, with time in units of the
slower pole's time constant and rho = (slower corner)/(faster corner).  Which pole is which does not
matter.  An event comes when z leaves (r - b, r + a), r being its value at the end of the last
event's dead time d.

**The slow part** y = z + rho dz/dt is an Ornstein-Uhlenbeck process of variance 1 + rho.  Where z
reaches a level l, y is beyond it.  Seen from y, the level is farther away [1]_ [2]_, at

.. math:: x(l) = l + \sqrt\rho\,h(u), \qquad u = l \sqrt\rho, \qquad
   h(u) = \frac{1}{u}\ln\frac{\sqrt{2\pi}\,u}{\theta(u)}

standard deviations.  theta is the share of all crossings upwards that are the first of their
cluster, so that a high level is reached at the rate of Rice [3]_ times theta.  With the eigenvalues
of the boundary layer,

.. math:: \ln\theta(u) = \ln(\sqrt{2\pi}\,u) + \frac{u^2}{2} + \lim_{N\to\infty}
   \left[\sum_{n=1}^{N} 2\,\mathrm{asinh}\frac{u}{2\sqrt n} - 2u\sqrt N\right]

which begins with -zeta(1/2) sqrt(rho) for the shift (Milne's length) and ends at theta = 1.  That
form follows from both ends and agrees with simulations; it is not proved.  It holds for small rho;
one term, fitted to simulations with rho from 0.2 to 1, is added for the rest.

**From event to event.**  With S' = e^{x^2/2} (scale) and m = e^{-x^2/2} (speed), from y on between
the levels v and w,

.. math:: P_{on} = \frac{S(y) - S(v)}{S(w) - S(v)}, \qquad
   E[T] = P_{on} \int_y^w (S(w) - S)\,m\,dx + P_{off} \int_v^y (S - S(v))\,m\,dx

**Leak.**  Where an event does not come before y has forgotten where it began, its levels are those
of the leaking reference, at rates that y at rest has.  A leak event mostly comes at a peak of the
noise, so that the next reference is high, and OFF events come that leak or noise alone do not make.

z and y at the end of the dead time are normal about what the poles make of the level and of a speed
with which it was crossed.  The stationary distribution over levels gives the rates.

Beside simulations of this process with thresholds from 1.5 to 4.5 standard deviations, rho from
0.003 to 1 and d from 0.003 to 2, rates are right to 5 % (root mean square), with one pole also for
d up to 9.  Equal thresholds lead back to where the last event began: after short dead times r then
stays on a lattice for long, and rates are up to ten times as high as where thresholds differ by a
tenth of the noise or more.  With leak, ON events of our pixel came at 0.96 to 1.03 of these rates,
OFF events at 0.93 to 1.2 (the latter where nearly all events are by leak).

These are rates of a pixel that has run for long.  Only leak and noise take references anew, and
till then rates are those of references taken at random moments of the noise: of a settled pixel
without leak that has 0.02 events a second, four times as many come in the first seconds, twice as
many after a minute.  Tables of this law, and a draw from it: :mod:`adv2e.kernel.photoreceptor`.

References
----------
.. [1] C. R. Doering, P. S. Hagan, C. D. Levermore, "Bistability driven by weakly colored Gaussian
   noise", Physical Review Letters 59(19), 1987, doi:10.1103/PhysRevLett.59.2129.
.. [2] T. W. Marshall, E. J. Watson, "A drop of ink falls from my pen ... It comes to earth, I know
   not when", Journal of Physics A 18(18), 1985, doi:10.1088/0305-4470/18/18/016.
.. [3] S. O. Rice, "Mathematical analysis of random noise", Bell System Technical Journal 24(1),
   1945, doi:10.1002/j.1538-7305.1945.tb00453.x.
.. [4] S. Karlin, H. M. Taylor, "A Second Course in Stochastic Processes", 1981, chapter 15.
.. [5] M. Broadie, P. Glasserman, S. Kou, "A continuity correction for discrete barrier options",
   Mathematical Finance 7(4), 1997, doi:10.1111/1467-9965.00035 (0.5826).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from adv2e.kernel.photoreceptor.exits import (
    COMPARABLE_POLES,
    FARTHEST,
    POLE_SHIFT,
    RAYLEIGH,
    SHIFTS,
    STEP,
    integrals,
    shifts,
)

Array = NDArray[np.float64]

HIGHEST = 8.0
"""Thresholds above this many standard deviations count as this: events of 1e-14 a unit of time."""

_BLUR = 0.02
"""Spread of the reference that is always there: else it may stay on a lattice for ever."""

_PLACES = 47
"""Values of the reference; with more, the linear algebra starts threads."""
_BEYOND = 3.5


def _normal_nodes(count: int) -> tuple[Array, Array]:
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


# close to each other: times to the next event differ by orders of magnitude
_LANDINGS = np.linspace(-3.5, 3.5, 11)
_LANDING_WEIGHTS = np.exp(-0.5 * _LANDINGS**2)
_LANDING_WEIGHTS /= _LANDING_WEIGHTS.sum()
_SLOW, _SLOW_WEIGHTS = _normal_nodes(3)
_REST, _REST_WEIGHTS = _normal_nodes(7)
_FORGOTTEN = 3.0
"""After so many time constants of the slower pole noise is at rest."""
_SUBSTEPS = 4
"""Parts of the way from place to place as the reference leaks."""


def _looked_up(x: Array) -> list[Array]:
    place = (np.clip(x, -FARTHEST, FARTHEST - 1e-9) + FARTHEST) / STEP
    below = place.astype(np.int64)
    share = (place - below)[..., None]
    table = integrals()
    values = table[below] * (1.0 - share) + table[below + 1] * share
    return list(np.moveaxis(values, -1, 0))


def _seen_by_slow_part(level: Array, ratio: float) -> Array:
    root = np.sqrt(ratio)
    comparable = COMPARABLE_POLES * ratio * np.exp(-0.5 * np.maximum(level, 0.0))
    moved: Array = level + root * np.interp(level * root, SHIFTS, shifts()) - comparable
    return moved


def _first_exit(lower: Array, upper: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the probabilities of the upper and the lower level, and the mean time till then."""
    y = np.clip(y, lower, upper)
    scale_l, _, below_l, both_l = _looked_up(lower)
    scale_u, above_u, _, both_u = _looked_up(upper)
    scale, above, below, both = _looked_up(y)
    p_on = (scale - scale_l) / (scale_u - scale_l)
    p_off = (scale_u - scale) / (scale_u - scale_l)
    time = p_on * (scale_u * (above - above_u) - (both_u - both))
    time += p_off * ((both - both_l) - scale_l * (below - below_l))
    return p_on, p_off, np.maximum(time, 0.0)


@lru_cache(maxsize=1 << 16)
def event_rates(
    on: float, off: float, dead_time: float = 0.0, ratio: float = 0.0, leak: float = 0.0
) -> tuple[float, float]:
    """Return the rates of ON and OFF events, in events a time constant of the slower pole.

    Parameters
    ----------
    on, off : float
        Thresholds over the standard deviation of the noise behind both poles, above 0.
    dead_time : float
        In time constants of the slower pole.
    ratio : float
        Corner of the slower pole over that of the faster one, 0 to 1; 0: there is but one pole.
    leak : float
        ON thresholds that the reference falls by in that time constant; well below 1.
    """
    on, off = min(on, HIGHEST), min(off, HIGHEST)
    farthest = max(on, off) + _BEYOND
    places = np.linspace(-farthest, farthest, _PLACES)
    levels = np.concatenate([places + on, places - off])
    ways = np.repeat([1.0, -1.0], _PLACES)
    z, y = _landings(levels, ways, dead_time, ratio)
    z = np.clip(z, -farthest, farthest)
    y = y / np.sqrt(1.0 + ratio)
    p_on, p_off, time = (part @ _SLOW_WEIGHTS for part in _exit_from(z, y, on, off, ratio))
    here = cubic((z - places[0]) / (places[1] - places[0]), _PLACES)
    chain = np.concatenate([_spread(here, p_on), _spread(here, p_off)], axis=1)
    if leak > 0.0:
        rest = np.broadcast_to(_REST, (_PLACES, _REST.size))
        on_rest, off_rest, time_rest = (
            np.maximum(part @ _REST_WEIGHTS, 1e-12)
            for part in _exit_from(places, rest, on, off, ratio)
        )
        crossed, waited = _drift(places, on_rest, off_rest, time_rest, leak * on)
        # times grow by orders of magnitude from place to place
        rested = np.exp(_interpolated(here, np.log(time_rest)))
        at_rest = np.minimum(time / rested, 1.0)
        still = np.concatenate([np.diag(on_rest), np.diag(off_rest)], axis=1)
        # products by BLAS would start threads, which wait long for each other where cores are busy
        chain += np.einsum("ij,jk->ik", _spread(here, at_rest), crossed - still)
        early = np.clip(time - at_rest * rested, 0.0, _FORGOTTEN)
        time = early + at_rest * np.exp(_interpolated(here, np.log(waited)))
    share = _stationary(chain)
    cycle = float(share @ (time @ _LANDING_WEIGHTS)) + dead_time
    ons = float(share[:_PLACES].sum())
    return max(ons, 0.0) / cycle, max(1.0 - ons, 0.0) / cycle


def _exit_from(
    z: Array, y: Array, on: float, off: float, ratio: float
) -> tuple[Array, Array, Array]:
    """Return `_first_exit` of y, (..., nodes), with references z, (...)."""
    upper = _seen_by_slow_part(z + on, ratio)[..., None]
    lower = -_seen_by_slow_part(off - z, ratio)[..., None]
    return _first_exit(lower, upper, y)


def _drift(
    places: Array, p_on: Array, p_off: Array, time: Array, speed: float
) -> tuple[Array, Array]:
    """Return probabilities of the level crossed next, (places, 2 places), and mean waiting times.

    The noise is stationary at the start.  The reference falls at `speed`, place after place, with
    hazards that are exponential in between.
    """
    count = places.size
    share = (np.arange(_SUBSTEPS) + 0.5) / _SUBSTEPS  # of the way to the next lower place
    length = (places[1] - places[0]) / speed / _SUBSTEPS
    logs = -np.log(time)[:, None]
    hazard = np.exp((1.0 - share) * logs[1:] + share * logs[:-1])
    by_on = (1.0 - share) * p_on[1:, None] + share * p_on[:-1, None]
    passed = np.cumsum(hazard * length, axis=1)
    ended = np.exp(-(passed - hazard * length)) * -np.expm1(-hazard * length)
    own, at = np.zeros((count, 2 * count)), np.arange(1, count)
    own[0, 0], own[0, count] = p_on[0], p_off[0]
    for first, part in ((0, ended * by_on), (count, ended * (1.0 - by_on))):
        own[at, first + at] += part @ (1.0 - share)
        own[at, first + at - 1] += part @ share
    lasted = np.concatenate([time[:1], (ended / hazard).sum(axis=1)])
    total = np.concatenate([[0.0], np.cumsum(passed[:, -1])])
    reached = np.exp(-np.maximum(total[:, None] - total, 0.0)) * np.tri(count)
    crossed, waited = np.einsum("ij,jk->ik", reached, own), reached @ lasted
    return crossed, waited


def _landings(levels: Array, ways: Array, dead_time: float, ratio: float) -> tuple[Array, Array]:
    """Return z, (levels, landings), and y, (levels, landings, slow), where dead times end."""
    # a low level is crossed faster, as mostly fast noise crosses it
    speed = RAYLEIGH + (POLE_SHIFT - RAYLEIGH) * np.exp(-np.abs(levels) * np.sqrt(ratio))
    ahead = ways * np.sqrt(ratio) * speed
    spread = ratio * (2.0 - 0.5 * np.pi) * (speed / RAYLEIGH) ** 2
    slow = np.exp(-dead_time)
    fast = np.exp(-dead_time / ratio) if ratio > 0.0 else 0.0
    follows = dead_time * slow if abs(1.0 - ratio) < 1e-6 else (slow - fast) / (1.0 - ratio)
    z_mean = (fast + follows) * levels + follows * ahead
    y_mean = slow * (levels + ahead)
    left = fast * fast + 2.0 * fast * follows + follows * follows * (1.0 + ratio)
    zz = np.maximum(1.0 - left, 0.0) + follows * follows * spread + _BLUR**2
    zy = 1.0 - slow * (fast + follows * (1.0 + ratio)) + follows * slow * spread + _BLUR**2
    yy = (1.0 + ratio) * (1.0 - slow * slow) + slow * slow * spread + _BLUR**2
    z = z_mean[:, None] + np.sqrt(zz)[:, None] * _LANDINGS
    y = y_mean[:, None] + (zy / np.sqrt(zz))[:, None] * _LANDINGS
    rest = np.sqrt(np.maximum(yy - zy * zy / zz, 0.0))
    return z, y[..., None] + rest[:, None, None] * _SLOW


def cubic(place: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """Return the first of four values of `count` about each place, and weights, (4, ...).

    Those of a cubic through them (Lagrange); places are counted in values, from 0.
    """
    first = np.clip(place.astype(np.int64) - 1, 0, count - 4)
    t = place - first
    weights = [
        -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0,
        t * (t - 2.0) * (t - 3.0) / 2.0,
        -t * (t - 1.0) * (t - 3.0) / 2.0,
        t * (t - 1.0) * (t - 2.0) / 6.0,
    ]
    return first, np.stack(weights)


def _interpolated(here: tuple[NDArray[np.int64], Array], values: Array) -> Array:
    first, weights = here
    total: Array = sum((weights[k] * values[first + k] for k in range(4)), np.zeros(first.shape))
    return total


def _spread(here: tuple[NDArray[np.int64], Array], parts: Array) -> Array:
    """Return the distribution of the next reference by level, (2 places, places), times `parts`."""
    first, cubic = here
    to = np.stack([first, first + 1, first + 2, first + 3])
    into = to + np.arange(2 * _PLACES)[:, None] * _PLACES
    weights = cubic * (_LANDING_WEIGHTS * parts)
    filled = np.bincount(into.ravel(), weights.ravel(), minlength=2 * _PLACES * _PLACES)
    return np.asarray(filled, dtype=np.float64).reshape(2 * _PLACES, _PLACES)


def _stationary(chain: Array) -> Array:
    """Return the stationary distribution of crossed levels; `chain`: transition matrix."""
    balance = chain.T - np.eye(len(chain))
    balance[-1] = 1.0  # one equation follows from the others; the shares add up to 1
    right = np.zeros(len(chain))
    right[-1] = 1.0
    return np.asarray(np.linalg.solve(balance, right), dtype=np.float64)
