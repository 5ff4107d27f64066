"""Networks that make images of events.

=============  ====================================================================================
textures       clips of photographs that move
clips          the clips of a training, GOPRO's or textures, and their events, which are kept
sequences      events and images side by side, and what a training draws of them
training       which networks there are, and the steps of their trainings
small          one small training with its test
scores         recordings to test on, and the measures
=============  ====================================================================================
"""
