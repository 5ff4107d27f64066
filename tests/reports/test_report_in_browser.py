"""``report.html`` in a browser: as wide as a phone, and as long as six sheets of paper."""

import html
import re
from dataclasses import replace

import numpy as np
import pytest
from browser import browse, needs_a_browser
from made_up_diagnosis import everything, strange

from adv2e.reports.page import page
from adv2e.reports.result import Detectable, Rejected, ResidualMap, Signature

pytestmark = needs_a_browser

FRAME = """<!DOCTYPE html><iframe width="390" height="844" srcdoc="{page}"></iframe>
<pre id="told"></pre><script>onload = () => {{
  const page = document.querySelector("iframe").contentDocument;
  page.querySelectorAll("details").forEach(part => part.open = true);
  const before = page.querySelector(".bar.before .track").getBoundingClientRect();
  document.querySelector("#told").textContent =
    [page.documentElement.scrollWidth, before.left, before.right, before.bottom];
}}</script>"""


def full_size():
    """Return a diagnosis with as much in it as one of a real recording has."""
    given = everything()
    long = "takes away 51 % of the difference, where others take away more of it"
    names = [f"effect_number_{k}" for k in range(26)]
    draw = np.random.default_rng(1)
    return replace(
        given,
        curves=given.curves * 5,
        maps=[ResidualMap(f"{name} events", *draw.normal(size=(2, 260, 346))) for name in "ab"],
        signatures=[
            Signature(
                f"s {k}", f"group {k % 16}", f"number of events {k} " * 6, k, 9, k, k, 0.1, "events"
            )
            for k in range(450)
        ],
        rejected=[Rejected(name, long, {f"pixel.{name}.size_us": 1234.5}, 0.9) for name in names],
        detectable=[Detectable(name, f"pixel.{name}.size_us", 12.0, "us") for name in names],
        notes=["The frames hardly resolve the motion. " * 4] * 4,
    )


@pytest.mark.parametrize("make", [full_size, strange])
def test_nothing_is_wider_than_a_phone(make, tmp_path):
    (tmp_path / "frame.html").write_text(
        FRAME.format(page=html.escape(page(make(), tmp_path))), "utf-8"
    )
    told = browse(tmp_path, "--dump-dom", f"file://{tmp_path}/frame.html")
    numbers = re.search('<pre id="told">([^<]*)</pre>', told)[1]
    width, left, right, bottom = map(float, numbers.split(","))
    assert width == 390
    # the bar of the error before is there in full, on the first screen
    assert 0 <= left < right <= 390
    assert right - left > 300
    assert bottom < 844 or make is strange


def test_a_printed_report_has_six_pages_at_most(tmp_path):
    (tmp_path / "report.html").write_text(page(full_size()), "utf-8")
    paper = tmp_path / "report.pdf"
    browse(tmp_path, f"--print-to-pdf={paper}", f"file://{tmp_path}/report.html")
    sheets = len(re.findall(rb"/Type\s*/Page\b", paper.read_bytes()))
    assert 3 <= sheets <= 6
