"""What the README shows works as it stands."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from camera import Camera, patchwork
from camera.catalogue import cases

from adv2e.cli import COMMANDS
from adv2e.config import load_config
from adv2e.diagnosis.fitting.library import names

TEXT = (Path(__file__).resolve().parents[1] / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


def test_python_example_runs(capsys):
    example = blocks("python")[0]
    exec(compile(example, "README.md", "exec"), {})
    assert "(" in capsys.readouterr().out


def test_configuration_example_loads(tmp_path):
    (example,) = blocks("yaml")
    path = tmp_path / "dim.yaml"
    path.write_text(example)
    config = load_config([path], ["pixel.leak=null"], seed=7)
    assert config.pixel.photoreceptor_noise.rms == 0.05
    assert config.pixel.leak is None


def test_effect_of_ones_own_runs(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = (text for text in blocks("python") if "class Echo" in text)
    Path("echo.py").write_text(example)
    levels = np.tile(np.array([20, 40, 80, 160, 80, 40], np.uint8), 3)
    np.save("clip.npy", np.repeat(levels, 12 * 9).reshape(18, 9, 12))
    given = ("convert", "clip.npy", "--fps", "200", "-q", "--effect", "echo.py")
    events = {}
    for share in ("0", "0.25"):
        outcome = adv2e(*given, "-o", f"{share}.txt", "--set", f"user.echo.share={share}")
        assert outcome == (0, "", "")
        events[share] = Path(f"{share}.txt").read_text("ascii").splitlines()
    assert len(events["0.25"]) / len(events["0"]) == pytest.approx(1.25, abs=0.05)
    assert set(events["0"]) < set(events["0.25"])
    times = [float(line.split()[0]) for line in events["0.25"]]
    assert times == sorted(times)
    kept = json.loads(Path("0.25.txt.json").read_text("utf-8"))
    assert kept["config"]["user"] == {"echo": {"share": 0.25, "delay_us": 5000.0}}
    (source,) = kept["effects"]
    digest = hashlib.sha256(example.encode()).hexdigest()
    assert source == {"name": "echo", "file": "echo.py", "sha256": digest}
    assert "delay_us: 5000.0" in adv2e("config", "show", "--effect", "echo.py").out


def test_effect_of_ones_own_is_found_and_its_model_converts(adv2e, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = (text for text in blocks("python") if "class Echo" in text)
    Path("echo.py").write_text(example)
    size = (32, 24)
    Camera(
        patchwork(size, seed=4), hidden=next(cases("echo", size="large")).hidden, size=size,
        duration_s=0.4, fps=800.0, seed=4, step_us=50.0,
    ).record(Path("a.zip"))  # fmt: skip
    # what competes are the built-in effects that come nearest; with all, it takes a minute
    rivals = {"refractory", "event_loss", "shot_noise"}
    without = [part for name in set(names()) - rivals for part in ("--without", name)]
    given = ("diagnose", "a.zip", "-c", "a.declared.yaml", *without)
    outcome = adv2e(*given, "--effect", "echo.py", "-o", "found")
    assert outcome.status == 0, outcome.err
    report = json.loads(Path("found/report.json").read_text("utf-8"))
    assert report["verdict"] == "explained"
    (effect,) = report["effects"]
    assert effect["name"] == "echo"
    assert effect["parameters"]["user.echo.share"] == pytest.approx(0.3, rel=0.1)
    assert effect["parameters"]["user.echo.delay_us"] == pytest.approx(7000.0, rel=0.1)
    model = ("-c", "found/model.yaml", "--effect", "echo.py")
    assert adv2e("convert", "a.zip", *model, "-q", "-o", "a.txt").status == 0
    kept = json.loads(Path("a.txt.json").read_text("utf-8"))
    assert kept["config"]["user"]["echo"] == pytest.approx(
        {key.removeprefix("user.echo."): value for key, value in effect["parameters"].items()}
    )


def test_commands_exist():
    named = set(re.findall(r"^adv2e (\w+)", TEXT, flags=re.MULTILINE))
    assert len(named) >= 5
    assert named <= set(COMMANDS)


def test_scripts_and_pictures_exist():
    root = Path(__file__).resolve().parents[1]
    for name in re.findall(r"`?(scripts/[\w/.]*\w)", TEXT) + re.findall(r"\]\((\S+\.png)\)", TEXT):
        assert (root / name).exists(), name


def test_no_table_is_missing():
    assert not re.search(r"^@\w+@$", TEXT, flags=re.MULTILINE)


def test_links_within_lead_to_headings():
    headings = re.findall(r"^#+ (.*)$", TEXT, re.MULTILINE)
    anchors = {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}
    links = re.findall(r"\]\(#([^)]*)\)", TEXT)
    assert links
    assert set(links) <= anchors
