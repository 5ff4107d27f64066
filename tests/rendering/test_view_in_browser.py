"""Pages with events in a browser: what is drawn where, what keys do, and how wide they are."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import browse, needs_a_browser

from adv2e.events import make_events
from adv2e.formats.recording import Recording
from adv2e.rendering.view import view

pytestmark = needs_a_browser

ROOT = Path(__file__).parents[2]
WHITE, ON, OFF = [255, 255, 255], [214, 30, 36], [24, 84, 205]

DRIVER = """<pre id="found"></pre><script>
const found = [];
const wait = (ms) => new Promise((done) => setTimeout(done, ms));
const pixel = (id, x, y) =>
  [...document.getElementById(id).getContext("2d").getImageData(x, y, 1, 1).data].slice(0, 3);
const picture = (id) => {{
  const canvas = document.getElementById(id);
  return canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
}};
const press = async (key, more = {{}}, target = document.body) => {{
  target.dispatchEvent(new KeyboardEvent("keydown", {{ key, bubbles: true, ...more }}));
  await wait(100);
}};
const text = (id) => document.getElementById(id).textContent;
(async () => {{
  for (let n = 0; n < 100 && document.documentElement.dataset.ready === undefined; n++) {{
    await wait(50);
  }}
  await wait(100);
  {script}
}})().catch((error) => found.push(`${{error}}`)).finally(() => {{
  document.getElementById("found").textContent = JSON.stringify(found);
}});
</script></body>"""


# without a window the browser may paint no frames, for which pages wait before they draw
TICKING = """<script>
window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);
</script><script id="""


def driven(folder, page, script, size="1440,900"):
    """Return what a script finds on a page, which it puts into ``found``."""
    driver = DRIVER.format(script=script)
    path = folder / "page.html"
    page = page.replace("<script id=", TICKING, 1).replace("</body>", driver, 1)
    path.write_text(page, "utf-8")
    told = browse(
        folder, f"--window-size={size}", "--virtual-time-budget=20000", "--dump-dom",
        f"file://{path}",
    )  # fmt: skip
    (text,) = re.findall('<pre id="found">([^<]+)</pre>', told)
    return json.loads(html.unescape(text))


@pytest.fixture
def known():
    """Return a page of 1 s, of 8x6 pixels: each tenth of a second one ON and one OFF event."""
    t = np.arange(10) * 100_000 + 50_000
    on = make_events(t, np.arange(10) % 8, np.arange(10) % 6, np.ones(10))
    off = make_events(t + 10, 7 - np.arange(10) % 8, np.arange(10) % 6, np.zeros(10))
    ends = make_events([0, 999_999], [0, 7], [5, 5], [1, 0])
    return view(np.sort(np.concatenate([on, off, ends]), order="t"), size=(8, 6))


GO = """
  document.getElementById("window").value = {window};
  document.getElementById("window").dispatchEvent(new Event("input"));
  await press("Home");
  for (let n = 0; n < {steps}; n++) await press("ArrowRight");
