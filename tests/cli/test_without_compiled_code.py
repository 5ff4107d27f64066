"""What only looks at files needs no compiled code, which takes a second to begin."""

import json
import os
import subprocess
import sys
import zipfile

import cv2
import h5py
import numpy as np

COMMANDS = """
import json, sys
from adv2e.cli import main
for command in json.loads(sys.argv[1]):
    try:
        main(command)
    except SystemExit as stop:
        assert not stop.code, command
    compiled = {"numba", "llvmlite"} & set(sys.modules)
    assert not compiled, (command, compiled)
"""

LINES = "".join(f"{0.001 * k:.9f} {k % 8} {k % 6} {k % 2}\n" for k in range(100))


def test_info_render_view_and_config_import_no_numba(tmp_path):
    folder = tmp_path / "folder"
    (folder / "images").mkdir(parents=True)
    (folder / "images.txt").write_text("0.0 images/a.png\n0.05 images/b.png\n")
    for name in ("a", "b"):
        cv2.imwrite(str(folder / f"images/{name}.png"), np.zeros((6, 8, 3), np.uint8))
    columns = np.loadtxt(LINES.splitlines()).T
    for path in (tmp_path / "e.txt", folder / "events.txt"):
        path.write_text(LINES)
    with zipfile.ZipFile(tmp_path / "e.zip", "w") as archive:
        archive.writestr("events.txt", LINES)
    np.savez(tmp_path / "e.npz", **dict(zip(("t_s", "x", "y", "p"), columns, strict=True)))
    with h5py.File(tmp_path / "e.h5", "w") as file:
        for name, column in zip(("ts", "xs", "ys", "ps"), columns, strict=True):
            file[f"events/{name}"] = column if name == "ts" else column.astype(int)
    names = ("folder", "e.txt", "e.zip", "e.npz", "e.h5")
    commands = [
        *(["--help"], ["render", "--help"], ["config", "show"], ["config", "defaults"]),
        *(["info", str(tmp_path / name)] for name in names),
        ["view", str(folder), "-o", str(tmp_path / "out.html")],
        *(["render", str(folder), "-o", str(tmp_path / f"out.{kind}")] for kind in ("png", "mp4")),
    ]

    run = subprocess.run(
        [sys.executable, "-c", COMMANDS, json.dumps(commands)],
        capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},  # of code compiled before, none helps
    )  # fmt: skip

    assert run.returncode == 0, run.stderr
