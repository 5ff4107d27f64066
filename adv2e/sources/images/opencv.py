"""OpenCV without its own messages, and images from bytes.

OpenCV and the libraries in it print warnings about broken files to the terminal; ours is the one
line that people see.
"""

from __future__ import annotations

import importlib
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from adv2e.effects.frames.encoding import full_scale_of, is_light
from adv2e.errors import DataError, MissingExtraError
from adv2e.files.regular import reading
from adv2e.files.zips import Members
from adv2e.process.standard_error import Shared, overhearing
from adv2e.sources.frame import Frame, Image, check_pixels
from adv2e.sources.images import headers
from adv2e.sources.images.alpha import Alpha, with_alpha
from adv2e.sources.images.headers import Header, check_size, read_header

IMAGE_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm", ".pnm", ".pfm"),
    *(".webp", ".hdr", ".exr"),
)
"""Still images that can be read (``.exr`` with the optional package OpenEXR)."""


# OpenCV 5 has cv2.utils.logging, OpenCV 4 has it only as cv2.setLogLevel
_logging: Any = cv2.utils.logging if hasattr(cv2.utils, "logging") else cv2


def _silence() -> int:
    level: int = _logging.getLogLevel()
    _logging.setLogLevel(0)
    return level


quiet = Shared(_silence, _logging.setLogLevel)
"""Context in which OpenCV prints nothing about the pictures that it decodes."""


def rgb_of(image: Any) -> Image:
    """Return an image in OpenCV's channel order as grey or RGB, without alpha."""
    if image.ndim == 2:
        return np.asarray(image)
    if image.shape[2] == 1:
        return np.asarray(image[..., 0])
    if image.dtype == np.float64:  # beyond cvtColor
        return np.ascontiguousarray(image[..., 2::-1])
    code = cv2.COLOR_BGRA2RGB if image.shape[2] == 4 else cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(image, code))


def read_image(path: Path) -> Frame:
    """Return the image in a file, all its bits kept; DataError if it cannot be read."""
    with reading(path):
        data = path.read_bytes()
    return decode_image(data, str(path))


def image_of(files: Members, name: str) -> Frame:
    """Return an image of a folder or zip; DataError if it cannot be read."""
    return decode_image(files.read(name), files.label(name))


def decode_image(data: bytes, label: str) -> Frame:
    """Return the image in the bytes of a file: upright, grey or RGB, data type as stored.

    `label` is its name, for messages; its suffix tells EXR from the rest.

    Raises
    ------
    DataError
        If it is not an image that can be read, not all of it is there, or it holds several.
    MissingExtraError
        For EXR without the optional package.
    """
    if label.lower().endswith(".exr"):
        return _decode_exr(data, label)
    if re.match(rb"P[12347]\s", data):
        kinds = "PBM, PAM and plain PGM and PPM"
        raise DataError(f"{label}: {kinds} are not read; write raw ones, or PNG")
    if data.startswith(b"GIF8") or data[4:12] == b"ftypavis":
        raise DataError(f"{label}: is a GIF or AVIF of pictures, whatever its name; write PNG")
    if headers.is_tiff(data):
        examined = headers.examine(data, label)
        if examined is None:
            raise _unreadable(label)
        header, data = examined
        image, _, says = _decoded(data, label)  # upright
        return _frame(image, header, says, label)
    header = read_header(data)
    check_size(header.width, header.height, data, label)
    if header.pictures > 1:
        raise DataError(
            f"{label}: {header.pictures} pictures in it; give each frame a file of its own"
        )
    image, orientation, says = _decoded(data, label)
    image = upright(image, orientation)
    return _frame(image, header, header.says or says, label)


def _frame(image: Any, header: Header, says: str, label: str) -> Frame:
    """Return an image as OpenCV gives it, with what its header says of alpha, white and light."""
    colours, alpha, white = rgb_of(image), _fourth(image), header.white
    if not is_light(colours.dtype):  # its source refuses it
        return Frame(colours)
    if header.grey:
        colours = np.ascontiguousarray(colours[..., 0])
    elif header.clear is not None:
        there = np.iinfo(colours.dtype).max
        alpha = np.where(colours == header.clear, 0, there).astype(colours.dtype)
    if white is not None and colours.max() > white:
        above = f"above the {white:g} that its header states"
        raise DataError(f"{label}: a number of {colours.max()}, {above}")
    most = white or full_scale_of(colours.dtype)
    if header.inverted:
        colours = np.asarray(most - colours).astype(colours.dtype)
    stated: Any = {"white": white, "encoding": header.encoding, "says": says}
    stated["densities"] = header.densities
    if alpha is None:
        return Frame(colours, **stated)
    return replace(with_alpha(colours, alpha, header.alpha, most, label), **stated)


