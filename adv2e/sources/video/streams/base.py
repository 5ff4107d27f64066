"""What is gathered from the coded pictures of a video."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from adv2e.sources.video.colours import Colours


@dataclass
class Findings:
    """What the coded pictures say; grows as they are read.

    Attributes
    ----------
    interlaced : bool
        A picture is flagged as two fields, or could be.
    transparent : bool
        Pixels could be transparent, where the codec decides it.
    colours : list of Colours
        All that are stated, in the order met, none twice.
    """

    interlaced: bool = False
    transparent: bool = False
    colours: list[Colours] = field(default_factory=list)

    def state(self, stated: Colours) -> None:
        """Note colours that are stated."""
        if stated not in self.colours:
            self.colours.append(stated)


class Parser(Protocol):
    """Reads what a codec writes about its pictures.

    Any of its methods may raise IndexError or struct.error, where bytes are missing.
    """

    def header(self, data: bytes, findings: Findings) -> None:
        """Read what stands before all pictures, and may be empty."""

    def picture(self, data: bytes, findings: Findings) -> None:
        """Read one coded picture, or two fields."""
