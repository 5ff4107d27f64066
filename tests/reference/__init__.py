"""Independent statements of the pixel, against which the package is tested.

Nothing here imports the package.  ``twin`` is slow and obvious and knows every part of the pixel;
``dense_ode`` knows the exact update only and is accurate far below a microsecond; ``stimuli`` makes
inputs for both; ``agreement`` compares events pixel by pixel.  The two solvers share the records in
``circuit`` and nothing else.
"""
