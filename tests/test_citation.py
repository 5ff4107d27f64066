"""The file for citations holds what its format asks for, and agrees with the package."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import yaml

import adv2e

ROOT = Path(__file__).resolve().parents[1]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))

OF_SOFTWARE = {
    *("cff-version", "message", "title", "abstract", "type", "authors", "version", "license"),
    *("keywords", "preferred-citation", "date-released", "doi", "url", "repository-code"),
}
"""Keys of version 1.2.0 that a file of software has use for."""


def test_it_has_what_the_format_asks_for():
    assert CITATION["cff-version"] == "1.2.0"
    assert {"cff-version", "message", "title", "authors"} <= set(CITATION) <= OF_SOFTWARE
    assert CITATION["type"] == "software"
    for one in (CITATION, CITATION["preferred-citation"]):
        assert one["title"]
        for author in one["authors"]:
            assert set(author) in ({"name"}, {"family-names", "given-names"})
            assert all(isinstance(value, str) for value in author.values())


def test_it_agrees_with_the_package_and_the_readme():
    assert str(CITATION["version"]) == adv2e.__version__
    assert CITATION["license"] == "MIT"
    paper = CITATION["preferred-citation"]
    text = " ".join((ROOT / "README.md").read_text("utf-8").replace("{ADV2E}", "ADV2E").split())
    assert [author["family-names"] for author in paper["authors"]] == ["Jiang", "Zhou", "Lin"]
    assert paper["title"] in text.replace("{", "").replace("}", "")
    assert f"eprint={{{paper['url'].rsplit('/')[-1]}}}" in text
    assert 2024 == paper["year"] <= date.today().year
