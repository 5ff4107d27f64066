"""``report.html``: well formed, alone, escaped, and with everything in it."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest
from camera.catalogue import LIBRARY
from made_up_diagnosis import HOSTILE, everything, nothing, strange, unfinished

from adv2e.effects import separated_by
from adv2e.reports.findings import MARKS
from adv2e.reports.markup import OF_TABLES
from adv2e.reports.page import page
from adv2e.reports.result import Estimate, Rejected, ResidualMap, Signature, Snapshot, Total
from adv2e.reports.summary import details_text

EMPTY = {"br", "img", "meta"}
LOADING = {"src", "href", "srcset", "data", "action", "poster"}


class Outline(HTMLParser):
    """Checks that elements are closed in order, and collects what the tests ask for."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.names, self.loads, self.texts = [], [], [], []
        self.headings, self.unnamed = [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, name, attributes):
        given = dict(attributes)
        assert len(given) == len(attributes)
        self.names.append(name)
        self.loads += [given[key] for key in LOADING & set(given)]
        if name == "img" and not given.get("alt"):
            self.unnamed.append(name)
        if name not in EMPTY:
            self.open.append(name)

    def handle_startendtag(self, name, attributes):
        raise AssertionError(f"<{name}/>")

    def handle_endtag(self, name):
        assert self.open.pop() == name

    def handle_data(self, data):
        self.texts.append(data)
        if self.open and self.open[-1] in ("h1", "h2", "h3"):
            self.headings.append((self.open[-1], data))

    @property
    def text(self):
        return "\n".join(self.texts)


@pytest.fixture(scope="module")
def full():
    return page(everything())


@pytest.mark.parametrize("make", [everything, nothing, strange])
def test_the_page_is_well_formed_and_alone(make):
    text = page(make())
    outline = Outline(text)
    assert text.startswith("<!DOCTYPE html>\n<html lang=")
    assert text.isprintable() or not re.search("[\x00-\x08\x0b-\x1f]", text)
    assert all(load.startswith("data:image/png;base64,") for load in outline.loads)
    assert not {"link", "iframe", "object", "use", "base"} & set(outline.names)
    assert not re.search(r"url\(|@import|xmlns", text)
    assert outline.names.count("script") == outline.names.count("h1") == 1
    assert not outline.unnamed
    # every table has its caption and every picture its title
    assert outline.names.count("table") == outline.names.count("caption")
    assert outline.names.count("svg") == outline.names.count("title") - 1
    assert text.encode("utf-8").decode("utf-8") == text
    assert len(text.encode()) < 2_000_000


def test_only_text_names_addresses_elsewhere(full):
    assert "://" not in full
    text = page(strange())
    assert "http://x.y" in Outline(text).text
    assert '="http' not in text


def test_texts_are_shown_as_they_are():
    shown = Outline(page(strange())).texts
    whole = HOSTILE.replace("\x00", "\ufffd").replace("\udc80", "\ufffd")
    assert whole in shown
    assert shown.count(whole) >= 15


def test_what_was_tried_is_sorted_by_what_it_explains():
    shares = {"a": 0.9, "b": None, "c": 0.352, "d": 1.25, "e": float("nan"), "f": 0.7}
    given = [Rejected(name, f"why not {name}", {}, share) for name, share in shares.items()]
    tried = replace(everything(), rejected=given)
    section = page(tried).partition(">Effects tried and not added")[2].partition("</table>")[0]
    rows = re.findall(r'scope="row">(\w).*?data-label="explains">([^<]*)<', section)
    wanted = ["64.8 %", "30.0 %", "10.0 %", "-25.0 %", "-", "-"]
    assert rows == list(zip("cfadbe", wanted, strict=True))
    told = details_text(tried)
    assert [told.index(f"why not {name}") for name in "cfadbe"] == sorted(
        told.index(f"why not {name}") for name in shares
    )


