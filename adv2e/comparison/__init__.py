"""How far two event streams are apart: distances, counts, inter-event times and noise floors.

======================  ======================================================================
``windows.py``          over which stretches of time two recordings are compared
``grids.py``            the voxel grid ("temporal bins") of a window
``distances.py``        distances between grids, each with its definition
``smoothed_error.py``   distance between the streams smoothed in time, pixel by pixel
``pairs.py``            the compiled sum that this takes
``trains.py``           events as one train a pixel
``counts.py``           counts, rates and ON share
``intervals.py``        times between events of one pixel
``offset.py``           how much later the simulated events come
``floor.py``            the same distances where only noise differs
``resimulation.py``     a configuration and frames as a function of the seed
``compare.py``          all of it as one dictionary
``report.py``           the dictionary as a table for people
======================  ======================================================================
"""
