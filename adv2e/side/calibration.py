"""Intrinsics of the camera, for the pixels of the sensor in place of those of the frames.

==================== ==========================================================================
``calib.txt``        ``fx fy cx cy k1 k2 p1 p2 k3``, of DAVIS240C
``sensor.yaml``      of EuRoC; of a chain of Kalibr, its first camera
==================== ==========================================================================

Principal points count from the middle of the first pixel, as in OpenCV.  Turned by half a turn, p1
and p2 change their sign, and the camera's own axes turn: so do ``T_BS``, which leads from them, and
``T_cam_imu``, which leads to them.

References
----------
.. [1] M. Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016.
.. [2] OpenCV, "Camera Calibration and 3D Reconstruction", docs.opencv.org (distortion).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import yaml

from adv2e.errors import DataError
from adv2e.geometry import Size
from adv2e.side.placement import Clock, Placement

_FEWEST = 4  # fx fy cx cy, or with four or five numbers of the distortion
_OF_TEXT = (4, 8, 9)
_RADTAN = ("radtan", "radial-tangential", "plumb_bob", "radtan5")
_MODELS = ("pinhole", "omni", "mei", "eucm", "ds")
"""Models of cameras whose last four numbers are fx, fy, cx, cy; of Kalibr."""


@dataclass(frozen=True)
class Calibration:
    """Intrinsics: numbers of the model and fx, fy, cx, cy; distortion, and the file it is of."""

    label: str
    intrinsics: list[float]
    distortion: list[float]
    model: str = "pinhole"
    bends: str = "radtan"
    file: dict[str, Any] | None = None
    size: Size | None = None

    def placed(self, place: Placement) -> Calibration:
        """Return that of the sensor; DataError for frames that it is not of."""
        if self.size is not None:
            place.check(self.size, self.label)
        *_, fx, fy, cx, cy = self.intrinsics
        if not (fx > 0 and fy > 0 and 0 <= cx <= place.whole.width and cy >= 0):
            raise DataError(f"{self.label}: fx fy cx cy of {fx:g} {fy:g} {cx:g} {cy:g} cannot be")
        middle = place.points((cx + 0.5, cy + 0.5)) - 0.5
        scaled = np.multiply((fx, fy), place.scale)
        bent = list(self.distortion)
        if place.turned and self.bends in _RADTAN and len(bent) > 3:
            bent[2:4] = -bent[2], -bent[3]
        found = [*self.intrinsics[:-_FEWEST], *scaled.tolist(), *middle.tolist()]
        return replace(self, intrinsics=found, distortion=bent)

    def written(self, place: Placement, clock: Clock) -> Iterator[tuple[str, bytes]]:
        """Yield names and bytes of the files for the sensor."""
        made = self.placed(place)
        if self.model == "pinhole" and (self.bends in _RADTAN or not any(self.distortion)):
            bent = (made.distortion + [0.0] * 5)[:5]
            text = " ".join(f"{number:.12g}" for number in (*made.intrinsics, *bent))
            yield "calib.txt", f"{text}\n".encode()
        if self.file is not None:
            told = {**self.file, "intrinsics": made.intrinsics, "resolution": list(place.size)}
            key = "distortion_coefficients" if "distortion_coefficients" in told else _KALIBR
            told[key] = made.distortion
            if place.turned:
                _turn(told)
            yield "sensor.yaml", yaml.safe_dump(told, sort_keys=False).encode()


_KALIBR = "distortion_coeffs"
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


def _turn(file: dict[str, Any]) -> None:
    """Turn the axes of the camera by half a turn about the optical one."""
    if isinstance(file.get("T_BS"), dict):
        body = np.reshape(file["T_BS"]["data"], (4, 4)) @ _HALF_TURN
        file["T_BS"] = {**file["T_BS"], "data": body.ravel().tolist()}
    if "T_cam_imu" in file:
        file["T_cam_imu"] = (_HALF_TURN @ np.reshape(file["T_cam_imu"], (4, 4))).tolist()


def parse_calibration(text: str, label: str) -> Calibration:
    """Read a ``calib.txt`` or a YAML file.

    Raises
    ------
    DataError
        It is neither, or of a model of cameras that is not known.
    """
    if label.endswith(".txt"):
        numbers = [_number(word, label) for word in re.split(r"[,;\s]+", text.strip())]
        if len(numbers) not in _OF_TEXT:
            raise DataError(f"{label}: must be fx fy cx cy k1 k2 p1 p2 k3, has {len(numbers)}")
        return Calibration(label, numbers[:4], numbers[4:])
    try:
        # OpenCV and EuRoC head it with what YAML does not know
        file = yaml.safe_load(re.sub(r"^%YAML.*", "", text))
        file = file.get("cam0", file)
        numbers = [float(one) for one in file["intrinsics"]]
        bent = [float(one) for one in file.get("distortion_coefficients", file.get(_KALIBR, []))]
        size = Size(*map(int, file["resolution"])) if "resolution" in file else None
        model = str(file.get("camera_model", "pinhole"))
        if isinstance(file.get("T_BS"), dict):
            np.reshape(file["T_BS"]["data"], (4, 4)).astype(float)
    except (yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise DataError(
            f"{label}: no sensor.yaml as of EuRoC, with intrinsics: [fu, fv, cu, cv]"
            f" ({str(error).splitlines()[0][:60]})"
        ) from None
    if model not in _MODELS or len(numbers) < _FEWEST:
        raise DataError(
            f"{label}: camera_model {model} of {len(numbers)} numbers: must be one of"
            f" {', '.join(_MODELS)}, its last four fx fy cx cy"
        )
    bends = str(file.get("distortion_model", "radtan"))
    return Calibration(label, numbers, bent, model, bends, file, size)


def _number(word: str, label: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise DataError(f"{label}: {word[:40]!r} is not a number") from None
