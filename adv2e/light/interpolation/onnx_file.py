"""Networks that make the frame between two, from ONNX files (extra ``onnx``: onnxruntime).

What a file must take and give:

=========  =============================================  ==========================================
input      shape                                          meaning
=========  =============================================  ==========================================
2 images   (1, C, rows, columns), or channels last        first and second frame; C is 1 or 3
time       one number, of any shape, or a plane           share of the way, above 0 and below 1
=========  =============================================  ==========================================

The images are told from the time by their shapes, and by names with ``time`` in them.  The image
whose name ends in the lower number is the first one, else the one that the file lists first.  There
may be no time: such a network makes the middle of two frames.  A single input of 7 channels, or 6,
holds both images and a plane of the time.  The output is ``output``, ``image`` or the only one: one
image of the size of the inputs.

Values lie in 0..1 of white, encoded as what the network was trained on.  That is sRGB unless the
property ``encoding`` of the file's metadata says another (linear, srgb, bt709, gamma:<g>): videos
hold such numbers.  All three channels get the brightness, and the light of those that come back is
weighed to luma.  Rows and columns are those of the file, or multiples of its property ``multiple``,
64 without it.

Exports that fit, with the names of their inputs and outputs:

- Super SloMo by ``scripts/export_superslomo.py``, RIFE 4.0 by ``scripts/export_rife.py``, and other
  exports of RIFE 4: ``img0``, ``img1``, ``timestep``; ``output``;
- RIFE 4, as vs-mlrt publishes it in ``rife_v2/``: ``input`` of 7 channels; ``output``;
- FILM, by tf2onnx from its saved model: ``x0``, ``x1``, ``time``, channels last; ``image``;
- FILM, from its PyTorch form: ``img0``, ``img1``, ``timestep``; ``output``, of one size.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adv2e.effects.frames.encoding import LUMA_WEIGHTS, decode_values, encode_light
from adv2e.errors import ConfigError, DataError, MissingExtraError
from adv2e.files.regular import check_ends, shown

MULTIPLE = 64
"""Rows and columns are multiples of it where the file says nothing: enough for RIFE and FILM."""

_KEY = "sampling.model"
_FITS = "two images (1, 1 or 3, rows, columns), a time or none, and one image out"
_TYPES: dict[str, type[np.floating[Any]]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
}
_CHANNELS = (1, 3, 6, 7)
_MULTIPLE_MOST = 1024


@dataclass(frozen=True)
class _Given:
    """An input as the file declares it: lengths, or their names."""

    name: str
    kind: str
    shape: tuple[int | str | None, ...]


@dataclass(frozen=True)
class _Image:
    """An input that takes images."""

    name: str
    kind: type[np.floating[Any]]
    channels: int
    last: bool
    """Channels are the last axis rather than the second."""
    size: tuple[int | None, int | None]

    def array(self, planes: Sequence[NDArray[Any]]) -> NDArray[Any]:
        axis = -1 if self.last else 0
        return np.ascontiguousarray(np.stack(planes, axis)[np.newaxis], self.kind)


@dataclass(frozen=True)
class _Time:
    """An input that takes the share of the way."""

    name: str
    kind: type[np.floating[Any]]
    shape: tuple[int | None, ...]
    """None: as long as the image is there, of a plane, else 1."""

    def array(self, share: float, rows: int, columns: int) -> NDArray[Any]:
        long = (1, 1, rows, columns) if len(self.shape) == 4 else (1,) * len(self.shape)
        return np.full([a or b for a, b in zip(self.shape, long, strict=True)], share, self.kind)


class Network:
    """Neural network that interpolates a frame between two; many threads may use it at once.

    Attributes
    ----------
    source : mapping
        Name and SHA-256 of the file.
    encoding : str
        Encoding of the values that it takes and gives.
    size : (int or None, int or None)
        The only rows and columns that it takes.
    multiple : int
        Rows and columns that `size` leaves open must be multiples of it.
    knows_time : bool
        Whether it makes frames at any time rather than in the middle.
    """

    PACKAGES = ("onnxruntime",)
    """Packages that run the network."""

    def __init__(self, path: str, data: bytes) -> None:
        self.source = {"file": shown(Path(path).name), "sha256": hashlib.sha256(data).hexdigest()}
        self._label = f"{_KEY}: {path}"
        self._session, given, outputs, stated = _open(self._label, data)
        self.encoding, self.multiple = self._encoding(stated), self._multiple(stated)
        self._given = given
        self._images, self._time = self._inputs()
        self._output = self._only_output(outputs)
        first = self._images[0]
        self.size = first.size
        self.knows_time = self._time is not None or first.channels == 7

    @property
    def text(self) -> str:
        when = "at any time" if self.knows_time else "in the middle of two"
        colour = "colour" if self._images[0].channels > 1 else "grey"
        return f"{self.source['file']}: {colour}, {self.encoding}, {when}"

    def value(self, light: NDArray[Any]) -> NDArray[np.float32]:
        return encode_light(light.astype(np.float32, copy=False), self.encoding)

    def ask(
        self, first: NDArray[np.float32], second: NDArray[np.float32], share: float
    ) -> NDArray[np.float32]:
        """Return the light [DN] at a share of the way between two frames.

        Parameters
        ----------
        first, second : (rows, columns)
            As :meth:`value` returns them, of a size that it takes.
        share : float
            0.5 where it does not know of time.

        Raises
        ------
        DataError
            It fails, or gives something else than an image of that size.
        """
        inputs = self._feed(first, second, share)
        try:
            (made,) = self._session.run([self._output], inputs)
        except Exception as error:
            rows, columns = first.shape
            raise DataError(
                f"{self._label}: fails on images of {columns}x{rows}: {_one_line(error)}; if it"
                f" needs multiples of another number than {self.multiple}, state that as"
                " 'multiple' in its metadata"
            ) from None
        return self._light(made, first.shape)

    def _feed(
        self, first: NDArray[Any], second: NDArray[Any], share: float
    ) -> dict[str, NDArray[Any]]:
        image = self._images[0]
        if len(self._images) == 1:
            planes = [first] * 3 + [second] * 3
            planes += [np.full_like(first, share)] * (image.channels - len(planes))
            return {image.name: image.array(planes)}
        inputs = {
            one.name: one.array([values] * one.channels)
            for one, values in zip(self._images, (first, second), strict=True)
        }
        if self._time is not None:
            inputs[self._time.name] = self._time.array(share, *first.shape)
        return inputs

    def _light(self, made: NDArray[Any], shape: tuple[int, ...]) -> NDArray[np.float32]:
        planes = np.asarray(made)
        if planes.ndim == 4 and planes.shape[0] == 1:
            planes = np.moveaxis(planes[0], -1, 0) if self._images[0].last else planes[0]
        if planes.ndim != 3 or planes.shape[0] not in (1, 3) or planes.shape[1:] != shape:
            raise DataError(
                f"{self._label}: gives {np.shape(made)} for images of {shape}, must be one image of"
                " 1 or 3 channels and of that size"
            )
        weights = LUMA_WEIGHTS if planes.shape[0] == 3 else (1.0,)
        light = np.zeros(shape, np.float32)
        for plane, weight in zip(planes, weights, strict=True):
            values = np.maximum(plane.astype(np.float32), 0)
            light += np.float32(weight) * decode_values(values, self.encoding, 1.0)
        return light

    def _encoding(self, stated: Mapping[str, str]) -> str:
        encoding = stated.get("encoding", "srgb")
        try:
            encode_light(np.zeros(1, np.float32), encoding)
        except ConfigError as error:
            raise ConfigError(f"{self._label}: its metadata: {error}") from None
        return encoding

    def _multiple(self, stated: Mapping[str, str]) -> int:
        text = stated.get("multiple", str(MULTIPLE))
        if not re.fullmatch(r"[0-9]{1,4}", text) or not 1 <= int(text) <= _MULTIPLE_MOST:
            raise ConfigError(
                f"{self._label}: its metadata: multiple: must be a whole number from 1 to"
                f" {_MULTIPLE_MOST}, got {text!r}"
            )
        return int(text)

    def _inputs(self) -> tuple[tuple[_Image, ...], _Time | None]:
        given = self._given
        if any(one.kind not in _TYPES for one in given):
            raise self._unfit("numbers must be float32, float16 or float64")
        images = [one for one in map(_image, given) if one is not None]
        if len(given) == 1:
            if len(images) != 1 or images[0].channels not in (6, 7) or images[0].last:
                raise self._unfit(
                    "a single input must have 7 channels, or 6, as RIFE of the folder rife_v2 has"
                )
            return tuple(images), None
        images = [one for one in images if one.channels in (1, 3)]
        if len(images) == 3:  # one is a plane of the time
            counts = [one.channels for one in images]
            odd = [one for one in images if "time" in one.name.lower()]
            odd = odd or [one for one in images if counts.count(one.channels) == 1]
            images = [one for one in images if one not in odd]
        names = [one.name for one in images]
        times = [one for one in given if one.name not in names]
        if len(images) != 2 or len(times) > 1:
            raise self._unfit("these are not two images and a time")
        first, second = sorted(images, key=lambda one: _number(one.name))
        if (first.channels, first.last, first.size) != (second.channels, second.last, second.size):
            raise self._unfit("the two images differ in shape")
        return (first, second), self._of_time(times[0]) if times else None

    def _of_time(self, given: _Given) -> _Time:
        shape = tuple(one if isinstance(one, int) else None for one in given.shape)
        if len(shape) > 4 or (len(shape) < 4 and any(one not in (None, 1) for one in shape)):
            raise self._unfit(f"{given.name} takes more than one number")
        return _Time(given.name, _TYPES[given.kind], shape)

    def _only_output(self, names: Sequence[str]) -> str:
        named = [one for one in names if one.partition(":")[0] in ("output", "image")]
        if len(names) != 1 and len(named) != 1:
            raise self._unfit(
                f"of several outputs one must be named output or image: {list(names)}"
            )
        return (named or names)[0]

    def _unfit(self, why: str) -> ConfigError:
        inputs = ", ".join(f"{one.name} {list(one.shape)}" for one in self._given)
        return ConfigError(f"{self._label}: takes {inputs}: {why}; what fits: {_FITS}")


def open_network(path: str) -> Network:
    """Return the network in an ONNX file.

    Raises
    ------
    ConfigError
        The file is missing, is no ONNX, or does not take and give what the module says.
    MissingExtraError
        The extra ``onnx`` is not installed.
    """
    file = Path(path)
    try:
        check_ends(file, ConfigError)
        about = file.stat()
        return _opened(path, about.st_mtime_ns, about.st_size)
    except OSError as error:
        raise ConfigError(f"{_KEY}: {path}: {error.strerror or error}") from None


@lru_cache(maxsize=1)
def _opened(path: str, changed_ns: int, size: int) -> Network:
    del changed_ns, size  # another file by the same name is read anew
    return Network(path, Path(path).read_bytes())


def _open(
    label: str, data: bytes
) -> tuple[Any, tuple[_Given, ...], tuple[str, ...], Mapping[str, str]]:
    """Return the session of a network, its inputs, the names of its outputs, and its metadata."""
    try:
        import onnxruntime  # noqa: PLC0415 - an extra
    except ImportError:
        raise MissingExtraError(label, "onnx") from None
    options = onnxruntime.SessionOptions()
    # one thread for each frame: what comes out must not depend on how many there are
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # errors are told once, as ours
    try:
        session = onnxruntime.InferenceSession(
            data, options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        # names of a damaged file may be no text, which is found where they are asked for
        given = [_Given(one.name, one.type, tuple(one.shape)) for one in session.get_inputs()]
        outputs = [one.name for one in session.get_outputs()]
        stated = dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:
        raise ConfigError(f"{label}: is no network that can be run: {_one_line(error)}") from None
    return session, tuple(given), tuple(outputs), stated


def _image(given: _Given) -> _Image | None:
    """Return an input that may take images: of one batch, with a known number of channels."""
    shape = given.shape
    if len(shape) != 4 or (isinstance(shape[0], int) and shape[0] != 1):
        return None
    last = shape[1] not in _CHANNELS
    channels = shape[3] if last else shape[1]
    if channels not in _CHANNELS:
        return None
    rows, columns = shape[1:3] if last else shape[2:]
    size = tuple(one if isinstance(one, int) else None for one in (rows, columns))
    return _Image(given.name, _TYPES[given.kind], channels, last, (size[0], size[1]))


def _number(name: str) -> int:
    found = re.search(r"([0-9]+)$", name.partition(":")[0])
    return int(found[1]) if found else 0


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
