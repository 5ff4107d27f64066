"""``recipe.json`` of a batch, and the set that is made by it again."""

import json
import shutil

import pytest
from trees_of_batch import clip, made_in

import adv2e


@pytest.fixture
def source(tmp_path):
    root = tmp_path / "from"
    clip(root / "cat" / "a.avi", count=4)
    clip(root / "dog" / "b.avi", count=4, start=2)
    return root


OWN = """
from dataclasses import dataclass
from adv2e.effects.hooks import Hooks
from adv2e.parameters import Section, parameter

@dataclass(frozen=True, kw_only=True)
class Parameters(Section):
    gain: float = parameter(1.5, unit="-", meaning="factor of the light", above=0)

class Brighter(Hooks):
    '''Light is brighter.'''
    stage = "frames"
    Parameters = Parameters
    def light(self, frames):
        for t_ns, light in frames:
            yield t_ns, light * self.parameters.gain
"""

LISTS = ("train.txt", "valid.txt")
LAW = ("--set", "pixel.thresholds.on={uniform: [0.1, 0.3]}")


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--export", "voxel", "--window", "7ms", "--bins", "3", "--crop", "2,3,20,16"),
        ("--export", "voxel", "--no-events"),
        ("--export", "nmnist", "--size", "20x16", "--fps", "24000/1001"),
        ("--export", "e2vid", "--format", "h5", "--causes"),
        ("--format", "txt"),
    ],
    ids=" ".join,
)
def test_a_set_is_made_again_byte_for_byte(batch, adv2e, source, tmp_path, words):
    first, again = tmp_path / "first", tmp_path / "again"
    assert batch(source, first, "--seed", 7, *LAW, *words).status == 0
    moved = tmp_path / "moved" / "sources"
    shutil.copytree(source, moved)
    clip(moved / "other.avi")  # is not in the recipe
    recipe = tmp_path / "mine.json"
    shutil.copy(first / "recipe.json", recipe)
    call = ("batch", "--recipe", recipe, moved, again)
    done = adv2e(*call)
    assert (done.status, "2 sequences: 2 made" in done.out) == (0, True), done.err
    # lists for E2VID say where DEST is
    made, expected = (
        {name: data for name, data in made_in(dest).items() if not name.endswith(LISTS)}
        for dest in (again, first)
    )
    assert made == expected
    assert len(made) >= 2
    assert (again / "recipe.json").read_bytes() == recipe.read_bytes()
    assert "2 kept" in adv2e(*call).err
    assert len(recipe.read_bytes()) < 20_000


@pytest.fixture
def made(batch, source, tmp_path):
    assert batch(source, tmp_path / "first", *LAW).status == 0
    return tmp_path / "first" / "recipe.json"


def test_in_python(made, source, tmp_path, monkeypatch):
    from trees_of_batch import in_this_process

    from adv2e.batches import processes

    monkeypatch.setattr(processes, "run", in_this_process)
    done = adv2e.batch(source, tmp_path / "again", recipe=made)
    assert (done.made, done.failed) == (2, {})


def test_what_comes_out_otherwise_is_told(made, adv2e, source, tmp_path, batch):
    told = json.loads(made.read_text())
    told["sequences"]["cat/a"]["output"] = "0" * 64
    told["versions"]["numpy"] = "0.1"
    made.write_text(json.dumps(told))
    done = adv2e("batch", "--recipe", made, source, tmp_path / "again")
    assert done.status == 1
    assert "1 made" in done.out
    assert "cat/a  its output is not that of the recipe: it was made with numpy 0.1" in done.err
    done = adv2e("batch", "--recipe", made, source, tmp_path / "again")
    assert (done.status, "0 made" in done.out) == (1, True)


@pytest.mark.parametrize(
    ("spoil", "words", "status", "said"),
    [
        (lambda told: told, ("--seed", "3"), 2, "says all: leave out --config, --set and --seed"),
        (lambda told: told, ("--export", "voxel"), 2, "says all: leave out --export"),
        (lambda told: told | {"adv2e": "9.9"}, (), 1, "made by adv2e 9.9, and no other makes"),
        (lambda told: told | {"settings": "0"}, (), 1, "of other effects or networks"),
        (lambda told: [], (), 1, "is no recipe of a batch"),
        (lambda told: told | {"more": 1}, (), 1, "is no recipe of a batch"),
        (lambda told: told | {"options": {"what": 1}}, (), 1, "what: is no option of a batch"),
        (
            lambda told: told | {"sequences": {**told["sequences"], "x": {}, "y": {}}},
            *((), 1, "x: is not there, and the recipe needs it, and 1 more"),
        ),
    ],
)
def test_what_cannot_be(made, adv2e, source, tmp_path, spoil, words, status, said, batch):
    made.write_text(json.dumps(spoil(json.loads(made.read_text()))))
    done = adv2e("batch", "--recipe", made, source, tmp_path / "again", *words)
    assert (done.status, said in done.err) == (status, True), done.err
    assert not (tmp_path / "again").exists()


def test_another_source_is_refused(made, adv2e, source, tmp_path, batch):
    clip(source / "cat" / "a.avi", count=4, start=1)
    done = adv2e("batch", "--recipe", made, source, tmp_path / "again")
    assert "a.avi: is not the source that the recipe names" in done.err
    assert "recipe: cannot be read" not in done.err
    done = adv2e("batch", "--recipe", tmp_path / "no", source, tmp_path / "again")
    assert "no: cannot be read: No such file or directory" in done.err


def test_shards_write_one_recipe(batch, made, source, tmp_path):
    for part in ("1/2", "2/2"):
        assert batch(source, tmp_path / "parts", *LAW, "--shard", part).status == 0
    assert (tmp_path / "parts" / "recipe.json").read_bytes() == made.read_bytes()


def test_effects_of_the_users_own_must_be_the_same(batch, adv2e, source, tmp_path):
    effect = tmp_path / "own.py"
    effect.write_text(OWN)
    batch(source, tmp_path / "first", "--effect", effect)
    call = ("batch", "--recipe", tmp_path / "first" / "recipe.json", source, tmp_path / "again")
    assert "effects of your own need their file: --effect FILE.py" in adv2e(*call).err
    other = tmp_path / "other.py"
    other.write_text(OWN.replace("light * self", "light / self"))
    assert (
        "is of other effects or networks: give --effect FILE" in adv2e(*call, "--effect", other).err
    )
    assert adv2e(*call, "--effect", effect).status == 0
    assert made_in(tmp_path / "again") == made_in(tmp_path / "first")
