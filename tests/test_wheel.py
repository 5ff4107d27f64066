"""What is built is whole and fit for an index, and works outside the clone."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.thorough
def test_wheel_of_the_sources_holds_the_shipped_configurations(tmp_path):
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)  # the wheel, of the sources' archive
    (wheel,), (sources,) = tmp_path.glob("adv2e-*.whl"), tmp_path.glob("adv2e-*.tar.gz")
    check = [sys.executable, "-m", "twine", "check", "--strict", str(wheel), str(sources)]
    subprocess.run(check, check=True, capture_output=True)
    with tarfile.open(sources) as files:
        inside = {name.partition("/")[2] for name in files.getnames()}
    assert {"docs/conf.py", "scripts/docs", "tests/conftest.py", "CITATION.cff"} <= inside
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    with zipfile.ZipFile(wheel) as files:  # what it starts in meets signals before all is imported
        (listed,) = (name for name in files.namelist() if name.endswith("entry_points.txt"))
        assert b"adv2e = adv2e.__main__:main" in files.read(listed)
    target = tmp_path / "installed"
    subprocess.run([*pip, "install", "--no-deps", "--target", str(target), str(wheel)], check=True)
    script = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import adv2e; assert adv2e.__file__.startswith(sys.argv[1]), adv2e.__file__\n"
        "from adv2e.config import load_family, shipped\n"
        "for name in shipped(): load_family([name])\n"
        "from adv2e.events import make_events\n"
        "assert '<canvas' in adv2e.view(make_events([1], [0], [0], [1]), size=(2, 2))\n"
        "print(*shipped())\n"
    )
    outcome = subprocess.run(
        [sys.executable, "-P", "-c", script, str(target)]
        if sys.version_info >= (3, 11)
        else [sys.executable, "-c", script, str(target)],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    names = outcome.stdout.split()
    for name in (
        "adv2e",
        "paper",
        "v2e",
        "vid2e",
        "ideal",
        "davis240c",
        "davis346",
        "gen4",
        "atis",
        "train-v2e",
    ):
        assert name in names
