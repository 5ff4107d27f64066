"""The documents, and what stands in them: blocks, commands, links and headings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

GENERATED = ROOT / "docs" / "effects.md"
"""What ``adv2e effects --all`` prints."""

LANGUAGES = {"bash", "python", "yaml", "text", "csv", "bibtex"}
"""What a block may hold.  A text is what the commands before it print."""

_FENCE = re.compile(r"^ *```(.*)$")
_NEEDS = re.compile(r"\s# (needs .*)$")
_COMMENT = re.compile(r"(^|\s+)# .*$")
_INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
_COMMAND = re.compile(
    r"adv2e [a-z]+ \S|(python )?scripts/[\w/]+\.py \S|pip install |\./scripts/|git clone "
)


@dataclass(frozen=True)
class Command:
    """A command that a document shows.

    Attributes
    ----------
    document : str
        Path within the repository.
    line : int
    text : str
        Without comments.
    needs : str
        What it needs that a test does not have; empty where there is nothing of this kind.
    inline : bool
        Whether it stands within a sentence, to be looked at rather than to be run.
    """

    document: str
    line: int
    text: str
    needs: str = ""
    inline: bool = False

    def __str__(self) -> str:
        return f"{self.document}:{self.line}: {self.text}"


@dataclass(frozen=True)
class Block:
    """What stands between two fences."""

    document: str
    line: int
    language: str
    text: str

    @property
    def file(self) -> str:
        """Return the file that its first line names as ``# name.suffix: ...``, or nothing."""
        found = re.match(r"# ([\w-]+\.(?:py|yaml))\b", self.text)
        return found[1] if found else ""

    @property
    def needs(self) -> str:
        """Return what its first line says that it needs."""
        found = re.match(r"# (needs .*)", self.text)
        return found[1] if found else ""

    def commands(self) -> list[Command]:
        """Return the commands of a block of ``bash``, each with all of its lines."""
        commands, lines, start = [], [], 0
        for number, line in enumerate(self.text.splitlines(), self.line + 1):
            needs = _NEEDS.search(line)
            start = start or number
            lines.append(_COMMENT.sub("", line.removesuffix("\\")).rstrip())
            if line.endswith("\\") or _is_open(lines):
                continue
            text = "\n".join(lines) if _is_loop(lines) else " ".join(map(str.strip, lines))
            if text.strip():
                commands.append(Command(self.document, start, text, needs[1] if needs else ""))
            lines, start = [], 0
        assert not lines, f"{self.document}:{start}: a command without an end"
        return commands


def _is_loop(lines: list[str]) -> bool:
    return bool(re.match(r"(for|while|if)\b", next(filter(None, lines), "")))


def _is_open(lines: list[str]) -> bool:
    return _is_loop(lines) and not re.search(r"\b(done|fi)$", lines[-1])


@dataclass(frozen=True)
class Document:
    """One file of documentation."""

    path: Path
    blocks: list[Block] = field(default_factory=list)
    prose: list[tuple[int, str]] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> Document:
        """Return the document with its blocks; `prose` is every other line with its number."""
        document = cls(path)
        language, start, lines = None, 0, []
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            fence = _FENCE.match(line)
            if fence and language is None:
                language, start, lines = fence[1].strip(), number, []
            elif fence:
                text = "".join(f"{one}\n" for one in lines)
                document.blocks.append(Block(document.name, start, language, text))
                language = None
            elif language is None:
                document.prose.append((number, line))
            else:
                lines.append(line)
        assert language is None, f"{document.name}:{start}: a block without an end"
        return document

    @property
    def name(self) -> str:
        """Return its path within the repository."""
        return self.path.relative_to(ROOT).as_posix()

    def commands(self) -> Iterator[Command]:
        """Yield all commands, those of blocks and then those within sentences."""
        for block in self.blocks:
            if block.language == "bash":
                yield from block.commands()
        for number, line in self.prose:
            for text in _INLINE.findall(line):
                if _COMMAND.match(text):
                    yield Command(self.name, number, text, inline=True)

    def links(self) -> list[str]:
        """Return where its links and pictures lead."""
        return re.findall(r"\]\(([^)\s]+)\)", "\n".join(line for _, line in self.prose))

    def anchors(self) -> set[str]:
        """Return what links may name after a ``#``."""
        found = (re.match(r"#+ (.*)$", line) for _, line in self.prose)
        headings = (one[1].lower() for one in found if one)
        return {re.sub(r"[^\w -]", "", one).replace(" ", "-") for one in headings}

    def words(self) -> int:
        """Return how many words it has."""
        return len(self.path.read_text("utf-8").split())


def documents() -> list[Document]:
    """Return all documents that people write, the README first."""
    forms = (("adv2e", "README.md"), ("scripts", "README.md"), ("docs", "*.md"))
    below = [path for top, form in forms for path in (ROOT / top).rglob(form)]
    paths = [ROOT / "README.md", *(path for path in below if path != GENERATED)]
    return [Document.read(path) for path in sorted(paths, key=lambda p: (len(p.parts), p))]
