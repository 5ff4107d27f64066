"""Summary statistics: numbers by which a recording can differ from its simulations.

Each points to causes: numbers of events by speed and brightness to thresholds, noise and tone;
times between events to dead time and reset; the lag to poles and clocks; and so on.  None matches
events one to one, so noise has its place in all of them.
"""