def test_headings_come_in_order(full):
    headings = Outline(full).headings
    assert headings[0] == ("h1", "Diagnosis of office_zigzag.zip")
    assert [text for level, text in headings if level == "h2"] == [
        "What to do next",
        "What was found",
        "Effects that fit as well",
        "What differs most",
        "Curves: measured and simulated",
        "Values that were not declared and were fitted",
        "Notes",
        "Pixels with too many or too few events",
        "Effects that were tried and not added",
        "Which data were used",
        "Other measures of the error",
        "All numbers that were compared",
        "How large an effect must be to be seen",
        "Sizes, seeds, times and versions",
    ]
    assert ("h3", "Dead time (refractory)") in headings


def test_the_first_screen_holds_finding_error_and_next_step(full):
    first, section, _ = full.partition("<section")
    assert section
    assert "<details" not in first
    assert everything().sentence in Outline(f"{first}</main></body></html>").text
    places = [first.index(part) for part in ("sentence", 'class="bars"', "What to do next")]
    assert places == sorted(places)
    assert first.count('class="bars"') == 1
    assert everything().errors[0].name in first


def test_other_errors_are_folded_away(full):
    heading = full.index(">Other measures of the error<")
    _, *others = (match.start() for match in re.finditer('class="bars"', full))
    assert len(others) == len(everything().errors) - 1
    assert all(full.rindex("<details", 0, place) < heading < place for place in others)
    assert "<details open" not in full


def test_the_line_to_copy_names_the_folder():
    copied = '<pre class="copy"><code>adv2e convert -c some/where/model.yaml VIDEO</code></pre>'
    assert copied in page(everything(), "some/where")


def test_values_stand_beside_the_declared_ones(full):
    for path, value in (
        ("pixel.refractory.period_us", "500"),
        ("pixel.low_pass.cutoff_hz", "300 (default)"),
        ("pixel.thresholds.on", "0.2"),
    ):
        row = re.search(f"<code>{re.escape(path)}</code>.*?</tr>", full)[0]
        assert f'data-label="declared">{value}</td>' in row
    off = page(replace(everything(), declared_values={"pixel.refractory.period_us": None}))
    assert 'data-label="declared">off</td>' in off


def test_every_cell_has_its_heading_for_narrow_screens(full):
    assert full.count("<td") == full.count('data-label="') > 50


def test_paper_holds_what_matters(full):
    kinds = re.findall(r'<details class="(\w+)"><summary><h2>([^<]*)', full)
    assert {heading for kind, heading in kinds if kind == "screen"} == {
        "Other measures of the error",
        "All numbers that were compared",
        "How large an effect must be to be seen",
    }
    assert "details.paper" in full[full.index("<script>") :]
    assert "details.screen { display: none; }" in full


def test_the_page_says_what_was_found(full):
    text = Outline(full).text
    for part in (
        everything().sentence,
        "1.38 (1.31 to 1.46)",
        "0.31 (0.29 to 0.34)",
        "p < 0.001",
        "p = 0.34",
        "Refractory period: after each event the pixel is dead",
        "pixel.refractory.period_us",
        "6,000",
        "5,500 to 6,500",
        "µs",
        "dead time after an event",
        separated_by("reset_overshoot"),
        "no line in the spectrum beyond chance",
        "frames.flicker.depth = 0.002",
        "0.2 %",
        "740",
        "3.4 %",
        "Blocks of 0.5 s",
        "Interpolation between frames",
        "simulations",
        "412",
        "Time between events",
    ):
        assert part in text


def test_the_page_of_a_table_holds_what_a_table_can_show():
    empty = {name: [] for name in ("signatures", "maps", "detectable", "masked")}
    outline = Outline(page(replace(everything(), **empty, wording=OF_TABLES)))
    assert outline.headings[0] == ("h1", "Characterisation of office_zigzag.zip")
    absent = (
        "What differs most",
        "All numbers that were compared",
        "How large an effect must be to be seen",
    )
    assert not {text for _, text in outline.headings} & set(absent)
    for part in ("no line in the spectrum beyond chance", "Blocks of 0.5 s", "standard errors"):
        assert part in outline.text


