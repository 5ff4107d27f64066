import numba
import numpy as np
import pytest
from scipy import stats

from adv2e.cli.options import SEED
from adv2e.config.model import Pixel, Sampling
from adv2e.kernel import rng
from adv2e.pixel.state import make_circuit


def test_philox_known_answers():
    """Known-answer vectors of the Random123 distribution."""
    zero, ones = np.uint64(0), np.uint64(0xFFFFFFFF)
    assert [int(v) for v in rng.philox(*[zero] * 6)] == [
        0x6627E8D5,
        0xE169C58D,
        0xBC57AC4C,
        0x9B00DBD8,
    ]
    assert [int(v) for v in rng.philox(*[ones] * 6)] == [
        0x408F276D,
        0x41C83B0E,
        0xA20BC7C6,
        0x6D5451FD,
    ]


def test_distributions():
    u = np.array([rng.uniforms(11, rng.SHOT_KIND, i, 3) for i in range(20_000)])
    assert stats.kstest(u[:, 0], "uniform").pvalue > 1e-3
    assert stats.kstest(u[:, 1], "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.03
    z = [rng.normal(11, rng.LEAK_PERIOD, 5, k) for k in range(20_000)]
    assert stats.kstest(z, "norm").pvalue > 1e-3
    e = [rng.exponential(11, rng.HOT_TIME, 5, k) for k in range(20_000)]
    assert stats.kstest(e, "expon").pvalue > 1e-3


def test_every_argument_matters_and_only_they():
    base = (3, rng.SHOT_TIME, 1000, 7)
    first = rng.uniforms(*base)
    assert rng.uniforms(*base) == first
    for k in range(4):
        changed = list(base)
        changed[k] += 1
        assert rng.uniforms(*changed) != first
    assert rng.uniforms(3 + (1 << 40), *base[1:]) != first


@pytest.mark.parametrize("seed", [1 << 63, rng.LARGEST_SEED])
def test_large_seeds_need_no_code_of_their_own(seed):
    """Code is kept for the types of its arguments, and takes a minute to compile."""
    small, large = (make_circuit(Pixel(), Sampling(), s) for s in (0, seed))
    assert numba.typeof(small) == numba.typeof(large)
    pixels = np.arange(5)
    drawn = rng.uniform_array(seed, rng.LOSS, pixels, 0)
    assert len({*drawn, *rng.uniform_array(seed - 1, rng.LOSS, pixels, 0)}) == 10
    counts = np.zeros(5, np.int64)
    assert np.array_equal(rng.next_uniforms(seed, rng.LOSS, pixels, counts), drawn)


def test_the_command_line_knows_the_largest_seed():
    assert SEED.max == rng.LARGEST_SEED
