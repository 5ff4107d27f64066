"""Pictures: every value at its place, gaps where there is none."""

import base64
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from made_up_diagnosis import everything, strange

from adv2e.reports.charts import (
    Axis,
    axis_over,
    band_path,
    colour_bar,
    colours,
    curve_chart,
    curves,
    drawable,
    error_chart,
    line_path,
    map_image,
    points_of,
)
from adv2e.reports.markup import OF_RECORDINGS
from adv2e.reports.result import Band, Curve, ErrorRow, Estimate

NAN = np.nan
ANY = hnp.arrays(np.float64, st.integers(0, 8), elements=st.floats())


def path_of(svg, class_):
    """Return the points of the last path of that class, in runs."""
    *_, data = re.findall(rf'<path d="([^"]*)" class="{class_}">', svg)
    runs = re.findall(r"M([^MZ]*)", data)
    return [[tuple(map(float, point.split())) for point in run.split("L")] for run in runs]


def texts(svg, anchor):
    """Return texts with their places."""
    found = re.findall(rf'<text x="([-\d.]+)" y="([-\d.]+)" text-anchor="{anchor}">([^<]*)', svg)
    return {text: (float(x), float(y)) for x, y, text in found}


def test_axes_place_values_in_proportion():
    axis = Axis(10, 20, 100, 200)
    np.testing.assert_allclose(axis.place(np.array([10, 15, 20, NAN])), [100, 150, 200, NAN])
    log = Axis(1, 100, 300, 100, log=True)
    np.testing.assert_allclose(
        log.place(np.array([1.0, 10, 100, 0, -1])), [300, 200, 100, NAN, NAN]
    )


@settings(deadline=None)
@given(ANY, st.booleans(), st.booleans())
def test_an_axis_shows_all_that_can_be_drawn(values, log, tight):
    values = drawable(values)
    shown = values[np.isfinite(values) & ((values > 0) | (not log))]
    axis = axis_over([values], 0, 100, log=log, tight=tight)
    if not len(shown):
        assert axis is None
        return
    assert np.isfinite([axis.low, axis.high]).all()
    assert axis.low <= shown.min() <= shown.max() <= axis.high
    places = axis.place(shown)
    assert (places >= -1e-6).all()
    assert (places <= 100 + 1e-6).all()
    assert axis.ticks()


def test_axes_begin_at_zero_where_nothing_is_below():
    for values in ([1.0, 10], [9.0, 10], [0.0, 5], [7.0, 7], [0.0, 0]):
        axis = axis_over([np.array(values)], 0, 1, log=False)
        assert (axis.low, axis.ticks()[0][1]) == (0, "0")
    assert axis_over([np.array([-3.0, 10])], 0, 1, log=False).low < -3
    assert axis_over([np.array([9.0, 10])], 0, 1, log=False, tight=True).low == 9


def test_rates_are_drawn_from_zero_on():
    high = flat("rate of events", 1)  # far above zero
    svg = curve_chart(high)
    assert texts(svg, "end")["0"][1] == max(y for _, y in texts(svg, "end").values())
    (line,) = path_of(svg, "curve before")
    bottom, top = texts(svg, "end")["0"][1] - 4, texts(svg, "end")["10"][1] - 4
    assert line[0][1] == pytest.approx(top, abs=0.2)
    assert bottom - top > 80  # ten of some twelve are most of the height


def test_rates_across_begin_at_zero_too():
    against_rates = replace(flat("rate against rate", 1), x=np.array([200.0, 300, 400]))
    assert texts(curve_chart(against_rates), "middle")["0"][0] == pytest.approx(58)
    bins = replace(against_rates, x=np.array([200.0, 300, 400, 500]))
    assert "0" not in texts(curve_chart(bins), "middle")


