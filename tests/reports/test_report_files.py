"""The files of a diagnosis come into place together, and the model can be used."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_diagnosis import MODEL, everything, nothing, strange, unfinished

from adv2e.config import from_dict, load_config
from adv2e.config.yaml12 import Origin, parse
from adv2e.errors import Adv2eWarning, OutputError
from adv2e.reports import files
from adv2e.reports.files import check_folder, is_unfinished, model_text, so_far, write_reports
from adv2e.reports.quantities import native
from adv2e.reports.result import ErrorRow, Estimate, Finding
from adv2e.reports.summary import summary_text

NAMES = ["model.yaml", "report.html", "report.json"]


def listing(folder):
    return sorted(entry.name for entry in folder.iterdir())


@pytest.mark.parametrize("make", [everything, nothing, strange])
def test_three_files_are_written(make, tmp_path):
    write_reports(make(), tmp_path / "new" / "found")
    assert listing(tmp_path / "new" / "found") == NAMES
    assert listing(tmp_path) == ["new"]


def test_an_existing_folder_is_kept(tmp_path):
    write_reports(everything(), tmp_path / "found")
    before = (tmp_path / "found" / "report.json").read_bytes()
    with pytest.raises(OutputError, match="exists already; --overwrite replaces it"):
        check_folder(tmp_path / "found")
    with pytest.raises(OutputError, match="exists already; --overwrite replaces it"):
        write_reports(nothing(), tmp_path / "found")
    assert (tmp_path / "found" / "report.json").read_bytes() == before
    check_folder(tmp_path / "found", overwrite=True)
    write_reports(nothing(), tmp_path / "found", overwrite=True)
    assert (tmp_path / "found" / "report.json").read_bytes() != before
    assert listing(tmp_path) == ["found"]


def test_a_folder_with_other_things_is_never_replaced(tmp_path):
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(OutputError, match=r"holds thesis\.txt"):
        write_reports(everything(), tmp_path, overwrite=True)
    assert listing(tmp_path) == ["thesis.txt"]


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder that nobody can write to")
def test_a_folder_that_cannot_be_made_is_told_before_the_work():
    with pytest.raises(OutputError, match=r"^/proc/a/b: cannot be made in /proc: "):
        check_folder("/proc/a/b")


def test_a_free_name_is_left_untouched_by_the_check(tmp_path):
    check_folder(tmp_path / "a" / "b")
    assert listing(tmp_path) == []


def test_what_fails_leaves_nothing(tmp_path, monkeypatch):
    def full_disk(diagnosis):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "model_text", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_reports(everything(), tmp_path / "found")
    assert listing(tmp_path) == []


def test_an_interruption_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(path, text, **options):
        path.touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "write_text", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_reports(everything(), tmp_path / "new" / "found")
    assert listing(tmp_path) == []


def test_one_that_is_not_finished_is_replaced_and_what_lies_beside_it_stays(tmp_path):
    folder = tmp_path / "found"
    write_reports(unfinished(), folder)
    assert is_unfinished(folder)
    assert load_config([folder / "model.yaml"]).pixel.refractory.period_us == 6012.34
    check_folder(folder)
    (folder / "note.txt").write_text("mine")
    for make in (unfinished, everything):
        write_reports(make(), folder)
        assert listing(folder) == [NAMES[0], "note.txt", *NAMES[1:]]
    assert not is_unfinished(folder)
    assert listing(tmp_path) == ["found"]
    with pytest.raises(OutputError, match="exists already"):
        write_reports(everything(), folder)


@pytest.mark.parametrize("text", ["", "[1, 2]", '{"complete": 0}', "{}", None])
def test_any_other_folder_holds_nothing_to_be_replaced(text, tmp_path):
    if text is not None:
        (tmp_path / "report.json").write_text(text)
    assert not is_unfinished(tmp_path)


@pytest.mark.parametrize("ending", [None, KeyboardInterrupt, OSError])
@pytest.mark.parametrize("older", [None, unfinished, everything])
def test_what_is_known_so_far_stays_if_the_work_is_interrupted(ending, older, tmp_path):
    folder, beside = tmp_path / "found", tmp_path / "found.unfinished"
    if older is not None:
        write_reports(older(), folder)
    before = record_of(folder)
    place = beside if older is everything else folder
    try:
        with so_far(folder, overwrite=True) as known:
            assert record_of(folder) == before
            for _ in range(2):
                known(unfinished())
                assert is_unfinished(place)
            if ending is not None:
                raise ending
            write_reports(nothing(), folder, overwrite=True)
    except (KeyboardInterrupt, OSError) as error:
        assert type(error) is ending
    kept = [place.name] if ending is KeyboardInterrupt else []
    done = ["found"] if ending is None or older is everything else []
    assert listing(tmp_path) == sorted({*kept, *done})
    if older is everything and ending is not None:
        assert record_of(folder) == before
    if ending is None:
        assert not is_unfinished(folder)


def record_of(folder):
    path = folder / "report.json"
    return path.read_bytes() if path.exists() else None


def test_an_older_one_is_left_by_work_that_fails_before_anything_is_known(tmp_path):
    write_reports(unfinished(), tmp_path / "found")
    with pytest.raises(OSError, match="gone"), so_far(tmp_path / "found"):
        raise OSError("gone")
    assert is_unfinished(tmp_path / "found")


def test_work_goes_on_where_what_is_known_cannot_be_kept(tmp_path):
    with so_far(tmp_path / "found") as known:
        (tmp_path / "found").write_text("a file meanwhile")
        with pytest.warns(Adv2eWarning, match=r"cannot be kept: .*found: is a file"):
            known(unfinished())
    assert (tmp_path / "found").read_text() == "a file meanwhile"


def test_other_things_beside_are_told_before_the_work(tmp_path):
    write_reports(everything(), tmp_path / "found")
    (tmp_path / "found.unfinished").mkdir()
    with (
        pytest.raises(OutputError, match=r"found\.unfinished: exists already"),
        so_far(tmp_path / "found", overwrite=True),
    ):
        raise AssertionError("it is not begun")


def test_errors_of_the_system_name_the_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "NAMES", ("report.html", "report.json", "no/such/folder.txt"))
    with pytest.raises(OutputError, match="found: cannot be written: No such file"):
        write_reports(everything(), tmp_path / "found")
    assert listing(tmp_path) == []


def test_the_model_is_read_back(tmp_path):
    write_reports(everything(), tmp_path / "found")
    config = load_config([tmp_path / "found" / "model.yaml"])
    assert config == from_dict(native(MODEL))
    assert config.pixel.refractory.period_us == 6012.34
    assert config.pixel.low_pass.cutoff_hz == 187.123456
    assert config.seed == 3


def test_an_empty_model_is_read_back(tmp_path):
    write_reports(nothing(), tmp_path / "found")
    assert load_config([tmp_path / "found" / "model.yaml"]) == load_config()


def test_hostile_names_stay_in_comments(tmp_path):
    write_reports(strange(), tmp_path / "found")
    config = load_config([tmp_path / "found" / "model.yaml"])
    assert config.pixel.thresholds.on == 0.25
    assert config.pixel.leak is None


def test_the_model_says_where_its_values_are_from():
    lines = {line.split(":")[0].strip(): line for line in model_text(everything()).splitlines()}
    assert lines["period_us"].endswith("# [us] added: refractory, 95 % interval 5,500 to 6,500")
    assert lines["cutoff_hz"].endswith("# [Hz] added: low_pass, 95 % interval 172 to 204")
    assert lines['"on"'].endswith('"on": 0.21  # [ln] nuisance')
    assert lines['"off"'].endswith('"off": 0.2  # [ln]')
    assert lines["encoding"].endswith("# nuisance")
    assert lines["source_follower"].strip() == "source_follower: null"
    assert all(len(line) <= 100 for line in model_text(everything()).splitlines())


_SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False)
    | st.text(max_size=20)
    | st.sampled_from(["on", "No", "y", "~", "1e3", "1_000", "12:30:00", "2001-12-14", "0x1F"])
)
_KEYS = st.text(max_size=20) | st.sampled_from(["on", "off", "yes", "n", "null", "1e3", "on: 1"])


@settings(max_examples=100, deadline=None)
@given(
    st.dictionaries(
        _KEYS,
        st.recursive(
            _SCALARS,
            lambda part: st.lists(part, max_size=3) | st.dictionaries(_KEYS, part, max_size=3),
            max_leaves=5,
        ),
        max_size=4,
    )
)
@pytest.mark.thorough
def test_readers_of_either_version_of_yaml_read_what_was_written(model):
    text = model_text(replace(everything(), model=model))
    assert yaml.safe_load(text) == model
    assert _content(parse(text, Origin("model.yaml"))) == model


def _content(value):
    if isinstance(value.content, dict):
        return {key: _content(item) for key, item in value.content.items()}
    if isinstance(value.content, list):
        return [_content(item) for item in value.content]
    return value.content


def test_a_model_that_another_program_wrote_back_is_the_same(tmp_path):
    """PyYAML reads and writes YAML 1.1, in which a bare on is true."""
    write_reports(everything(), tmp_path / "found")
    path = tmp_path / "found" / "model.yaml"
    config = load_config([path])
    bare = path.read_text("utf-8").replace('"on"', "on").replace('"off"', "off")
    for text in (path.read_text("utf-8"), bare):
        read = yaml.safe_load(text)
        path.write_text(yaml.safe_dump(read), "utf-8")
        assert load_config([path]) == config == from_dict(read)


def test_lists_are_written_in_one_line():
    model = {"frames": {"shift_px": [0.5, -0.25]}}
    text = model_text(replace(everything(), model=model))
    assert yaml.safe_load(text) == model
    assert "shift_px: [0.5, -0.25]" in text


@pytest.mark.parametrize("make", [everything, nothing, strange])
def test_the_summary_is_short(make):
    lines = summary_text(make()).splitlines()
    assert len(lines) < 15
    assert max(map(len, lines)) <= 100
    assert all(line.isprintable() or "\ufffd" in line for line in lines)


def test_the_summary_says_the_result():
    assert summary_text(everything()).splitlines() == [
        "Dead time: 6.0 ms (5.5 to 6.5), declared 0.5 ms; low-pass of the photoreceptor: corner at"
        " white",
        "  187 Hz (172 to 204), declared 300 Hz (default); or instead: overshoot of the reset.",
        "  explained: With this change nothing is left that these data show.",
        "  refractory: pixel.refractory.period_us = 6,000 us (5,500 to 6,500), declared 500",
        "  low_pass: pixel.low_pass.cutoff_hz = 187 Hz (172 to 204), declared 300 (default)",
        "or instead: reset_overshoot",
        "error 1.38 -> 0.312 (floor 0.270): distance of the streams smoothed in time (mean of 2,"
        " 10, 50 and",
        "  100 ms)",
        "p < 0.001 -> 0.34",
    ]


def test_the_summary_of_random_events_says_how_far_their_mean_is():
    """An error that rises, where the model has got what makes events at random."""
    own = ErrorRow("from the mean", Estimate(0.7), Estimate(0.6), Estimate(0.6), True)
    for after, shown in ((0.7, True), (0.3, False)):
        row = ErrorRow("distance", Estimate(0.5), Estimate(after), Estimate(0.3))
        text = summary_text(replace(everything(), errors=[row, own]))
        assert ("error 0.700 -> 0.600 (floor 0.600): from the mean" in text) == shown


def test_the_summary_ends_with_what_may_be_wrong_with_the_recording():
    checks = ["no frames from 0.1 to 0.2 s", "ON events come where the light falls", "a third"]
    lines = summary_text(replace(everything(), input_checks=checks)).splitlines()
    assert lines[-2:] == [f"note: {line}" for line in checks[:2]]


def test_long_intervals_are_not_cut_off():
    one = Finding(
        "misregistration",
        {"frames.shift_px": [-0.01907, 0.01512]},
        {"frames.shift_px": ([-0.03441, -0.002736], [0.00327, 0.0323])},
    )
    text = " ".join(summary_text(replace(everything(), effects=[one])).split())
    assert "([-0.03441, -0.002736] to [0.00327, 0.0323])" in text


def test_the_summary_counts_what_it_leaves_out():
    diagnosis = everything()
    many = replace(
        diagnosis,
        effects=diagnosis.effects * 9,
        remark="word " * 300,
        alternatives=["alternative"] * 60,
    )
    lines = summary_text(many).splitlines()
    assert len(lines) < 15
    assert "  and 14 more parameters" in lines
