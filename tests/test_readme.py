"""What the README shows works as it stands."""

import re
from pathlib import Path

from adv2e.cli import COMMANDS
from adv2e.config import load_config

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
