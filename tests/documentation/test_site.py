"""The site of the documentation is built without a warning, and what its makers make is right."""

from __future__ import annotations

import re
import subprocess
import sys
from html import unescape

import pytest
from website import effects
from website.equations import EquationError, latex
from website.pictures import SHOWN, events_of

from adv2e.cli import COMMANDS
from adv2e.effects import EFFECTS
from documentation.documents import ROOT, Document


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("DN' = DN + d", r"\mathrm{DN}' = \mathrm{DN} + d"),
        ("R1 DN/255", r"R_{1} \frac{\mathrm{DN}}{255}"),
        ("a/(b + c) d", r"\frac{a}{b + c} d"),
        ("x <- g_(k-1)^2", r"x \leftarrow  g_{k - 1}^{2}"),
        ("f_s(t) sqrt(2 w)", r"f_{s}\left(t\right) \sqrt{2 w}"),
        ("f (t)", r"f \left(t\right)"),
        ("(a) b/(c)", r"\left(a\right) \frac{b}{c}"),
        ("(a + b)(c)/d", r"\left(a + b\right) \frac{c}{d}"),
        ("0 <= s < r", r"0 \le  s < r"),
        ("2 pi tau", r"2 \pi \tau"),
        ("y = x    for x > 0", r"y = x \qquad \;\text{for}\; x > 0"),
    ],
)
def test_an_equation_in_ascii_is_the_same_in_latex(text, expected):
    assert latex(text).split() == expected.split()


@pytest.mark.parametrize("text", ["a (b", "a # b", "a/", "y = [1]"])
def test_what_is_no_equation_is_refused(text):
    with pytest.raises(EquationError):
        latex(text)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_all_of_an_effect_is_on_its_page(effect):
    """Each word and number of its docstring, and each equation of it as one."""
    page = effects._page(effect)
    text, _, references = effect.text().partition("\nReferences\n")
    blocks = re.findall(r"(?:\n\n)((?:    \S.*\n?)+)(?=\n|$)", text)
    assert page.count("```{math}") == sum(len(block.splitlines()) for block in blocks)
    prose = re.sub(r"(?m)^    .*$", "", text)
    left = re.sub(r"[\\`|{}]|math", " ", page)
    words = {*re.findall(r"[A-Za-z]{4,}", prose + references)}
    assert not {word for word in words if word not in left}
    assert "| key | unit | default | range | meaning |" in page


def test_each_effect_is_shown_by_what_it_changes():
    assert {*SHOWN} == {effect.name for effect in EFFECTS}
    for effect in EFFECTS:
        keys = [one.partition("=")[0] for one in SHOWN[effect.name].sets]
        assert all(f"{key}.".startswith(tuple(f"{p}." for p in effect.paths)) for key in keys)


@pytest.mark.thorough
def test_pictures_differ_with_the_effect():
    for name in ("leak", "refractory", "event_loss"):
        shown = SHOWN[name]
        assert len(events_of(shown, ())) != len(events_of(shown, shown.sets))


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "thesis.tex").write_text("mine")
    build = [sys.executable, str(ROOT / "scripts" / "website" / "build.py"), "-o", str(tmp_path)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"Error: {tmp_path}: holds other files; name a new or an empty folder\n"
    assert (tmp_path / "source" / "thesis.tex").exists()


@pytest.mark.thorough
@pytest.mark.skipif(sys.version_info < (3, 11), reason="Sphinx needs Python 3.11")
def test_the_site_is_built_without_a_warning(tmp_path):
    build = [sys.executable, str(ROOT / "scripts" / "website" / "build.py"), "-o", str(tmp_path)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    site = tmp_path / "html"
    assert done.stdout.startswith(f"{site / 'index.html'}: ")
    for name in COMMANDS:
        text = unescape(re.sub("<[^>]+>", "", (site / f"reference/{name}.html").read_text("utf-8")))
        assert f"adv2e {name} [" in text
    for effect in EFFECTS:
        page = (site / f"effects/{effect.name}.html").read_text("utf-8")
        assert f"_images/{effect.name}.png" in page
        assert not re.search(r'<(script|link|img)[^>]*(src|href)="(https?:)?//', page)
    assert "<math" in (site / "effects/leak.html").read_text("utf-8")
    # links lead from page to page, also where they led to a file beside the code
    peers = (site / "peers.html").read_text("utf-8")
    assert 'href="code/scripts_experiments.html#direct-comparison"' in peers
    assert [*site.rglob("first_events.ipynb")]
    menu = Document.read(ROOT / "docs" / "README.md")
    assert len(menu.links()) > 25
