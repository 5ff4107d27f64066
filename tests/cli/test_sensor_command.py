"""``adv2e sensor``: the page, its numbers for programs, and what it refuses."""

import json
from html.parser import HTMLParser

import pytest
from click.testing import CliRunner

from adv2e.cli import main


def run(*words):
    return CliRunner().invoke(main, ["sensor", *map(str, words)])


class Page(HTMLParser):
    """Counts the elements, and keeps what would be loaded from elsewhere."""

    def __init__(self, text):
        super().__init__()
        self.count, self.loaded, self.text = {}, [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1
        self.loaded += [value for key, value in attrs if key in ("src", "href")]

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("sensor") / "cameras"
    words = "--set", "pixel.refractory.period_us=900", "-o", made, "--white-lux", "800"
    done = run("ideal", "gen4", *words)
    assert done.exit_code == 0
    return made, done.stdout


def test_a_folder_holds_the_page_and_its_numbers(folder):
    made, told = folder
    assert sorted(path.name for path in made.iterdir()) == ["sensor.html", "sensor.json"]
    found = json.loads((made / "sensor.json").read_text("utf-8"))
    names = [one["name"] for one in found["sensors"]]
    assert names == [f"{name}, pixel.refractory.period_us=900" for name in ("ideal", "gen4")]
    page = Page((made / "sensor.html").read_text("utf-8"))
    text = " ".join(page.text)
    for one in found["sensors"]:
        assert one["config"]["pixel"]["refractory"]["period_us"] == 900
        assert one["name"] in told
        for plot in one["plots"]:
            assert plot["definition"]
            assert plot["definition"] in text
        for number in one["numbers"]:
            assert f" at {number['at']}" in text
    assert page.loaded == []
    # every curve is drawn once, for both, with a line of its legend each
    assert page.count["figure"] == len({p["key"] for one in found["sensors"] for p in one["plots"]})
    assert page.count["path"] > 20


def test_declared_keys_stand_beside_what_was_measured(folder):
    text = (folder[0] / "sensor.html").read_text("utf-8")
    row = next(part for part in text.split("<tr>") if "pixel.refractory.period_us<" in part)
    assert "900 us" in row
    assert "least time between events of a pixel" in row
    assert "adv2e effects refractory" in row
    assert ">pixel.leak" not in text  # both have none


def test_a_second_call_overwrites_nothing_unless_told(tmp_path):
    page, words = tmp_path / "a.html", ("ideal", "-q", "-o")
    assert run(*words, page).exit_code == 0
    first = page.read_bytes()
    done = run(*words, page)
    assert done.exit_code == 1
    assert "exists" in done.stderr
    assert "--overwrite" in done.stderr
    again = run(*words, page, "--overwrite")
    assert (again.exit_code, again.output) == (0, "")
    assert page.read_bytes() == first
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


def test_json_alone_is_on_stdout():
    done = run("ideal", "--json", "--contrast", "0.5")
    found = json.loads(done.stdout)
    assert found["options"]["contrast"] == 0.5
    assert found["sensors"][0]["name"] == "ideal"


def test_without_a_name_the_configuration_is_that_of_the_options(tmp_path):
    (tmp_path / "mine.yaml").write_text("pixel: {thresholds: {'on': 0.4, mismatch: 0}}\n")
    done = run("-c", tmp_path / "mine.yaml")
    assert done.stdout.splitlines()[0] == "mine.yaml"
    assert "0.40" in done.stdout.splitlines()[1]


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["davis34"], 1, "davis346"),
        (["ideal", "-o", "page.pdf"], 2, "must end in .html, or name a folder"),
        (["ideal", "--set", "pixel.leek=1"], 2, "did you mean 'leak'"),
        (["ideal", "--contrast", "0"], 2, "--contrast"),
        (["ideal", "--white-lux", "dim"], 2, "--white-lux"),
        (["ideal", "--seed", "1", "--set", "seed=2"], 2, "--seed both say it"),
        (["no.yaml", "-o", "x.html"], 1, "no.yaml"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(words, status, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*words)
    assert done.exit_code == status
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_configuration_is_not_written_over(tmp_path):
    path = tmp_path / "mine.html"
    path.write_text("pixel: {leak: null}\n")
    done = run("-c", path, "-o", path, "--overwrite")
    assert done.exit_code == 1
    assert path.read_text() == "pixel: {leak: null}\n"
    done = run(path, "-o", path, "--overwrite")
    assert done.exit_code == 1
    assert path.read_text() == "pixel: {leak: null}\n"
