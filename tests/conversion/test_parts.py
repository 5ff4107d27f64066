"""Parts of a conversion: what is stored is what is read, or nothing; and how they are merged."""

import numpy as np
import pytest
from pictures import picture

from adv2e.causes import with_cause
from adv2e.config import load_config
from adv2e.conversion import parts
from adv2e.conversion.parts import make_part, merged, read_part, told_of_part
from adv2e.conversion.reading import Reading
from adv2e.conversion.simulation import events_from_light
from adv2e.errors import DataError
from adv2e.events import make_events, sort_events


@pytest.fixture
def stack(tmp_path):
    np.save(tmp_path / "a.npy", np.stack([picture(k) for k in range(4)]))
    return tmp_path / "a.npy"


def stored(stack, share=(1, 1), **options):
    path = stack.with_name(f"{share[0]}.part")
    config = load_config((), ("frames.encoding=linear",))
    with Reading(str(stack), fps=100, threads=2) as reading:
        make_part(reading, path, "key", share, config=config, **options)
    return path, config


@pytest.mark.parametrize("causes", [False, True])
def test_a_part_holds_what_was_made(stack, causes, monkeypatch):
    monkeypatch.setattr(parts, "BLOCK", 100)
    path, config = stored(stack, causes=causes)
    light = ((k * 10**7, picture(k).astype(np.float32)) for k in range(4))
    made = np.concatenate(list(events_from_light(light, config, causes=causes)))
    found = list(read_part(path, "key", causes))
    assert np.concatenate(found).tobytes() == made.tobytes()
    assert made.size > 1000
    assert {block.size for block in found[:-1]} == {100}


def test_a_part_without_pixels_has_no_events(stack):
    path, _ = stored(stack, (2, 2), causes=False)
    assert list(read_part(path, "key", False)) == []
    assert told_of_part(path, "key", False)["seconds"] >= 0


def test_damage_is_seen_or_does_no_harm(stack, tmp_path):
    path, _ = stored(stack, causes=False)
    text = path.read_bytes()

    def content():
        told = {}
        return np.concatenate(list(read_part(path, "key", False, told))).tobytes(), told

    whole, harmless = content(), []
    assert told_of_part(path, "another", False) is None
    assert told_of_part(path, "key", True) is None
    assert told_of_part(tmp_path / "none.part", "key", False) is None
    for k in {*range(30), *range(30, len(text) - 60, 97), *range(len(text) - 60, len(text))}:
        path.write_bytes(text[:k])
        with pytest.raises(DataError, match=r"1\.part: is damaged"):
            content()
        path.write_bytes(text[:k] + bytes([text[k] ^ 1 << k % 8]) + text[k + 1 :])
        if told_of_part(path, "key", False) is not None:
            harmless.append(k)  # bits between the last of a block and its checksum
            assert content() == whole
    assert len(harmless) <= 2
    path.write_bytes(text + b"x")
    assert told_of_part(path, "key", False) is None


@pytest.mark.parametrize("seed", range(6))
def test_merged_is_sorted_as_a_whole(seed):
    draw = np.random.default_rng(seed)
    count, pixels = 3000, 40
    # times of a few and of many events; parts that begin late, end early, and have none
    t = np.sort(draw.integers(0, (30, 4000)[seed % 2], count))
    x = draw.integers(0, pixels, count)
    events = make_events(t, x, np.zeros(count, int), draw.integers(0, 2, count))
    whole = sort_events(with_cause(events, draw.integers(0, 3, count)))
    borders = [0, 3, 3, 10, 11, 30, 31]
    split = [
        whole[(whole["x"] >= a) & (whole["x"] < b)]
        for a, b in zip(borders, [*borders[1:], pixels], strict=True)
    ]
    split[4] = split[4][split[4]["t"] < t[count // 3]]
    wanted = np.concatenate(split)
    wanted = sort_events(wanted)

    def blocks(part):
        size = int(draw.integers(1, 90))
        return (part[k : k + size] for k in range(0, part.size, size))

    found = list(merged([blocks(part) for part in split]))
    assert np.concatenate(found).tobytes() == wanted.tobytes()
    assert all(one.size for one in found)
    assert max(one.size for one in found) <= (2 if seed % 2 else 12) * 7 * 90


def test_nothing_merged_is_nothing():
    assert list(merged([iter(()), iter(())])) == []
