"""Edges that pass pixels at known times and stop suddenly, and what events tell of it.

=============  ====================================================================================
edges          the scene: edges between grey levels, exact light at any time
truth          its events by a dense solution of the circuit, and by a camera by brute force
measures       latencies after the passage, events after the stop, distances of distributions
sweeps         edges in a real recording, timed by the exposures that they blur
report         tables and the picture
=============  ====================================================================================
"""
