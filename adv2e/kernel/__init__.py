"""The compiled part of the pixel: plain numbers and arrays in, events out.

Three solvers, each a strip of pixels at a time through all intervals:

``exact``           the exact circuit of one pole: ``screen`` takes all pixels to the end of an
                    interval and finds those that may fire, ``lanes`` solves these side by side,
                    and ``static_pixels`` a strip at rest in closed form
``unfiltered``      no filter, leak or noise of the photoreceptor: the next frame shows which
                    pixels may fire, and these go through the instants before it
``stepped``         everything else, in steps of time: the K-step forms, no low-pass but leak,
                    noise, drift or a second pole, the last interval as printed, slew limit,
                    high-pass, and what acts on the pixels from outside

and what they share:

``inputs``          parameters of the circuit, frames and intervals, and the light of a strip
``per_pixel``       rows of the state of each pixel; initial thresholds (mismatch) and reference
``comparator``      tolerance of a crossing, how an event fires and why, and memory for events,
                    which grows
``leak``, ``noise``  fall of the reference by leak; shot noise, hot pixels, photoreceptor noise
``quadrature``      Gauss rules for the lag at the end of an interval, or of a dead time
``special``         exponential and logarithm that vectorise and give the same bits everywhere
``rng``             random numbers as functions of seed, effect, pixel and draw
``work_queue``      strips handed out to threads
``packing``         packed events into order

Beside the pixel, ``effect_loops`` holds the loops of effects on frames and events.

Where the time goes
-------------------
One core, nanoseconds a pixel and frame unless it says otherwise, by
``scripts/benchmarks/speed.py``, ``scripts/benchmarks/limits.py`` at commit b916649, and ``perf``;
the parts are of an AMD EPYC (Zen 5), in brackets what an Intel Xeon of half that speed takes.

==================================== ===========================================================
what the machine allows              memory 35 (15) GB/s, so that a float32 frame is read in 0.1
                                     (0.3); polynomials of degree 6 in float32 12 (7.8) G/s; event
                                     text 90 (75) Mev/s; HDF5 with zlib 14 (12) Mev/s
first pass, moving strip             2.5 (5.8), of which 7 nodes of the quadrature 1.5: arithmetic
                                     bounds it (two polynomials of degree 6 a node: 1.2 at the rate
                                     above); the rest is decoding, the logarithm and the bounds
first pass, strip at rest            0.2 (0.5): comparing the grey values
pixels that may fire (7 to 13 %)     40 each in lanes: 9 evaluating the integral, 7 the Taylor
                                     polynomial, the rest gathering, deciding and writing back
the same behind two poles            (600 each in its lanes: of a hundred, 47 finding the next
                                     substep one by one, 19 its signal, 13 its bounds, 8 the root)
a pixel in pieces                    about 200, two at the knee of the log map between two frames
a step of all pixels, ``stepped``    5 to 9, of which poles 2 to 3, photoreceptor noise 2 and
                                     screening 1; half of that with one pole and nothing else;
                                     0.5 us more for an event
sorting and unpacking                6 an event
==================================== ===========================================================

The pixel makes 5 to 11 Mev/s on both cores of the Xeon; text is written at 50 and HDF5, with the
extra ``fast``, at some 14 Mev/s there.  So the pixel bounds a conversion, and decoding that of a
video in which little moves.  We are over twice from the arithmetic limit wherever pixels fire: a
lane is 40 ns where its arithmetic alone would be some 15, as what each pixel needs lies scattered.

All effects with 5 Hz of shot noise cost 1.5 times what noise off does (346x260, 240 frames a
second; processor time on the Xeon).  Of the difference, ends of dead times take about 30 parts of a
hundred (a rule of 4 nodes from the event on), pixels into lanes and out 20, noise events 17, as
they are drawn one by one, the further places and events 20, and leak and the first draws of all
pixels 5 each.
"""
