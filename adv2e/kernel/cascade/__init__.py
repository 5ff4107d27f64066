r"""The two poles, one behind the other, without small steps of time.

``plan`` cuts intervals into substeps, ``screen`` advances all pixels of a strip through them and
tells which may fire, and ``lanes`` finds the events of those that may, beside their photoreceptor
noise, too; there, ``second_look`` tells more closely which may.  ``substep`` is the signal of one
pixel within a substep, and finds its events there where ``lanes`` cannot tell.

Within a substep the light, and with it the corner w of the first pole, is known.  With u = y - x
the lag of the first pole, t = 0..1 over the substep, a the integral of w and c its change,

.. math:: u_1 = e^{-a} u_0 - d\,\Bigl(\varphi(a) - \frac{c}{2} \int_0^1 v (1 - v) e^{-a v} dv\Bigr),
          \qquad \varphi(a) = (1 - e^{-a})/a

but for terms of c^2/240, d being what x moves by.  The lag is then the polynomial of degree 5 that
has its value, slope and curvature at both ends, all three of which the equation gives: it departs
from the lag by less than 2.2e-5 a^6 of it.  For such an input the second pole, of corner b in
substeps, has the solution

.. math:: q(t) = r(t) + (q_0 - r(0))\, e^{-b t}, \qquad r = p - r'/b

where r is a polynomial, too.  So q is exact at any b, whether the second pole is slower than the
first one or much faster.
"""
