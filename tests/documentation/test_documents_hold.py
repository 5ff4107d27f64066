"""Links lead somewhere, blocks say what they hold, what is named exists, and none is too long."""

from __future__ import annotations

import re

import pytest

from adv2e.cli import COMMANDS
from documentation.documents import LANGUAGES, ROOT, Document, documents
from documentation.where import ELSEWHERE, elsewhere, table

DOCUMENTS = {document.name: document for document in documents()}
each = pytest.mark.parametrize("name", DOCUMENTS)

MOST_WORDS = 2500
MOST_LINES = {"README.md": 250}


@each
def test_links_lead_to_files_and_headings(name):
    for link in DOCUMENTS[name].links():
        if re.match(r"https?:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (DOCUMENTS[name].path.parent / path).resolve() if path else DOCUMENTS[name].path
        assert target.exists(), link
        if anchor:
            assert anchor in Document.read(target).anchors(), link


@each
def test_files_that_are_named_exist(name):
    text = DOCUMENTS[name].path.read_text("utf-8")
    # a script that made a table and is gone stands with the commit that has it
    text = re.sub(r"`scripts/[\w/]+\.py`\s+at\s+commit\s+[0-9a-f]{7,}", "", text)
    paths = re.findall(r"(?<![\w/.])((?:scripts|tests|configs|adv2e)/[\w/.]*\w)", text)
    for path in paths:
        assert (ROOT / path).exists(), path


@each
def test_a_block_says_what_it_holds(name):
    for block in DOCUMENTS[name].blocks:
        assert block.language in LANGUAGES, f"{name}:{block.line}"


@each
def test_every_command_stands_where_it_is_checked(name):
    document = DOCUMENTS[name]
    names = "|".join(COMMANDS)
    looks_like_one = re.compile(
        rf"\s*(\$ )?(adv2e ({names})\b|pip install |\./scripts/|git clone )"
    )
    texts = [block.text for block in document.blocks if block.language == "text"]
    lines = [line for _, line in document.prose] + "".join(texts).splitlines()
    assert not [line for line in lines if looks_like_one.match(line)]
    # nor may one go on in the next line, where it would be missed
    assert not [line for _, line in document.prose if line.count("`") % 2]


@each
def test_commands_that_are_named_exist(name):
    text = DOCUMENTS[name].path.read_text("utf-8")
    assert {*re.findall(r"`adv2e (\w+)`", text)} <= {*COMMANDS}


@each
def test_a_document_is_not_too_long(name):
    document = DOCUMENTS[name]
    assert document.words() <= MOST_WORDS
    lines = document.path.read_text("utf-8").splitlines()
    assert len(lines) <= MOST_LINES.get(name, len(lines))


def test_extras_that_are_installed_exist():
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    section = project.partition("[project.optional-dependencies]\n")[2].partition("\n[")[0]
    known = {*re.findall(r"^(\w+) = ", section, flags=re.MULTILINE)}
    asked = set()
    for document in DOCUMENTS.values():
        text = document.path.read_text("utf-8")
        for extras in re.findall(r"pip install [^\n`]*\[([\w,]+)\]", text):
            asked |= {*extras.split(",")}
    assert asked <= known


def test_each_command_is_listed_once_with_where_it_is_run():
    lines = table().splitlines()[1:]
    assert len(lines) == sum(len([*one.commands()]) for one in DOCUMENTS.values())
    assert all(re.match(r"\S+\.md:\d+ \| .+ \| (tests|scripts)/", one) for one in lines)


@pytest.mark.parametrize("path", sorted({*ELSEWHERE.values()}))
def test_what_runs_a_command_elsewhere_exists(path):
    assert (ROOT / path).is_file()


def test_no_command_of_ours_is_left_to_others():
    for document in DOCUMENTS.values():
        for command in document.commands():
            if command.text.startswith(("adv2e ", "python scripts/")):
                assert elsewhere(command) is None, str(command)
