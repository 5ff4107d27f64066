"""The page of a sensor: its charts are where the numbers are, and it fits a phone."""

import html
import re

import pytest
from browser import browse, needs_a_browser

from adv2e.reports.sensor import number_of, sensor_page


def series(name, x, y, low=None, high=None):
    return {"name": name, "x": x, "y": y, "low": low, "high": high}


def plot(key, *parts, log="xy", mark=None):
    labels = {"key": key, "title": f"title of {key}", "x_label": "light [lux]", "y_label": "y [us]"}
    return {
        **labels,
        "log": log,
        "definition": "What <it> is.",
        "mark": mark,
        "series": list(parts),
    }


def number(value, low, high, unit="us"):
    shown = {"value": value, "low": low, "high": high}
    keys = ["pixel.thresholds.on"]
    return {"name": "threshold", "at": "1 % of white", "unit": unit, **shown, "keys": keys}


def made_up(names=("one",)):
    line = series(
        "ON", [1.0, 10.0, 100.0], [100.0, 10.0, 1.0], [50.0, 5.0, 0.0], [200.0, 20.0, 2.0]
    )
    gap = series("OFF", [1.0, 10.0, 100.0], [None, 0.0, 10.0])
    config = {"pixel": {"thresholds": {"on": 0.25}, "leak": None}, "frames": {"encoding": "auto"}}
    sensor = {
        "config": config,
        "conditions": ["Light is known."],
        "numbers": [number(0.25, 0.24, 0.26, "ln")],
        "plots": [
            plot("latency", line, gap, mark=(10.0, "ten")),
            plot("bare", series("a", [], [])),
        ],
    }
    return {"adv2e": "0", "sensors": [{"name": name, **sensor} for name in names]}


def places(page, kind):
    return [
        (float(x), float(y)) for x, y in re.findall(rf"<{kind} cx=\"(\S+)\" cy=\"(\S+)\"", page)
    ]


def test_a_line_of_slope_one_is_drawn_as_one_and_gaps_have_no_points():
    page = sensor_page(made_up())
    points = places(page, "circle")
    assert len(points) == 4  # three, and one of the other, whose zero has no logarithm
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = points
    assert x1 - x0 == pytest.approx(x2 - x1, abs=0.2)
    assert y1 - y0 == pytest.approx(y2 - y1, abs=0.2)
    assert y0 < y1 < y2  # down in the picture
    assert (x3, y3) == pytest.approx((x2, y1), abs=0.1)
    mark = re.search(r"<line x1=\"\S+\" y1=\"(\S+)\" x2=\"\S+\" y2=\"\S+\" class=\"mark\"", page)
    assert float(mark[1]) == pytest.approx(y1, abs=0.1)
    assert "There is nothing to draw" in page


def test_texts_are_escaped_and_only_keys_of_the_pixel_are_listed():
    page = sensor_page(made_up(["<b>"]))
    assert "<b>" not in page
    assert "What &lt;it&gt; is." in page
    assert "pixel.thresholds.on" in page
    assert "frames.encoding" not in page
    assert "pixel.leak" not in page


def test_several_sensors_have_a_colour_each_and_one_legend():
    page = sensor_page(made_up(["one", "two"]))
    figure = page[page.index("<figure>") : page.index("</figure>")]
    assert figure.count("<li>") == 4
    assert len(re.findall(r"class=\"curve hue0 dash[01]\"></path>", figure)) == 2
    assert len(re.findall(r"class=\"curve hue1 dash[01]\"></path>", figure)) == 2
    assert page.count("Light is known.") == 1


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (number(0.25, 0.24, 0.26, "ln"), "0.250 ln (0.240 to 0.260), 28.4 %"),
        (number(120.0, 120.0, 120.0), "120 us"),
        (number(0.0, 0.0, 5e-5, "1/s a pixel"), "below 5.00e-5 1/s a pixel"),
        (number(None, 1e5, None, "Hz"), "above 100,000 Hz"),
        (number(None, None, None), "not reached"),
        (number(12.0, 11.0, None), "12.0 us"),
    ],
)
def test_numbers_say_how_well_they_are_known(given, text):
    assert number_of(given) == text


@needs_a_browser
@pytest.mark.parametrize("names", [["davis346"], ["a_long_name" * 6, *"bcdef"]])
def test_nothing_is_wider_than_a_phone(names, tmp_path):
    script = (
        "<script>onload = () => {document.title = 'width ' +"
        " document.querySelector('iframe').contentDocument.documentElement.scrollWidth}</script>"
    )
    page = html.escape(sensor_page(made_up(names)))
    frame = f'<!DOCTYPE html><iframe width="390" height="844" srcdoc="{page}"></iframe>{script}'
    (tmp_path / "frame.html").write_text(frame, "utf-8")
    told = browse(tmp_path, "--dump-dom", f"file://{tmp_path}/frame.html")
    assert re.search("width ([0-9]+)", told)[1] == "390"
