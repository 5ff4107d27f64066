"""Simulators under one interface: each turns a clip of light into events.

=============  ====================================================================================
clip           frames of light and their times, in-between frames
pixel          configurations of adv2e, also such with the parameters of another tool
voltmeter      DVS-Voltmeter: its published equations
eventcv        EventCV: the tool itself, where it is installed
v2e            v2e: the tool itself, from a folder of its sources
by_file        any other, by the events that it wrote
named          all of them by name
=============  ====================================================================================
"""
