"""Effects of fewer parameters than those of the library."""

from adv2e.diagnosis.fitting.candidates import Candidate, FitParameter

BLACK_LEVEL = Candidate(
    "black_level", (FitParameter("frames.black_level_dn", 0.02, 100.0),), ((2.0,), (14.0,))
)