def upright(image: Image, orientation: int) -> Image:
    """Return an image as it is to be seen, from one as stored.

    `orientation` is where its first row and first column belong, as Exif counts it, 1 to 8.
    """
    if orientation >= 5:
        image = np.swapaxes(image, 0, 1)
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return np.ascontiguousarray(image)


_CUT = re.compile(
    rb"[Pp]remature end|bad Huffman code|found marker|[Ii]nconsistent progression|bad arithmetic"
)
"""Messages of libjpeg after which it fills the picture with grey.  Foreign bytes between parts do
no harm."""


def _decoded(data: bytes, label: str) -> tuple[Any, int, str]:
    """Return the image, the orientation that its Exif states, and a warning about it."""
    image: Any = None
    orientation, says = 1, ""
    if data and _is_whole(data):
        try:
            with quiet, overhearing() as said:
                image, kinds, contents = cv2.imdecodeWithMetadata(
                    np.frombuffer(data, np.uint8), flags=cv2.IMREAD_UNCHANGED
                )
                if _CUT.search(said()):
                    image = None
        except cv2.error as error:
            if error.code == cv2.Error.StsNoMem:
                raise MemoryError(f"{label}: {error.err}") from error
            image = None
    if image is None:
        raise _unreadable(label)
    for kind, content in zip(kinds, contents, strict=True):
        if kind == cv2.IMAGE_METADATA_EXIF:
            orientation = headers.orientation(content.tobytes().removeprefix(b"Exif\0\0"))
        elif kind == cv2.IMAGE_METADATA_ICCP:
            says = "its colour profile is not read"
    return image, orientation, says


def _unreadable(label: str) -> DataError:
    return DataError(f"{label}: not an image that can be read, or damaged")


def _fourth(image: Any) -> Any:
    return image[..., 3] if image.ndim == 3 and image.shape[2] == 4 else None


def _is_whole(data: bytes) -> bool:
    # OpenCV 4 fills the missing part of a cut JPEG with grey; after the last scan begins, the end
    # marker cannot occur within the picture's data
    return not data.startswith(b"\xff\xd8") or data.find(b"\xff\xd9", data.rfind(b"\xff\xda")) > 0


def _decode_exr(data: bytes, label: str) -> Frame:
    # not through OpenCV: its wheels differ in whether they read EXR at all
    try:
        openexr: Any = importlib.import_module("OpenEXR")
    except ImportError as error:
        raise MissingExtraError(f"{label}: reading EXR", "exr") from error
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "image.exr"  # the package reads only files
        copy.write_bytes(data)
        try:
            with openexr.File(str(copy), header_only=True) as file:
                for part in file.parts:
                    (left, top), (right, bottom) = part.header["dataWindow"]
                    check_pixels(int(right) - int(left) + 1, int(bottom) - int(top) + 1, label)
            with openexr.File(str(copy)) as file:
                parts = len(file.parts)
                channels = {name: channel.pixels for name, channel in file.channels().items()}
        except (RuntimeError, ValueError) as error:
            raise _unreadable(label) from error
    if parts > 1:
        raise DataError(f"{label}: {parts} parts in it; give each frame a file of its own")
    for name in ("RGB", "RGBA", "Y"):
        if name in channels:
            image = np.asarray(channels[name], dtype=np.float32)
            alpha = channels.get("A") if image.ndim == 2 or image.shape[2] < 4 else image[..., 3]
            colours = np.ascontiguousarray(image[..., :3]) if image.ndim == 3 else image
            if alpha is None:
                return Frame(colours)
            # by convention its colours are light that is multiplied by alpha
            return with_alpha(colours, np.asarray(alpha), Alpha.MULTIPLIED, 1.0, label)
    raise DataError(f"{label}: EXR without channels R, G, B or Y; it has {', '.join(channels)}")
