r"""Photoreceptor noise, drawn where it matters, without steps of time.

With w the corner of the low-pass, b that of a second pole, n the noise behind the first and s
behind both,

.. math:: dn = -w\,n\,dt + \sqrt{2 w}\,\sigma\,dW, \qquad \dot s = b\,(n - s)

is a linear, Gaussian and Markov process: (n, s) at one instant, given another, is normal with
moments in closed form, however far apart the two are.  So every pixel is drawn at few instants
of an interval, with moments that are those of its own corner.  Between two of them the process is
a bridge.  The bound that it exceeds with a chance of 1e-9 is known, too.  Only where this bound
reaches a threshold the bridge is drawn, by halves, down to cells so short that nothing is left to
draw.

``law`` has the moments by corner, ``strip`` draws all pixels of a strip, and ``path`` draws between
for those that may fire, side by side.  The corner is its mean over a piece of an interval.

References
----------
.. [1] D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its
   integral", Physical Review E 54, 1996, doi:10.1103/PhysRevE.54.2084.
"""
