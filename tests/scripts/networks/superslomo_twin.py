"""Super SloMo once more, in NumPy and float64: from the paper and the layout of its checkpoints."""

from __future__ import annotations

import numpy as np

BLOCKS = {
    "conv1": (None, 32, 7), "conv2": (32, 32, 7),
    "down1.conv1": (32, 64, 5), "down1.conv2": (64, 64, 5),
    "down2.conv1": (64, 128, 3), "down2.conv2": (128, 128, 3),
    "down3.conv1": (128, 256, 3), "down3.conv2": (256, 256, 3),
    "down4.conv1": (256, 512, 3), "down4.conv2": (512, 512, 3),
    "down5.conv1": (512, 512, 3), "down5.conv2": (512, 512, 3),
    "up1.conv1": (512, 512, 3), "up1.conv2": (1024, 512, 3),
    "up2.conv1": (512, 256, 3), "up2.conv2": (512, 256, 3),
    "up3.conv1": (256, 128, 3), "up3.conv2": (256, 128, 3),
    "up4.conv1": (128, 64, 3), "up4.conv2": (128, 64, 3),
    "up5.conv1": (64, 32, 3), "up5.conv2": (64, 32, 3),
    "conv3": (32, None, 3),
}  # fmt: skip
"""Inputs, outputs and the size of each convolution, as in the published checkpoints."""


def weights(inputs, outputs, random, last):
    """Return random weights of a U-Net; `last` scales what comes out of it."""
    made = {}
    for name, (inner, outer, size) in BLOCKS.items():
        before, after = inner or inputs, outer or outputs
        spread = np.sqrt(2.0 / (before * size * size)) * (last if name == "conv3" else 1.0)
        shape = (after, before, size, size)
        made[f"{name}.weight"] = random.normal(0, spread, shape).astype(np.float32)
        made[f"{name}.bias"] = random.normal(0, 0.05, after).astype(np.float32)
    return made


def convolved(values, state, name):
    """Return a convolution of (channels, rows, columns) and a leaky rectifier."""
    kernel, bias = state[f"{name}.weight"].astype(float), state[f"{name}.bias"].astype(float)
    half = kernel.shape[2] // 2
    _, rows, columns = values.shape
    padded = np.pad(values, ((0, 0), (half, half), (half, half)))
    total = np.zeros((len(bias), rows * columns)) + bias[:, None]
    for i in range(2 * half + 1):
        for j in range(2 * half + 1):
            part = padded[:, i : i + rows, j : j + columns]
            total += kernel[:, :, i, j] @ part.reshape(len(part), -1)
    total = total.reshape(-1, rows, columns)
    return np.where(total < 0, 0.1 * total, total)


def halved(values):
    """Return means of 2x2 pixels."""
    channels, rows, columns = values.shape
    return values.reshape(channels, rows // 2, 2, columns // 2, 2).mean((2, 4))


def doubled(values):
    """Return each axis twice as long; pixels are areas, and the outermost go on."""
    for axis in (1, 2):
        ends = np.pad(values, [(1, 1) if k == axis else (0, 0) for k in range(3)], "edge")
        before, after = (np.delete(ends, gone, axis) for gone in ([-1, -2], [0, 1]))
        pair = np.stack((0.25 * before + 0.75 * values, 0.75 * values + 0.25 * after), axis + 1)
        shape = list(values.shape)
        shape[axis] *= 2
        values = pair.reshape(shape)
    return values


def unet(values, state):
    values = convolved(convolved(values, state, "conv1"), state, "conv2")
    kept = []
    for k in "12345":
        kept.append(values)
        values = convolved(halved(values), state, f"down{k}.conv1")
        values = convolved(values, state, f"down{k}.conv2")
    for k in "12345":
        values = convolved(doubled(values), state, f"up{k}.conv1")
        values = convolved(np.concatenate((values, kept.pop())), state, f"up{k}.conv2")
    return convolved(values, state, "conv3")


def warped(frame, flow):
    """Return a frame sampled at place (x + flow) (N - 1) / N of N pixels; it ends in zeros."""
    _, rows, columns = frame.shape
    result = np.zeros_like(frame)
    for i in range(rows):
        for j in range(columns):
            x = (j + flow[0, i, j]) * (columns - 1) / columns
            y = (i + flow[1, i, j]) * (rows - 1) / rows
            left, top = int(np.floor(x)), int(np.floor(y))
            for row, down in ((top, 1 - (y - top)), (top + 1, y - top)):
                for column, right in ((left, 1 - (x - left)), (left + 1, x - left)):
                    if 0 <= row < rows and 0 <= column < columns:
                        result[:, i, j] += down * right * frame[:, row, column]
    return result


def interpolated(img0, img1, t, flow_state, refinement_state, mean):
    """Return the frame at t, and the flow from it to the first frame."""
    mean = np.reshape(mean, (-1, 1, 1))
    frame0, frame1 = img0 - mean, img1 - mean
    found = unet(np.concatenate((frame0, frame1)), flow_state)
    f01, f10 = found[:2], found[2:]
    ft0 = -(1 - t) * t * f01 + t**2 * f10
    ft1 = (1 - t) ** 2 * f01 - t * (1 - t) * f10
    seen = (frame0, frame1, f01, f10, ft1, ft0, warped(frame1, ft1), warped(frame0, ft0))
    refined = unet(np.concatenate(seen), refinement_state)
    visible0 = 1 / (1 + np.exp(-refined[4:5]))
    visible1 = 1 - visible0
    ft0, ft1 = ft0 + refined[:2], ft1 + refined[2:4]
    above = (1 - t) * visible0 * warped(frame0, ft0) + t * visible1 * warped(frame1, ft1)
    return above / ((1 - t) * visible0 + t * visible1) + mean, ft0
