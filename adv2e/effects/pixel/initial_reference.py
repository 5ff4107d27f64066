"""Initial reference: the value that each pixel holds when the first frame comes.

running     The scene has rested before a camera that was on.  Leak has gone on in it, and every
            pixel is somewhere in its leak cycle (see the effect leak).  Photoreceptor noise has
            made events, too, and each reference is what the last of them left.  Without leak and
            photoreceptor noise this is settled.
settled     All pixels remember the first frame, as right after a reset of the whole sensor.  By
            leak alone, they fire together a whole period later.
random      The scene moved before, as in a piece of a longer recording.  Each pixel may be anywhere
            on its way to its next event:

    x - x_ref is uniform between -C_off and C_on

A reference at which noise soon crosses a threshold is left soon.  So references that have run lie
where noise seldom does, and pixels fire less than those that are settled: by a factor of three in
the first second, where they have 0.03 events a second [2].  The last 200 resets of each pixel are
drawn one after another, and the time of the first frame is any time between them.

Noise behind high_pass follows no law of that kind.  It is taken for noise of two poles, or of one
without source_follower, that is as large and moves as fast.  The first second then has the events
of all others within some 3 %; 7 % fewer where the high-pass is faster than low_pass.

x is the log intensity of the first frame; C_on and C_off are the pixel's own thresholds.  The
choice shows in the first events of each pixel, and in the phases of its leak.

Compiled in adv2e/kernel/per_pixel.py (random), adv2e/kernel/leak.py and
adv2e/kernel/photoreceptor/running.py (running).

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE J. Solid-State Circuits 43(2), 2008, doi:10.1109/JSSC.2007.914337
    (the pixel remembers the light of its last event).
[2] D. R. Cox, "Renewal theory", Methuen, 1962, chapter 5 (what is met at any time is met as long as
    it lasts).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LABELS = {"initial_reference": "reference at the first frame"}

Array = NDArray[np.float64]

RUNNING, SETTLED, RANDOM = REFERENCES = ("running", "settled", "random")
