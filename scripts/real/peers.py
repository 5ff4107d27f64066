"""What other simulators reached on the same recordings, for the table beside.

Measured outside this project: frames at their own times with ten linearly blended sub-frames an
interval, ON and OFF thresholds set on the first half so that totals match, the tool's own
background noise off where marked q, scored on the second half as here.
"""

from __future__ import annotations

_CRADLE, _SLIDER, _EVBENCH = (
    "davis346-emlb-cradle",
    "davis240c-slider-depth-chunk",
    "davis240b-evbench-seq1",
)

_PEERS = {
    "DVS-Voltmeter": ((1.04, 1.01, 0.96), (1.07, 0.91, 0.64), (1.36, 1.44, 1.24)),
    "v2e": ((1.17, 1.13, 1.02), (1.17, 1.09, 0.77), (1.34, 1.34, 1.22)),
    "EventCV (q)": ((1.16, 1.10, 0.99), (1.14, 1.03, 0.75), (1.27, 1.24, 1.17)),
    "vid2e esim_py": ((1.37, 1.30, 1.01), (1.33, 1.31, 0.87), (1.27, 1.25, 1.15)),
    "IEBCS": ((1.33, 1.23, 1.00), (1.38, 1.34, 0.92), (1.18, 1.15, 1.07)),
    "Prophesee (q)": ((2.60, 2.39, 1.87), (3.89, 4.28, 3.00), (1.47, 1.38, 1.21)),
}
"""Distances by tool and recording: 5 bins, smoothed 5 bins, smoothed 1 bin."""


def peer_rows(recording: str) -> list[list[str]]:
    """Return a row a tool for a recording of that folder name, none for others."""
    names = (_CRADLE, _SLIDER, _EVBENCH)
    if recording not in names:
        return []
    column = names.index(recording)
    return [
        [tool, *(f"{value:.2f}" for value in values[column])] for tool, values in _PEERS.items()
    ]
