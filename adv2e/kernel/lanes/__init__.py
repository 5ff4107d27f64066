"""Pixels that may fire, solved side by side from event to event.

``rows``     state of the lanes: a flat array with a row for each number
``roots``    intervals cut into pieces (at the knee of the log map, below an e-fold, in bright
             light), and places within a piece (thresholds, turns, given places), for all lanes
``targets``  crossings: events, resets of the reference, ends of refractory periods; next crossing
             of all lanes together; next target of one lane: extremum, noise event, crossing that
             leak may cause
``batch``    pixels into lanes and out of them, and all lanes through an interval
"""
