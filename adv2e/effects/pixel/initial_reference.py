"""Initial reference: the value that each pixel holds when the first frame comes.

running     The scene has rested before a camera that was on.  Leak has gone on in it, and every
            pixel is somewhere in its leak cycle (see the effect leak).  Without leak this is
            settled.
settled     All pixels remember the first frame, as right after a reset of the whole sensor.  By
            leak alone, they fire together a whole period later.
random      The scene moved before, as in a piece of a longer recording.  Each pixel may be anywhere
            on its way to its next event:

    x - x_ref is uniform between -C_off and C_on

x is the log intensity of the first frame; C_on and C_off are the pixel's own thresholds.  The
choice shows in the first events of each pixel, and in the phases of its leak.

Compiled in adv2e/kernel/per_pixel.py (random) and adv2e/kernel/leak.py (running).

References
----------
[1] P. Lichtsteiner, C. Posch, T. Delbruck, "A 128x128 120 dB 15 us latency asynchronous temporal
    contrast vision sensor", IEEE J. Solid-State Circuits 43(2), 2008, doi:10.1109/JSSC.2007.914337
    (the pixel remembers the light of its last event).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LABELS = {"initial_reference": "reference at the first frame"}

Array = NDArray[np.float64]

RUNNING, SETTLED, RANDOM = REFERENCES = ("running", "settled", "random")
