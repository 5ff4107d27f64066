"""Pixels that may fire, solved side by side from event to event.

``rows``          what is known of each lane: a flat array with a row for each number
``exchange``      pixels into lanes and out of them
``pieces``        intervals cut at the knee of the log map, below an e-fold, and in bright light
``roots``         places within a piece (thresholds, turns, given places) for all lanes at a time
``apply_events``  what becomes of lanes whose place was found: events, ends of dead times
``next_target``   what lanes look for next, for all of them together
``slow_path``     the same lane by lane: turns, noise events, what leak makes doubtful
``batch``         all lanes of a strip through an interval, by these
"""
