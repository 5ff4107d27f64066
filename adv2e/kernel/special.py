"""Exponential and logarithm for loops over pixels.

Polynomials instead of the C library: they vectorise, and give the same bits on every machine.
Those in double precision are good to 3e-16 times a small number, those in single precision (names
that end in 32) to 2e-7; see the tests.  The coefficients of the latter are minimax in relative
error, rounded to single precision.
"""

from __future__ import annotations

import numpy as np

from adv2e.compiled import kernel

_LOG2E = 1.4426950408889634
_LN2_HIGH = 0.693147180369123816490
_LN2_LOW = 1.90821492927058770002e-10
_LN2 = 0.6931471805599453
_HALF_ROOT = np.int64(0x3FE6A09E667F3BCD)  # bits of sqrt(1/2)


@kernel
def exp(t):
    """e^t for -700 < t < 700; arguments beyond are clamped."""
    t = t if t > -700.0 else -700.0
    t = t if t < 700.0 else 700.0
    n = np.floor(t * _LOG2E + 0.5)
    r = (t - n * _LN2_HIGH) - n * _LN2_LOW
    p = 1 / 40320 + r * (1 / 362880 + r * (1 / 3628800 + r * (1 / 39916800 + r * (1 / 479001600))))
    p = 1 / 24 + r * (1 / 120 + r * (1 / 720 + r * (1 / 5040 + r * p)))
    p = 1.0 + r * (1.0 + r * (1 / 2 + r * (1 / 6 + r * p)))
    scale = np.int64((np.int64(n) + np.int64(1023)) << np.int64(52)).view(np.float64)
    return scale * p


@kernel
def exp_alone(t):
    """e^t for t <= 0 of one number: as `exp`, with less to wait for in a row."""
    t = t if t > -700.0 else -700.0
    n = np.floor(t * _LOG2E + 0.5)
    r = (t - n * _LN2_HIGH) - n * _LN2_LOW
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r) + r2 * (1 / 2 + r * (1 / 6))
    middle = (1 / 24 + r * (1 / 120)) + r2 * (1 / 720 + r * (1 / 5040))
    high = (1 / 40320 + r * (1 / 362880)) + r2 * (1 / 3628800 + r * (1 / 39916800))
    p = low + r4 * (middle + r4 * (high + r4 * (1 / 479001600)))
    scale = np.int64((np.int64(n) + np.int64(1023)) << np.int64(52)).view(np.float64)
    return scale * p


@kernel
def log(v):
    """Natural logarithm of a positive normal number."""
    bits = np.float64(v).view(np.int64)
    e = np.int64(np.int64(bits - _HALF_ROOT) >> np.int64(52))
    m = np.int64(bits - np.int64(e << np.int64(52))).view(np.float64)
    f = (m - 1.0) / (m + 1.0)
    g = f * f
    s = 1 / 15 + g * (1 / 17 + g * (1 / 19 + g * (1 / 21)))
    s = 1 / 7 + g * (1 / 9 + g * (1 / 11 + g * (1 / 13 + g * s)))
    s = 1.0 + g * (1 / 3 + g * (1 / 5 + g * s))
    return np.float64(e) * _LN2 + 2.0 * f * s


# of the polynomial through 12 Chebyshev nodes of 0..1
_Q0, _Q1, _Q2, _Q3 = 1.0, -0.4999999999999964, 0.1666666666664944, -0.041666666663443576
_Q4, _Q5, _Q6 = 0.008333333302138762, -0.0013888887104824001, 0.0001984120502317959
_Q7, _Q8, _Q9 = -2.4800032289946006e-05, 2.753231109497008e-06, -2.7289403227036547e-07
_Q10, _Q11 = 2.3200975871202737e-08, -1.3221480811326931e-09


@kernel
def settling(a):
    """(1 - e^-a)/a for 0 <= a <= 1, to rounding; e^-a is 1 less a times it."""
    s = _Q7 + a * (_Q8 + a * (_Q9 + a * (_Q10 + a * _Q11)))
    s = _Q3 + a * (_Q4 + a * (_Q5 + a * (_Q6 + a * s)))
    return _Q0 + a * (_Q1 + a * (_Q2 + a * s))


@kernel
def psi(z):
    """(e^z - 1 - z)/z^2 for |z| <= 1, without cancellation; error below 2e-12."""
    s = 1 / 3628800 + z * (1 / 39916800 + z * (1 / 479001600 + z * (1 / 6227020800)))
    s = 1 / 720 + z * (1 / 5040 + z * (1 / 40320 + z * (1 / 362880 + z * s)))
    return 1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * s)))


_f = np.float32
_LOG2E_32 = _f(1.4426950408889634)
_LN2_HIGH_32 = _f(0.693359375)
_LN2_LOW_32 = _f(-2.12194440e-4)
_LN2_32 = _f(0.6931471805599453)
_HALF_ROOT_32 = np.int32(0x3F3504F3)  # bits of sqrt(1/2)
_ROUND_32 = _f(12582912.0)  # 1.5 2^23: added to a small number, it leaves the nearest whole one
_E0, _E1, _E2, _E3, _E4, _E5, _E6 = (
    _f(c)
    for c in (1.0, 1.0, 0.4999999106, 0.1666641980, 0.04166822508, 0.008374815807, 0.001383684576)
)
_P0, _P1, _P2, _P3, _P4, _P5, _P6 = (
    _f(c)
    for c in (
        *(0.5, 0.1666669548, 0.04166651517, 0.008330930024),
        *(0.001389133511, 0.0002032548364, 2.496081288e-05),
    )
)
_T0, _T1, _T2, _T3, _T4, _T5 = (
    _f(c) for c in (2.0, 0.6666712761, 0.3997559845, 0.2904053330, 0.1823936999, 0.3286587894)
)


@kernel
def exp32(t):
    """e^t in single precision for -80 < t < 80."""
    shifted = _f(t * _LOG2E_32 + _ROUND_32)
    n = shifted - _ROUND_32
    r = (t - n * _LN2_HIGH_32) - n * _LN2_LOW_32
    p = _E0 + r * (_E1 + r * (_E2 + r * (_E3 + r * (_E4 + r * (_E5 + r * _E6)))))
    exponent = np.int32(shifted.view(np.int32) + np.int32(127))
    return np.int32(exponent << np.int32(23)).view(np.float32) * p


@kernel
def log32(v):
    """Natural logarithm of a positive normal number in single precision."""
    bits = _f(v).view(np.int32)
    e = np.int32(np.int32(bits - _HALF_ROOT_32) >> np.int32(23))
    m = np.int32(bits - np.int32(e << np.int32(23))).view(np.float32)
    return _f(e) * _LN2_32 + log_ratio32((m - _f(1.0)) / (m + _f(1.0)))


@kernel
def psi32(z):
    """(e^z - 1 - z)/z^2 in single precision for |z| <= 1."""
    return _P0 + z * (_P1 + z * (_P2 + z * (_P3 + z * (_P4 + z * (_P5 + z * _P6)))))


@kernel
def log_ratio32(g):
    """ln(b/a) in single precision from g = (b - a)/(b + a), |g| <= tanh(1/2).

    Small ratios keep their relative precision, which a difference of logarithms would lose.
    """
    s = g * g
    return g * (_T0 + s * (_T1 + s * (_T2 + s * (_T3 + s * (_T4 + s * _T5)))))
