"""What the coded pictures of a video say of themselves, and what reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

from adv2e.sources.video.colours import Colours


@dataclass
class Stream:
    """What the coded pictures of a video say of themselves; grows as they are read.

    Attributes
    ----------
    codec : str
        Its name, or the four letters by which FFmpeg knows it; ``raw`` for pictures not coded.
    known : bool
        It is known how its coded pictures say whether they are fields.
    clear : bool
        All of them could be read.
    interlaced : bool
        A picture is flagged as two fields, or could be.
    colours : list of Colours
        All that are stated, in the order met, none twice.
    """

    codec: str
    known: bool = True
    clear: bool = True
    interlaced: bool = False
    colours: list[Colours] = field(default_factory=list)

    def state(self, stated: Colours) -> None:
        """Note colours that are stated."""
        if stated not in self.colours:
            self.colours.append(stated)


class Parser:
    """Reads what a codec writes about its pictures.

    Any of its methods may raise IndexError or struct.error, where bytes are missing.
    """

    def header(self, data: bytes, stream: Stream) -> None:
        """Read what stands before all pictures, if anything does."""

    def picture(self, data: bytes, stream: Stream) -> None:
        """Read one coded picture, or two fields."""
        raise NotImplementedError


class Bits:
    """Reads numbers packed into bits, first bit highest, one after another.

    Raises
    ------
    IndexError
        From every method, when the bytes end.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._place = 0

    def take(self, count: int) -> int:
        """Return the next `count` bits as a number."""
        begin, end = self._place, self._place + count
        if end > 8 * len(self._data):
            raise IndexError("the bits end")
        self._place = end
        whole = int.from_bytes(self._data[begin // 8 : -(-end // 8)], "big")
        return (whole >> (-end % 8)) & ((1 << count) - 1)

    def skip(self, count: int) -> None:
        """Pass over `count` bits."""
        self._place += count
        if self._place > 8 * len(self._data):
            raise IndexError("the bits end")

    def flag(self) -> bool:
        """Return the next bit."""
        return bool(self.take(1))

    def ue(self) -> int:
        """Return an unsigned number in the code of Exp-Golomb, of up to 32 bits."""
        zeros = 0
        while not self.take(1):
            zeros += 1
            if zeros > 32:
                raise IndexError("no number")
        return (1 << zeros) - 1 + self.take(zeros)

    def se(self) -> int:
        """Return a signed number in the code of Exp-Golomb."""
        code = self.ue()
        return (code + 1) // 2 if code % 2 else -(code // 2)
