"""The compiled part of the pixel: plain numbers and arrays in, events out.

``special``     exponential and logarithm that vectorise and give the same bits everywhere
``polynomial``  the first crossing of a polynomial through two levels, without missing one
``workspace``   scratch rows and the small records that the compiled functions share
``solve``       one pixel over one interval: the circuit as short power series, or K steps
``comparator``  events of one pixel on one such series: thresholds, dead time, leak, noise
``screen``      all pixels of a strip over one interval: end values, and which pixels can fire
``batch``       the usual crossings of a strip, gathered for ``items``, which solves many at a time
``tile``        a tile over several intervals: screen all, solve the few that can fire
"""
