"""Which effects are simulated often enough to compare them."""

from made_up.sampler import RECORDING, MadeUpSampler, candidates, search_of

from adv2e.config import load_config
from adv2e.diagnosis.fitting.candidates import Candidate
from adv2e.diagnosis.selection.reference import CATCHES_UP, SOME
from adv2e.diagnosis.selection.shortlist import FEW, shortlisted
from adv2e.diagnosis.statistics.summary import BOTH

NOISE = ["pixel.shot_noise.rate_hz=1"]  # of which there can be less, too


def test_a_third_form_of_an_effect_keeps_no_other_effect_out():
    """All three forms of other thresholds do as well; shot noise is the best of the others."""
    alike = {"pixel.thresholds.off": "pixel.thresholds.on"}
    sampler = MadeUpSampler(strength=4.0, alike=alike)
    observed = sampler.measure(load_config([], ["pixel.thresholds.on=0.3", *NOISE]), RECORDING)
    search = search_of(sampler, observed, load_config([], NOISE), candidates())
    assert sum(one.name == "thresholds" for one in search.candidates) == 3
    trials = shortlisted(search.reference, search.declared, search.candidates)
    names = [trial.name for trial in trials]
    assert names[:3] == ["thresholds", "thresholds", "shot_noise"]
    assert len(names) == 6


def test_what_changes_chance_alone_is_simulated_often_whatever_its_misfit():
    """A start at random moves no mean here, and six others lower the misfit."""
    sampler = MadeUpSampler(strength=4.0)
    observed = sampler.measure(load_config([], ["pixel.thresholds.on=0.3", *NOISE]), RECORDING)
    extra = (("pixel.initial_reference", "random"),)
    for of_chance in (False, True):
        start = Candidate("initial_reference", (), ((),), extra, of_chance=of_chance)
        search = search_of(sampler, observed, load_config([], NOISE), [*candidates(), start])
        trials = shortlisted(search.reference, search.declared, search.candidates)
        assert ("initial_reference" in [trial.name for trial in trials]) == of_chance


def test_an_effect_far_behind_is_simulated_less_often_and_one_that_may_be_first_is_not():
    """Leak and what is like it do as well; what is left of others is far beyond chance."""
    alike = {"pixel.shot_noise.rate_hz": "pixel.leak.rate_hz"}
    sampler = MadeUpSampler(strength=25.0, alike=alike)
    observed = sampler.measure(load_config([], ["pixel.leak.rate_hz=0.6"]), RECORDING)
    search = search_of(sampler, observed)
    trials = shortlisted(search.reference, search.declared, search.candidates)
    count = {trial.name: len(trial.ensembles[BOTH].sample) for trial in trials}
    assert {trial.name for trial in trials[:2]} == {"leak", "shot_noise"}
    assert count.pop("leak") == count.pop("shot_noise") == SOME
    assert set(count.values()) == {FEW}
    assert all(trial.score < trials[0].score - CATCHES_UP for trial in trials[2:])
