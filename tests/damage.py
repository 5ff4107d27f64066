"""Files that are damaged, as hypothesis draws them: a reader takes them or refuses them."""

from hypothesis import strategies as st

from adv2e.errors import DataError
from adv2e.formats.reading import read_events


@st.composite
def damages(draw, good: bytes):
    """Bytes of a file of which some are changed, lost or added."""
    data = bytearray(good)
    for _ in range(draw(st.integers(0, 4))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    if draw(st.booleans()):
        del data[draw(st.integers(0, len(data))) :]
    return bytes(data) + draw(st.binary(max_size=9))


def read_or_refused(path, most_events):
    """Read a file to its end, frames too; DataError, of one line that names it, is well."""
    try:
        recording = read_events(path)
        frames = sum(1 for _ in recording.images())
    except DataError as error:
        assert str(path) in str(error) and "\n" not in str(error)
    else:
        assert recording.events.size + frames <= most_events
