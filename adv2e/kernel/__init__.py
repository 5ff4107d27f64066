"""The compiled part of the pixel: plain numbers and arrays in, events out.

``special``     exponential and logarithm that vectorise and give the same bits everywhere
``polynomial``  the first crossing of a polynomial through two levels, without missing one
``workspace``   rows of the state and the small records that the compiled functions share
``solve``       one pixel over one interval: the circuit as short power series, or K steps
``comparator``  events of one pixel on one such series: thresholds, dead time, leak, noise
``screen``      all pixels of a strip over one interval: end values, and which may fire
``lanes``       places within an interval (thresholds, turns, given times) for many pixels at a time
``batch``       the pixels of a strip that may fire, from event to event
``exact``       the exact circuit over a tile: screen, batch, and the rest one by one
``stepped``     screens for all other circuits
``general``     all other circuits over a tile
``dense``       any circuit over a tile, in steps of time: what acts on the pixels from outside, and
                effects that the others do not have; ``dense_rows``, ``dense_signal`` and
                ``dense_events`` are its parts
``tile``        what the two drivers share
``order``       packed events into order

Where the time goes
-------------------
Figures of two cores of an AMD EPYC (Zen 5), by ``scripts/machine_limits.py`` and
``scripts/benchmark.py``; one core, nanoseconds a pixel and frame unless it says otherwise.

==================================== ===========================================================
what the machine allows              memory 35 GB/s (a float32 frame read once: 0.1), polynomials
                                     of degree 6 in float32 12 G/s, event text 90 Mev/s, HDF5 with
                                     deflate 14 Mev/s
first pass, moving strip             2.5, of which 7 nodes of the quadrature 1.5: arithmetic bounds
                                     it (two polynomials of degree 6 a node: 1.2 at the rate above)
first pass, strip at rest            about 0.2: comparing the grey values
pixels that may fire (7 to 13 %)     40 each in lanes: 9 evaluating the integral, 7 the Taylor
                                     polynomial, the rest gathering, deciding and writing back
a pixel by itself                    1,000 to 3,000: the knee between two frames, and the odd step
                                     of an e-fold; 0.6 % of such pixels cost as much as all others
a step of all pixels, ``dense``      5 to 9, of which poles 2 to 3, photoreceptor noise 2 and
                                     screening 1; 0.5 us more for an event
sorting and unpacking                6 an event
==================================== ===========================================================

Text and HDF5 are written at 57 and 11 Mev/s on both cores, so that a conversion with many events
is bound by deflate, one with few by the pixel, and L = 1 at low motion by decoding.  We are over
twice from the arithmetic limit wherever pixels fire: a lane is 40 ns where its arithmetic alone
would be some 15, as what each pixel needs lies scattered; and pixels are solved by themselves where
the light passes the knee, for which lanes would have to begin and end within the interval.
"""
