"""Trainings of networks, whatever they learn.

=============  ====================================================================================
training       one training, which can be stopped and taken up again
jobs           trainings of several configurations and seeds, each done once
seeds          which differences between configurations their seeds carry
options        what the commands have in common
=============  ====================================================================================
"""