def test_bins_with_names_have_them_at_their_middles():
    curve = replace(flat("thirds", 1), x=np.arange(4.0), x_names=("dark", "medium", "bright"))
    labels = texts(curve_chart(curve), "middle")
    assert labels.keys() >= {"dark", "medium", "bright"}
    places = [labels[name][0] for name in ("dark", "medium", "bright")]
    assert places == pytest.approx([58 + 288 * share for share in (1 / 6, 1 / 2, 5 / 6)], abs=0.1)
    assert not {"0", "1", "2", "3"} & labels.keys()


def test_lines_have_gaps_and_lone_points():
    ys = np.array([1.0, 2, NAN, 4, NAN])
    assert line_path(np.arange(5.0), ys) == "M0.0 1.0L1.0 2.0M1.0 4.0L5.0 4.0"
    assert line_path(np.arange(0.0), np.arange(0.0)) == ""


def test_bands_go_round_the_area():
    path = band_path(np.array([0.0, 1]), np.array([9.0, 8]), np.array([1.0, 2]))
    assert path == "M0.0 1.0L1.0 2.0L1.0 8.0L0.0 9.0Z"


def test_bins_are_steps():
    xs, ys = points_of(np.array([0.0, 1, 3]), np.array([5.0, 6]))
    np.testing.assert_array_equal(xs, [0, 1, 1, 3])
    np.testing.assert_array_equal(ys, [5, 5, 6, 6])


def test_curves_lie_where_their_values_are():
    x, measured = np.array([0.0, 5, 10]), np.array([1.0, NAN, 3])
    band = Band(np.array([2.0, 2, 2]), np.array([1.0, 1, 1]), np.array([4.0, 4, 4]))
    other = Band(band.middle + 4, band.low + 4, band.high + 4)
    svg = curve_chart(Curve("t", "x [s]", "y [Hz]", x, measured, band, other))
    labels = texts(svg, "end")
    zero, four = labels["0"], labels["4"]
    per_unit = (four[1] - zero[1]) / 4

    def height(value):
        return zero[1] - 4 + value * per_unit  # text stands 4 below the tick it names

    (line,) = path_of(svg, "curve before")
    assert [y for _, y in line] == pytest.approx([height(2)] * 3, abs=0.2)
    (line,) = path_of(svg, "curve after")
    assert [y for _, y in line] == pytest.approx([height(6)] * 3, abs=0.2)
    (area,) = path_of(svg, "band before")
    assert {round(y) for _, y in area} == {round(height(4)), round(height(1))}
    first, last = path_of(svg, "curve measured")
    assert first[0][1] == pytest.approx(height(1), abs=0.2)
    assert last[0][1] == pytest.approx(height(3), abs=0.2)
    assert svg.count("<circle") == 2


def test_repeated_measurements_are_points_without_a_line():
    x, measured = np.array([1.0, 1, 2]), np.array([1.0, 3, NAN])
    band = Band(np.full(3, 2.0), np.full(3, 0.5), np.full(3, 2.5))
    other = Band(band.middle, band.low, np.full(3, 4.0))
    svg = curve_chart(Curve("t", "x", "y", x, measured, band, other))
    assert 'class="curve measured"' not in svg
    assert svg.count("<circle") == 2
    title = re.search("<title>(.*)</title>", svg)[1]
    assert "Of 2 measured values 1 lie in the band of the declared model, 2 in" in title


def test_bands_that_reach_zero_end_at_the_bottom_of_a_logarithm():
    values = np.array([10.0, 10])
    band = Band(values, np.array([0.0, 1]), values * 2)
    other = Band(values, np.array([1.0, 1]), values * 2)
    svg = curve_chart(
        Curve("t", "x", "y", np.array([1.0, 2]), values, other, band, y_log=True)
    )  # fmt: skip
    (area,) = path_of(svg, "band after")
    bottoms = sorted((y for _, y in area), reverse=True)
    assert bottoms[0] > bottoms[1] > bottoms[2]
    axis = re.search(r'<line x1="58.0" y1="([\d.]+)" x2="346.0" y2="\1" class="axis">', svg)
    assert bottoms[0] == pytest.approx(float(axis[1]), abs=0.1)


