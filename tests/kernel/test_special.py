import math

import numpy as np

from adv2e.kernel import special


def test_exp():
    t = np.concatenate([np.linspace(-700, 700, 4001), np.linspace(-1, 1, 2001), [0.0]])
    error = max(abs(special.exp(v) / math.exp(v) - 1) for v in t)
    assert error < 1e-15
    assert special.exp(-1e9) < 1e-300
    assert special.exp(0.0) == 1.0


def test_log():
    v = np.concatenate([np.geomspace(1e-12, 1e12, 4001), np.linspace(0.5, 2, 3001)])
    error = max(abs(special.log(x) - math.log(x)) for x in v)
    assert error < 1e-14
    assert special.log(1.0) == 0.0


def test_psi_has_no_cancellation():
    z = np.concatenate([np.linspace(-1, 1, 401), [1e-9, -1e-9, 0.0]])
    for v in z:
        series = sum(v**k / math.factorial(k + 2) for k in range(30))
        assert abs(special.psi(v) - series) < 2e-11


def test_settling():
    a = np.concatenate([np.linspace(0.001, 1.0, 2001), np.geomspace(1e-12, 1e-3, 100)])
    found = np.array([special.settling(one) for one in a])
    np.testing.assert_allclose(found, -np.expm1(-a) / a, rtol=1e-15)
    np.testing.assert_allclose(1.0 - a * found, np.exp(-a), rtol=1e-15)
    assert special.settling(0.0) == 1.0


def test_exponential_of_one_number():
    t = -np.concatenate([np.linspace(0.0, 2.0, 2001), np.geomspace(2.0, 690.0, 500)])
    found = np.array([special.exp_alone(one) for one in t])
    np.testing.assert_allclose(found, np.exp(t), rtol=1e-15)
