"""Effects of fewer knobs than those of the library."""

from adv2e.diagnosis.fitting.candidates import Candidate, Knob

BLACK_LEVEL = Candidate(
    "black_level", (Knob("frames.black_level_dn", 0.02, 100.0),), ((2.0,), (14.0,))
)