@settings(deadline=None)
@given(ANY, st.booleans(), st.booleans(), st.booleans())
def test_any_curve_can_be_drawn(values, bins, x_log, y_log):
    x = np.arange(len(values) + bins, dtype=float)
    with np.errstate(all="ignore"):
        band = Band(values, values - 1, values + 1)
    svg = curve_chart(Curve("t", "x", "y", x, values, band, band, x_log=x_log, y_log=y_log))
    assert "nan" not in svg
    assert "inf" not in svg


def widths(chart):
    """Return the width of each role's bar, in percent."""
    bars = re.findall(r'<div class="bar (\w+)">(.*?)</div>', chart)
    found = {role: re.search(r'class="fill" style="width:([\d.]+)%"', bar) for role, bar in bars}
    return {role: bar and float(bar[1]) for role, bar in found.items()}


def test_bars_of_errors_are_as_long_as_the_errors_are_large():
    row = ErrorRow("e", Estimate(200.0, (180.0, 230.0)), Estimate(50.0), Estimate(40.0))
    chart = error_chart(row)
    per_cent = 230.0 / 100.0
    wanted = {"before": 200.0, "after": 50.0, "floor": 40.0}
    assert widths(chart) == {
        role: pytest.approx(size / per_cent, abs=0.1) for role, size in wanted.items()
    }
    whisker = r'class="whisker" style="left:([\d.]+)%;width:([\d.]+)%"'
    left, width = re.search(whisker, chart).groups()
    assert float(left) == pytest.approx(180.0 / per_cent, abs=0.1)
    assert float(width) == pytest.approx(50.0 / per_cent, abs=0.1)
    assert chart.count('class="whisker"') == 1
    assert "200 (180 to 230)" in chart


def test_errors_that_are_no_length_are_given_as_numbers_only():
    chart = error_chart(ErrorRow("n", Estimate(0.0), Estimate(2.5), Estimate(NAN)))
    assert widths(chart) == {"before": None, "after": 100.0, "floor": None}
    wild = ErrorRow("w", Estimate(1e-300, (-1.0, np.inf)), Estimate(1e300), Estimate(-1.0))
    assert widths(error_chart(wild)) == {"before": 0.0, "after": 100.0, "floor": None}
    assert not re.search(r"style=\"[^\"]*(nan|inf)", error_chart(wild))


def drawn(given):
    """Return the titles of the curves that are shown, and of those that are folded away."""
    shown, _, folded = curves(given, OF_RECORDINGS).partition("<details")
    return [re.findall("<figcaption>(.*?)</figcaption>", part) for part in (shown, folded)]


def flat(title, apart):
    """Return a curve of three points that are `apart` half widths from the declared band."""
    x, middle = np.arange(3.0), np.full(3, 10.0)
    near, far = Band(middle, middle - 2, middle + 2), middle + 2 * apart
    return Curve(title, "x", "y", x, far, near, Band(far, far - 1, far + 1))


def test_curves_that_differ_most_are_shown_and_the_others_folded():
    given = [flat(f"c{k}", 2 + k) for k in range(6)]
    assert drawn(given) == [["c5", "c4", "c3", "c2"], ["c1", "c0"]]
    assert drawn(given[:4]) == [["c3", "c2", "c1", "c0"], []]


def test_of_curves_of_one_kind_the_others_come_later():
    given = [flat("a, ON", 9), flat("a, OFF", 8), flat("b", 3), flat("c", 2), flat("d", 1)]
    assert drawn(given) == [["a, ON", "b", "c", "d"], ["a, OFF"]]


def test_what_chance_makes_is_no_reason_to_show_a_curve():
    wide = flat("wide", 1)
    wide = replace(wide, before=Band(wide.before.middle, wide.measured - 99, wide.measured + 99))
    wide = replace(wide, measured=wide.measured + 50)
    assert drawn([wide, *(flat(f"c{k}", 1.5) for k in range(4))])[1] == ["wide"]


