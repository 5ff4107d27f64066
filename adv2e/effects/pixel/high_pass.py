"""High-pass between the photoreceptor and the comparator: slow changes are forgotten.

    v = y - q,    dq/dt = 2 pi f_h (y - q),    so that    v(s) = s / (s + 2 pi f_h) y(s)

y           output of the photoreceptor (low_pass, then source_follower), with its noise
q           what follows it slowly; at the first frame equal to y without noise, as the pixel is at
            rest; what it has of the noise is drawn together with that, as at any moment
v           what the comparator sees
f_h         cutoff_hz

After an edge the signal goes back to where it was, with the time constant 1/(2 pi f_h), so that an
edge of ON events is followed by OFF events.  What changes by less than a threshold in that time
makes no event at all.  Noise below f_h is lost as well.  What the readout of frames, or an effect
of your own, adds to the signal comes behind the filter.  References that have run beside noise
are right within some percent: see initial_reference.

Prophesee's bias_hpf "controls the pixel high-pass filter"; its order and its place in the circuit
are not published, and neither is the cutoff of any setting.  The equation is that of [1].

Compiled in adv2e/kernel/stepped/signal.py.

References
----------
[1] W. F. Low, G. H. Lee, "Deblur e-NeRF: NeRF from motion-blurred events under high-speed or
    low-light conditions", ECCV 2024, arXiv:2409.17988; the filter is in the simulator published
    with it, github.com/wengflow/rpg_esim, pixel_bandwidth_model.hpp (hpf_cutoff_freq_hz).
[2] Prophesee, "Biases", docs.prophesee.ai/stable/hw/manuals/biases.html.
"""

from __future__ import annotations

from dataclasses import dataclass

from adv2e.parameters import Fit, Section, parameter

SEPARATED_BY = {
    "high_pass": "a single edge, then light that stays: events of the other polarity follow by"
    " themselves, each later than the one before; and slow ramps, which make no events"
}


@dataclass(frozen=True, kw_only=True)
class HighPass(Section):
    """High-pass ahead of the comparator."""

    cutoff_hz: float = parameter(
        unit="Hz",
        meaning="corner (-3 dB) below which changes are forgotten",
        above=0,
        fit=Fit(0.01, 1e3, 3.0, log=True, starts=(0.3, 3.0, 30.0)),
    )