@pytest.mark.parametrize("verdict", MARKS)
def test_every_verdict_has_a_sign_and_a_word(verdict):
    text = page(replace(everything(), verdict=verdict))
    sign, word = MARKS[verdict]
    assert f'class="verdict {verdict}"' in text
    assert f'<span aria-hidden="true">{sign}</span> {word}</span>' in text


def test_a_page_of_what_is_known_so_far_says_so_and_of_which_data_its_numbers_are():
    text = Outline(page(unfinished())).text
    assert "Not finished, still searching: fitting leak. So far: dead time: 6.0 ms" in text
    assert "Load this page again" in text
    assert "adv2e convert" not in text
    assert "on the data for fitting" in text
    assert "on data that was not used for fitting" not in text
    assert "on data that was not used for fitting" in Outline(page(everything())).text


def test_signs_of_unlike_verdicts_differ():
    assert len({MARKS[name][0] for name in set(MARKS) - {"consistent"}}) == 5


def signature_names(text):
    section = text[text.index(">All numbers that") : text.index(">How large an effect")]
    return re.findall(r'<span title="[^"]*">([^<]*)</span>', section), section


def test_signatures_are_sorted_marked_and_folded(full):
    names, section = signature_names(full)
    kinds = ["count", "time", "other"]
    wanted = sorted(
        everything().signatures, key=lambda one: (kinds.index(one.kind), -abs(one.z_before))
    )
    assert names == [one.name for one in wanted]
    assert names[:3] == ["events", "ON share", "shortest 1 % of times"]
    assert section.count("<details>") == 1
    large = [z for one in wanted for z in (one.z_before, one.z_after) if abs(z) > 3]
    assert len(re.findall("▲|▼", section)) == len(large) + 2  # and once each in words
    assert "9 of 25 before, 1 after" in section
    assert 'title="Where two events' in section


def test_short_tables_are_not_folded_and_unknown_distances_come_last():
    nan = float("nan")
    rows = [
        Signature(n, "g", "m", 1, 1, 1, z, 0, "events")
        for n, z in zip("abcd", (nan, 1, -9, nan), strict=True)
    ]
    names, section = signature_names(page(replace(everything(), signatures=rows)))
    assert names == ["c", "b", "a", "d"]
    assert "<details>" not in section


def test_every_number_that_is_compared_has_its_unit(full):
    rows = re.findall(r"<tr><th.*?</tr>", full[full.index(">All numbers that") :])
    units = {one.meaning: one.unit for one in everything().signatures}
    compared = [row for row in rows if any(meaning in row for meaning in units)]
    assert len(compared) == len(everything().signatures)
    for row in compared:
        assert re.search(r'data-label="unit">(ms|events|of 1)<', row)
        assert 'data-label="z before [sd]"' in row


def test_errors_and_keys_without_a_unit_say_so(full):
    assert "as a share of the measured events: 0 is no difference, 1 as much as with no" in full
    row = re.search(r"<code>readout.loss.fraction</code>.*?</tr>", full)[0]
    assert 'data-label="unit">no unit<' in row
    row = re.search(r"<code>pixel.thresholds.on</code>.*?</tr>", full)[0]
    assert 'data-label="unit">ln<' in row
    row = re.search(r"<code>frames.encoding</code>.*?</tr>", full)[0]  # a word, no number
    assert "no unit" not in row


def pictures_of_events(text):
    """Return names, numbers of events and pictures, as they stand beside one another."""
    (beside,) = re.findall('<div class="three">(.*?)</div>', text)
    found = re.findall(
        r'class="line">(.*?)</span>([\d,]+ events?)<span class="meaning">(.*?)</span>'
        r'.*?base64,([^"]*)"',
        beside,
    )
    names, numbers, split, data = zip(*found, strict=True)
    images = [
        cv2.imdecode(np.frombuffer(base64.b64decode(one), np.uint8), cv2.IMREAD_COLOR)
        for one in data
    ]
    return names, numbers, split, images