"""
WINDOWS_US = [power * digit for power in (10, 100, 1000, 10_000, 100_000) for digit in (1, 2, 5)]


def go(window_us, steps):
    return GO.format(window=WINDOWS_US.index(window_us), steps=steps)


def test_events_of_the_window_have_their_colours_at_their_places(tmp_path, known):
    """At 0.4 s, with a window of 0.1 s, there is event 3 of each kind, and no other."""
    script = go(100_000, 4) + 'found.push(text("time"), text("counts"), [...picture("plane")]);'
    time, counts, data = driven(tmp_path, known, script)
    assert time == "0.400 s"
    assert counts == "100 ms: 1 ON, 1 OFF"
    picture = np.array(data).reshape(6, 8, 4)[..., :3]
    expected = np.full((6, 8, 3), 255)
    expected[3, 3], expected[3, 4] = ON, OFF
    np.testing.assert_array_equal(picture, expected)


def test_the_window_holds_its_start_and_lacks_its_end(tmp_path):
    events = make_events([0, 100_000, 199_999, 200_000, 300_000], range(5), [0] * 5, [1] * 5)
    script = go(100_000, 2) + "for (let x = 0; x < 5; x++) found.push(pixel('plane', x, 0));"
    found = driven(tmp_path, view(events, size=(8, 6)), script)
    assert found == [WHITE, ON, ON, WHITE, WHITE]


def test_of_several_events_of_a_pixel_the_last_is_seen_also_where_the_sensor_is_larger(tmp_path):
    """4000 columns on a screen of 1440: no pixel is lost, and the last of those of one is drawn."""
    x = np.repeat(np.arange(0, 4000, 250), 2)
    events = make_events(np.arange(x.size) // 4, x, [1000] * x.size, [1, 0] * 16)
    script = 'await press("End"); found.push([...picture("plane")]);'
    (data,) = driven(tmp_path, view(events, size=(4000, 2000)), script)
    pixels = np.array(data).reshape(-1, 4)[:, :3]
    assert np.count_nonzero((pixels == OFF).all(axis=1)) == 4 * 16  # so few are drawn larger
    assert not (pixels == ON).all(axis=1).any()


def test_frames_lie_beneath_the_events(tmp_path):
    events = make_events([0, 150_000, 300_000], [1, 2, 3], [1, 1, 1], [1, 0, 1])
    images = [np.full((6, 8), dn, np.uint8) for dn in (40, 200)]
    times = np.array([0, 100_000_000])
    page = view(Recording("r", "array", 8, 6, events, times, images=lambda: iter(images)))
    script = go(100_000, 2) + (
        'found.push(pixel("plane", 2, 1), pixel("plane", 6, 4));'
        'await press("f"); found.push(pixel("plane", 6, 4));'
        'await press("f"); await press("Home"); await press("."); found.push(pixel("plane", 6, 4));'
    )
    event, frame, without, first = driven(tmp_path, page, script)
    assert event == OFF
    assert np.allclose(frame, 200, atol=6)
    assert without == WHITE
    assert np.allclose(first, 40, atol=6)


def test_keys_change_what_is_shown(tmp_path, known):
    script = """
      const value = (id) => document.getElementById(id).value;
      const state = () => [text("time"), text("window-told"), value("speed"), value("colours"),
        value("depth"), document.getElementById("stage").className,
        document.getElementById("keys").open];
      found.push(state());
      for (const key of "End ArrowLeft , [ ] ] - + + c t v ?".split(" ")) {
        await press(key);
        found.push(state());
      }
      await press("Home");
      await press("ArrowRight", { shiftKey: true });
      found.push(state());
      await press("c", { ctrlKey: true });
      found.push(state());
    """
    found = driven(tmp_path, known, go(100_000, 0) + script)
    assert found[0] == ["0.000 s", "100 ms", *found[0][2:5], "both", False]
    times = [float(one[0].split()[0]) for one in found]
    assert times[:4] == pytest.approx([0, 1, 0.9, 0.89])
    assert [one[1] for one in found[3:7]] == ["100 ms", "50 ms", "100 ms", "200 ms"]
    speed, colours, depth = (int(found[0][n]) for n in (2, 3, 4))
    assert [int(one[2]) for one in found[6:10]] == [speed, speed - 1, speed, speed + 1]
    assert [int(one[3]) for one in found[9:11]] == [colours, colours + 1]
    assert [int(one[4]) for one in found[10:12]] == [depth, depth + 1]
    assert [one[5] for one in found[11:13]] == ["both", "plane"]
    assert [one[6] for one in found[12:14]] == [False, True]
    assert times[-2] == pytest.approx(1)  # ten windows of 200 ms are beyond the end
    assert found[-1] == found[-2]  # the browser's own


def test_play_and_pause(tmp_path, known):
    script = """
      const now = () => [text("play"), parseFloat(text("time"))];
      await press("Home");
      await press(" ");
      await wait(2000);
      found.push(now());
      await press(" ");
      found.push(now());
      await wait(2000);
      found.push(now());
      document.getElementById("play").click();
      await wait(60000 / 6);
      found.push(now());
    """
    playing, paused, later, ended = driven(tmp_path, known, script)
    assert playing[0] == "Pause"
    assert 0.1 < playing[1] < 0.5  # at a tenth of the speed of life
    assert paused[0] == "Play"
    assert later == paused
    assert ended == ["Play", 1.0]


def test_the_strip_of_rates_is_the_slider_of_time(tmp_path, known):
    script = """
      const rate = document.getElementById("rate");
      const box = rate.getBoundingClientRect();
      const point = (kind, share, buttons) => rate.dispatchEvent(new PointerEvent(kind, {
        clientX: box.left + share * box.width, clientY: box.top + 20, buttons, bubbles: true,
        pointerId: 1, pointerType: "mouse" }));
      rate.setPointerCapture = () => {};
      point("pointerdown", 0.25, 1);
      await wait(100);
      found.push(text("time"), rate.getAttribute("aria-valuenow"));
      point("pointermove", 0.75, 1);
      await wait(100);
      found.push(text("time"));
      point("pointermove", 0.5, 0);
      await wait(100);
      found.push(text("time"), document.getElementById("tip").hidden, text("tip"));
      const across = (share) => Math.round(share * rate.width);
      found.push(pixel("rate", across(0.3502), 24), pixel("rate", across(0.3502), 54));
      found.push(pixel("rate", across(0.31), 30));
    """
    at, value, moved, hovered, hidden, tip, on, off, none = driven(tmp_path, known, script)
    assert at == "0.250 s"
    assert float(value) == pytest.approx(0.25)
    assert moved == hovered == "0.750 s"
    assert not hidden
    assert tip.startswith("0.500 s · ON ")
    assert (on, off, none) == (ON, OFF, WHITE)


def test_the_cloud_turns_and_keeps_its_events(tmp_path, known):
    script = """
      const inked = () => {
        const data = picture("cloud");
        const seen = [0, 0];
        for (let n = 0; n < data.length; n += 4) {
          if (data[n] === 214 && data[n + 2] === 36) seen[0]++;
          if (data[n] === 24 && data[n + 2] === 205) seen[1]++;
        }
        return seen;
      };
      const picked = document.getElementById("depth");
      picked.value = 5;
      picked.dispatchEvent(new Event("change"));
      await wait(100);
      const first = picture("cloud");
      found.push(inked());
      await press("d");
      await press("w");
      found.push(inked(), picture("cloud").some((one, n) => one !== first[n]));
      await press("r");
      found.push(picture("cloud").some((one, n) => one !== first[n]));
    """
    first, turned, differs, back_differs = driven(tmp_path, known, script)
    for on, off in (first, turned):  # 11 events of each kind, of 2x2 pixels
        assert 28 <= on <= 44
        assert 28 <= off <= 44
    assert differs
    assert not back_differs


def test_browsers_that_cannot_unpack_are_helped(tmp_path):
    rng = np.random.default_rng(1)
    t = np.sort(rng.integers(0, 1_000_000, 20_000))
    places = [rng.integers(0, most, t.size) for most in (346, 260)]
    events = make_events(t, *places, rng.integers(0, 2, t.size))
    events[5_000:9_000] = events[5_000]  # long runs, too
    page = view(events, size=(346, 260))
    script = """
      await press("End");
      found.push(typeof DecompressionStream, [...picture("plane")].join(), text("counts"));
      let sum = 0;
      for (let n = 0; n < events.count; n++) {
        sum = (sum * 31 + events.t[n] + 7 * events.x[n] + 11 * events.y[n] + events.p[n]) % 1e9;
      }
      found.push(events.count, sum);
    """
    own = "<script>delete window.DecompressionStream;</script><script id="
    with_it = driven(tmp_path, page, script)
    without = driven(tmp_path, page.replace("<script id=", own, 1), script)
    assert (with_it[0], without[0]) == ("function", "undefined")
    assert without[1:] == with_it[1:]
    expected = 0
    origin = int(events["t"][0])
    for time, x, y, p in events.tolist():
        expected = (expected * 31 + time - origin + 7 * x + 11 * y + p) % 10**9
    assert with_it[3:] == [20_000, expected]


@pytest.mark.parametrize("size", [(346, 260), (1280, 720), (34, 34), (60, 600)])
def test_nothing_is_wider_than_a_phone(tmp_path, size):
    events = make_events([0, 3_000_000_000], [0, size[0] - 1], [0, size[1] - 1], [1, 0])
    name = "a_rather_long_name_of_a_recording_without_a_single_space_in_it.events.h5"
    page = view(Recording(name, "array", *size, events, problems=["x" * 200]))
    (tmp_path / "inner.html").write_text(page, "utf-8")
    outer = """<!DOCTYPE html><body><iframe width="390" height="844" src="inner.html"></iframe>
      <pre id="told"></pre><script>onload = () => setTimeout(() => {
        const page = document.querySelector("iframe").contentDocument;
        page.querySelectorAll("details").forEach((part) => { part.open = true; });
        const widths = [...page.querySelectorAll("#show option")].map(({ value }) => {
          page.querySelector("#show").value = value;
          page.querySelector("#show").dispatchEvent(new Event("change"));
          return page.documentElement.scrollWidth;
        });
        const play = page.querySelector("#play").getBoundingClientRect();
        document.querySelector("#told").textContent = [...widths, play.width, play.height];
      }, 1000)</script></body>"""
    (tmp_path / "outer.html").write_text(outer, "utf-8")
    told = browse(
        tmp_path, "--allow-file-access-from-files", "--virtual-time-budget=5000", "--dump-dom",
        f"file://{tmp_path}/outer.html",
    )  # fmt: skip
    numbers = re.search('<pre id="told">([^<]+)</pre>', told)[1]
    *widths, wide, high = map(float, numbers.split(","))
    assert widths == [390, 390, 390]
    assert wide >= 40
    assert high >= 40


def test_every_control_has_a_name(known):
    for kind in ("button", "select", "input", "canvas"):
        for attributes in re.findall(rf"<{kind}\b([^>]*)>", known):
            (name,) = re.findall(r'id="(\w+)"', attributes)
            labelled = re.search(rf'<label[^>]*>[^<]*\w[^<]*<\w+[^>]*id="{name}"', known)
            named = "aria-label=" in attributes or labelled or name in ("play", "frames")
            assert named, name


def test_the_keys_of_the_page_are_those_that_are_documented(tmp_path, known):
    script = 'found.push([...document.querySelectorAll("#keys tr")].map((row) => row.innerText));'
    (rows,) = driven(tmp_path, known.replace('id="keys"', 'id="keys" open'), script)
    keys = [row.split("\t") for row in rows]
    text = (ROOT / "docs" / "view.md").read_text("utf-8")
    assert re.findall(r"^\| `(.+)` \| (.+) \|$", text, re.MULTILINE) == [(a, b) for a, b in keys]
