"""Small trees of sequences, and batches over them in processes of their own."""

from __future__ import annotations

import json
import sys

import cv2
import numpy as np
from pictures import picture

from adv2e.batches.work import do

QUICK = ("--set", "sampling.L=1", "--set", "pixel.low_pass=null")


def clip(path, count=3, start=0, size=(32, 24)):
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), 30, size)
    for k in range(count):
        frame = cv2.resize(picture(start + k), size)
        writer.write(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def gopro(root, name="GOPR0384_11_00", kinds=("sharp", "blur")):
    for kind in kinds:
        folder = root / name / kind
        folder.mkdir(parents=True)
        for k in range(3):
            cv2.imwrite(str(folder / f"{k + 1:06}.png"), picture(k))


def davis240c(root):
    (root / "images").mkdir(parents=True)
    lines = []
    for k in range(3):
        cv2.imwrite(str(root / "images" / f"frame_{k:08}.png"), picture(k))
        lines.append(f"{k * 0.04:.9f} images/frame_{k:08}.png\n")
    (root / "images.txt").write_text("".join(lines))


def pictures(folder, count=3, *, times=False):
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(count):
        cv2.imwrite(str(folder / f"{k}.png"), picture(k))
    if times:
        (folder / "timestamps.txt").write_text("".join(f"{k / 10}\n" for k in range(count)))


def stack(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, np.stack([picture(k) for k in range(3)]))


def command(*args):
    return [sys.executable, "-m", "adv2e", "batch", *map(str, args)]


def in_this_process(jobs, count):
    """Do what :func:`adv2e.batches.processes.run` does, without the time that processes need."""
    return ((job, do(job)) for job in jobs)


def lines_of(dest):
    found = []
    for path in sorted(dest.glob("manifest*.jsonl")):
        found += [json.loads(line) for line in path.read_text("ascii").splitlines()]
    return found


def last_of(dest):
    return {one["name"]: one for one in lines_of(dest)}


def made_in(dest):
    """Return the bytes of all files but the manifests and the recipe, by their names."""
    return {
        path.relative_to(dest).as_posix(): path.read_bytes()
        for path in sorted(dest.rglob("*"))
        if path.is_file() and not path.name.startswith(("manifest", "recipe"))
    }
