"""Seeds, shards and reasons."""

import hashlib
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adv2e.batches.plan import parse_shard, seed_of, shard_of
from adv2e.errors import UsageError
from adv2e.files.states import State, digest_of, state_of


def test_seeds_come_from_the_seed_and_the_name_alone():
    names = [f"train/GOPR{k:04}_11_00" for k in range(2000)]
    seeds = [seed_of(1, name) for name in names]
    assert len({*seeds, *(seed_of(2, name) for name in names)}) == 4000
    assert all(0 <= seed < 1 << 48 for seed in seeds)
    # never another: files of before would not be made again
    assert seed_of(0, "a") == 0xD3B8411BDE7


@settings(max_examples=200, deadline=None)
@given(sizes=st.lists(st.integers(0, 10**9), max_size=60), count=st.integers(1, 9))
def test_shards_are_disjoint_complete_and_balanced(sizes, count):
    states = {f"s{k}": State(size, 1, 0) for k, size in enumerate(sizes)}
    shards = [shard_of(states, number, count) for number in range(1, count + 1)]
    assert sorted(name for shard in shards for name in shard) == sorted(states)
    held = [sum(states[name].bytes for name in shard) for shard in shards]
    # no more apart than the largest, as each goes where the fewest bytes are
    assert max(held) - min(held) <= max(sizes, default=0) + len(sizes)


def test_shards_do_not_depend_on_the_order():
    states = {f"s{k}": State(k * 37 % 11, 1, 0) for k in range(40)}
    shuffled = list(states.items())
    random.Random(1).shuffle(shuffled)
    for number in (1, 2, 3):
        assert shard_of(states, number, 3) == shard_of(dict(shuffled), number, 3)


@pytest.mark.parametrize("text", ["", "3", "0/3", "4/3", "a/b", "1/0", "-1/3", "1/3/5", "1 / 3"])
def test_a_shard_that_is_none(text):
    with pytest.raises(UsageError, match="must be I/N"):
        parse_shard(text)


def test_a_digest_tells_names_and_contents(tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        (folder / "deep").mkdir(parents=True)
        (folder / "deep" / "a").write_bytes(b"12")
        (folder / "b").write_bytes(b"3")
    assert digest_of(one) == digest_of(two)
    assert state_of(one).bytes == 3
    assert state_of(one).files == 2
    (two / "b").rename(two / "c")
    assert digest_of(one) != digest_of(two)
    (two / "c").rename(two / "b")
    assert digest_of(one) == digest_of(two)
    (two / "b").write_bytes(b"4")
    assert digest_of(one) != digest_of(two)
    assert digest_of(one / "b") == hashlib.sha256(b"3").hexdigest()
