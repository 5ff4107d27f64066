"""The pixels of a strip that may fire, one a lane, from event to event through one interval.

A lane goes from place to place: the next crossing, the extremum of the signal where it may cross a
threshold before that, the end of a dead time, the next noise event, and at last the end of its
piece of the interval.  In each round all lanes search for one place each
(:mod:`adv2e.kernel.lanes.roots`), apply it (:mod:`adv2e.kernel.lanes.apply_events`), and then
choose the next target: most of them together (:mod:`adv2e.kernel.lanes.next_target`), the others
one by one (:mod:`adv2e.kernel.lanes.next_target`).  Pixels get into lanes, and out, by
:mod:`adv2e.kernel.lanes.exchange`, and from piece to piece by :mod:`adv2e.kernel.lanes.roots`.
"""

from __future__ import annotations

from adv2e.compiled import kernel
from adv2e.kernel.borrowing import borrowed
from adv2e.kernel.lanes import rows
from adv2e.kernel.lanes.apply_events import cross, fire_found, note_releases, release
from adv2e.kernel.lanes.exchange import sort_out
from adv2e.kernel.lanes.next_target import choose, found_stop, go_on
from adv2e.kernel.lanes.roots import evaluate, guess, next_piece, open_piece, refine
from adv2e.kernel.lanes.rows import whole


@kernel
def _waiting(m, lanes):
    """Return the number of lanes to search for ends of dead times: m, or 0 if none waits."""
    waiting = 0
    for j in range(m):
        waiting += lanes[rows.SEEKS + j] == rows.RELEASE
    return m if waiting > 0 else 0


@kernel
def decide(lo, m, waiting, interval, circuit, rule, state, memory, buffer, n):
    """Choose the next target of each of m lanes; none of them then waits for a dead time to end.

    All lanes that wait now are among the first `waiting` ones.

    Returns (lanes with a target, events so far); at most one event a lane is written.
    """
    (buffer,) = borrowed(buffer)
    pixels, lanes, length = memory.pixels, memory.lanes, interval.length
    while True:
        if waiting > 0:
            release(whole(waiting), length, circuit, rule, lanes)
            if circuit.causes:
                note_releases(lo, waiting, pixels, state, lanes)
        choose(whole(m), interval, circuit, lanes)
        for j in range(m):
            seeks = lanes[rows.SEEKS + j]
            if seeks in (rows.DOUBTFUL, rows.STUCK):
                n = go_on(lo + pixels[j], j, interval, circuit, state, lanes, buffer, n)
                seeks = lanes[rows.SEEKS + j]
            if seeks == rows.DONE and lanes[rows.END + j] < 1.0:
                next_piece(j, circuit, lanes)
        m = sort_out(lo, m, interval.origin, state, memory)
        waiting = _waiting(m, lanes)
        if waiting == 0:
            return m, n


@kernel
def search(lo, m, interval, circuit, rule, state, memory, buffer, n):
    """Find the target of every lane; returns the number of events, and `waiting` for `decide`.

    At most one event a lane is written.
    """
    pixels, lanes, length = memory.pixels, memory.lanes, interval.length
    count = whole(m)
    guess(lanes, count, length, circuit)
    evaluate(lanes, count, length, circuit, rule)
    refine(lanes, count, length, circuit)
    cross(count, interval, circuit, lanes)
    n = fire_found(lo, m, circuit, state, pixels, lanes, buffer, n)
    for j in range(m):
        seeks = lanes[rows.SEEKS + j]
        if seeks in (rows.INJECTED, rows.HALF) or (
            seeks == rows.TURN and lanes[rows.ERROR + j] <= rows.TOLERANCE
        ):
            found_stop(lo + pixels[j], j, circuit, state, lanes)
        elif seeks == rows.OPEN:
            open_piece(j, interval, lanes)
    return n, _waiting(m, lanes)
