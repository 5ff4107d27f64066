"""A made scene of which the light is known at every instant, and clips of it.

:class:`Scene` gives the light itself, so that the truth at any rate can be had; a clip samples it
as a camera would.
"""

from __future__ import annotations

from adv2e.synthetic.scene import Scene

__all__ = ["Scene"]