def test_a_curve_that_is_not_known_is_no_reason_to_show_it():
    unknown = replace(flat("unknown", 1), measured=np.full(3, NAN))
    assert drawn([unknown, *(flat(f"c{k}", 2) for k in range(4))])[1] == ["unknown"]


def test_the_legend_says_what_lines_and_bands_are():
    legend = curves([flat("c", 1)], OF_RECORDINGS).partition("</ul>")[0]
    for text in ("measured", "declared model", "model found", "the middle 95 % of simulations"):
        assert text in legend
    assert "greyish where both overlap" in legend


def test_of_one_model_one_band_is_drawn():
    curve = flat("c", 1)
    text = curves([replace(curve, after=curve.before)], OF_RECORDINGS)
    assert "model found" not in text.partition("</ul>")[0]
    assert "overlap" not in text
    assert 'class="band before"' in text
    assert 'class="band after"' not in text


def test_all_pictures_of_odd_values_hold_numbers_only():
    for curve in strange().curves:
        for data in re.findall(r' (?:d|x|y|x1|y1|cx|cy)="([^"]*)"', curve_chart(curve)):
            assert re.fullmatch(r"[-\d.MLZ ]*", data)


def test_colours_are_blue_below_and_red_above():
    red, green, blue = colours(np.array(2.0))
    assert red > blue
    red, green, blue = colours(np.array(-2.0))
    assert blue > red
    red, green, blue = colours(np.array(0.0))
    assert red == green == blue == 247
    np.testing.assert_array_equal(colours(np.array([5.0, 99, np.inf])), [(103, 0, 31)] * 3)
    np.testing.assert_array_equal(colours(np.array([-5.0, -99, -np.inf])), [(5, 48, 97)] * 3)
    np.testing.assert_array_equal(colours(np.array([NAN])), [(128, 128, 128)])


def test_colours_darken_with_size():
    brightness = colours(np.linspace(0, 5, 40)).sum(axis=1)
    assert (np.diff(brightness.astype(int)) <= 0).all()
    brightness = colours(np.linspace(0, -5, 40)).sum(axis=1)
    assert (np.diff(brightness.astype(int)) <= 0).all()


def picture(image):
    data = re.search(r'src="data:image/png;base64,([^"]*)"', image)[1]
    decoded = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    return decoded[:, :, ::-1]


def test_maps_are_enlarged_and_upright():
    values = np.array([[-3.0, 0, NAN], [1.0, 2, 9]])
    image = map_image(values, 'a "map"')
    shown = picture(image)
    factor = shown.shape[1] // 3
    assert shown.shape == (2 * factor, 3 * factor, 3)
    assert shown.shape[1] >= 440
    np.testing.assert_array_equal(
        shown, np.kron(colours(values), np.ones((factor, factor, 1), np.uint8))
    )
    assert 'alt="a &quot;map&quot;"' in image


@pytest.mark.parametrize("shape", [(480, 1), (1, 480), (100, 2)])
def test_maps_of_narrow_sensors_are_no_larger_than_others(shape):
    shown = picture(map_image(np.zeros(shape), "map"))
    assert max(shown.shape) <= 900


def test_the_colour_bar_goes_from_end_to_end():
    shown = picture(colour_bar())
    assert [*map(tuple, shown[0, [0, -1]].tolist())] == [(5, 48, 97), (103, 0, 31)]
    assert "-5 to +5 standard deviations" in colour_bar()


def test_a_curve_without_numbers_says_so():
    curve = everything().curves[0]
    empty = np.full(len(curve.measured), NAN)
    band = Band(empty, empty, empty)
    text = curve_chart(replace(curve, measured=empty, before=band, after=band))
    assert "nothing to draw" in text
    assert "<svg" not in text