def test_events_are_shown_as_measured_declared_and_found_in_the_same_colours():
    number = np.zeros((3, 2, 6, 8), np.int64)  # of each picture: OFF, ON
    number[0, 1, 2, 3], number[1, 1, 2, 3], number[2, 1, 2, 3] = 1, 4, 1
    number[0, 0, 4, 5] = number[1, 0, 0, 0] = 2
    text = page(replace(everything(), snapshot=Snapshot(0.25, 0.02, *number)))
    names, numbers, split, images = pictures_of_events(text)
    assert names == ("measured", "as declared (before)", "with what was found (after)")
    assert numbers == ("3 events", "6 events", "1 event")
    assert split == ("1 ON, 2 OFF", "4 ON, 2 OFF", "1 ON, 0 OFF")
    assert "Events of 20 ms: 0.250 to 0.270 s after the start" in text
    # all before what is to be done, at the same size
    assert text.index('class="three"') < text.index("What to do next")
    assert len({image.shape for image in images}) == 1
    scale = images[0].shape[1] // 8
    measured, declared, found = (
        image[scale // 2 :: scale, scale // 2 :: scale] for image in images
    )
    # one event has one colour in all, and more are stronger
    np.testing.assert_array_equal(measured[2, 3], found[2, 3])
    assert declared[2, 3].sum() < measured[2, 3].sum()
    np.testing.assert_array_equal(measured[4, 5], declared[0, 0])
    blue, _, red = measured[2, 3].astype(int)
    assert red > blue
    blue, _, red = measured[4, 5].astype(int)
    assert blue > red
    assert (measured[5] == 255).all()


def test_where_nothing_was_found_two_pictures_are_shown(full):
    assert len(pictures_of_events(full)[0]) == 3
    text = page(replace(everything(), verdict="consistent", effects=[]))
    assert pictures_of_events(text)[0] == ("measured", "as declared (before)")
    assert 'data-label="with what was found' not in text


def test_a_time_without_events_is_shown():
    empty = Snapshot(0.0, 1.0, *np.zeros((3, 2, 4, 5), np.int64))
    _, numbers, _, images = pictures_of_events(page(replace(everything(), snapshot=empty)))
    assert set(numbers) == {"0 events"}
    assert all((image == 255).all() for image in images)


def test_totals_come_before_all_other_numbers():
    totals = [Total("ON events", "events", 12.0, Estimate(34.0, (30.0, 38.0)), Estimate(13.0))]
    text = page(replace(everything(), totals=totals))
    row = re.search(r'scope="row">ON events</th>.*?</tr>', text)[0]
    cells = re.findall(r'data-label="([^"]*)">([^<]*)<', row)
    assert cells == [
        ("measured", "12.0"),
        ("as declared (before)", "34 (30 to 38)"),
        ("with what was found (after)", "13.0"),
        ("unit", "events"),
    ]
    assert text.index(row) == text.index('scope="row"')  # the first row of all tables
    assert text.index(row) < text.index("What to do next")


@pytest.mark.thorough
def test_maps_of_usual_sensors_keep_the_page_small():
    draws = np.random.default_rng(5).normal(size=(2, 260, 346))
    maps = [ResidualMap("m", *draws), ResidualMap("n", *draws[::-1])]
    text = page(replace(everything(), maps=maps))
    assert len(text.encode()) < 2_000_000


def test_remarks_end_in_what_they_mean_here(full):
    told = re.findall("<p[^>]*>(Probability.*?|Many numbers were.*?)</p>", full)
    assert len(told) == 2
    assert (
        "Here, chance may make all that is left, and the error is 16 % above its floor." in told[0]
    )
    assert "Here, these are the marks of what was found" in told[1]
    left = replace(everything(), verdict="unexplained", effects=[], global_p_after=1e-4)
    text = page(left)
    assert "Here, chance does not make all that is left" in text
    assert "Here, something that the library lacks makes these differences." in text


def test_of_one_model_one_map_is_shown(full):
    (one,) = everything().maps
    same = page(replace(everything(), maps=[replace(one, after=one.before)]))
    assert full.count("<img") - same.count("<img") == 1


def test_the_same_diagnosis_gives_the_same_page(full):
    assert page(everything()) == full


def test_every_effect_of_the_library_has_its_separation():
    assert all(map(separated_by, LIBRARY))
