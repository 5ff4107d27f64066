#!/usr/bin/env python
"""Build the site of the documentation; `scripts/docs` calls this.

What people write lies in `docs/`, and in a README beside the code.  These pages are copied, and
their links, which lead from file to file of the repository, are made to lead from page to page.
Pages of the effects, commands, keys and functions come from the program.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from writing import one_line_errors  # noqa: E402

from website import effects, reference  # noqa: E402

FIRST = Path("docs/README.md")
"""Lists the pages under headings, which become the menu of the site."""

CODE = "For developers"
"""The part of the menu with what stands beside the code."""

DOCUMENTS = ("docs", "adv2e", "scripts")
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s#]+)(#[^)\s]*)?(\))")


def pages() -> dict[Path, str]:
    """Return the documents that become pages, each with the name of its page."""
    found = {}
    for folder in DOCUMENTS:
        for path in sorted((*(ROOT / folder).rglob("*.md"), *(ROOT / folder).rglob("*.ipynb"))):
            place = path.relative_to(ROOT)
            if folder == "docs":
                found[place] = place.relative_to("docs").with_suffix("").as_posix()
            else:
                found[place] = f"code/{'_'.join(place.parts[:-1])}"
    found[FIRST] = "index"
    found[Path("CHANGELOG.md")] = "code/changelog"
    found[Path("docs/effects.md")] = "effects/index"
    return found


def stage(source: Path) -> None:
    """Copy all pages to `source`, with links as the site has them."""
    known = pages()
    for place, page in known.items():
        if page == "effects/index":  # made from the program
            continue
        target = source / f"{page}.md"
        target.parent.mkdir(parents=True, exist_ok=True)
        text = as_markdown((ROOT / place).read_text("utf-8"), place.suffix)
        text = "".join(_part(part, place, page, known, source) for part in _parts(text))
        if place.suffix == ".ipynb":
            text += f"\n\n[Download this notebook]({_copied(place, page, source)})\n"
        target.write_text(text, "utf-8")
    with (source / "index.md").open("a", encoding="utf-8") as index:
        index.write("\n".join(_menu(known)))


def as_markdown(text: str, suffix: str) -> str:
    """Return a document as Markdown; of a notebook, its cells."""
    if suffix != ".ipynb":
        return text
    cells = json.loads(text)["cells"]
    texts = ("".join(cell["source"]) for cell in cells)
    kinds = (cell["cell_type"] for cell in cells)
    pairs = zip(texts, kinds, strict=True)
    return "\n\n".join(f"```python\n{t}\n```" if kind == "code" else t for t, kind in pairs)


def _parts(text: str) -> Iterator[str]:
    """Yield what is between fences and what is not, in turn; the first is not."""
    yield from re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)


def _part(text: str, place: Path, page: str, known: dict[Path, str], source: Path) -> str:
    if text.startswith("```"):
        return re.sub("^```csv", "```text", text)

    def moved(found: re.Match[str]) -> str:
        begin, link, anchor, end = found.groups()
        if re.match(r"[a-z]+:", link):
            return found[0]
        target = Path(os.path.normpath(place.parent / link))
        if target == Path("docs/effects.md") and anchor:  # a heading there is a page here
            return f"{begin}{_between(page, f'effects/{anchor[1:]}')}.md{end}"
        if target in known:
            return f"{begin}{_between(page, known[target])}.md{anchor or ''}{end}"
        if not (ROOT / target).is_file():  # a folder
            return begin.lstrip("!").removeprefix("[").removesuffix("](")
        return f"{begin}{_copied(target, page, source)}{end}"

    return _LINK.sub(moved, text)


def _copied(file: Path, page: str, source: Path) -> str:
    """Copy a file of the repository beside the pages; return where it is, seen from a page."""
    copy = source / "_files" / file
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROOT / file, copy)
    return _between(page, f"_files/{file.as_posix()}")


def _between(page: str, other: str) -> str:
    return os.path.relpath(other, Path(page).parent)


def _menu(known: dict[Path, str]) -> Iterator[str]:
    """Yield the menu: the links below each heading of the first page, and what is made."""
    text, listed = (ROOT / FIRST).read_text("utf-8"), set()
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        links = (link for _, link, _, _ in _LINK.findall(body) if not re.match("[a-z]+:", link))
        chosen = [known[Path(os.path.normpath(FIRST.parent / link))] for link in links]
        if title == "Reference":
            chosen += [f"reference/{name}" for name in ("commands", "configuration", "python")]
        if title == CODE:
            chosen += [page for page in known.values() if page.startswith("code/")]
        listed.update(chosen)
        yield from _tree(title, chosen)
    others = [page for page in known.values() if page not in listed and page != "index"]
    yield from _tree("More", others) if others else ()


def _tree(title: str, chosen: Iterable[str]) -> Iterator[str]:
    yield "\n```{toctree}\n:hidden:\n:caption: " + title + "\n"
    yield from dict.fromkeys(chosen)
    yield "```\n"


@click.command()
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), default=ROOT / "build" / "docs",
    help="Folder of the site, its sources and its pictures.  [default: build/docs]",
)  # fmt: skip
@one_line_errors()
def main(output: Path) -> None:
    """Build the site of the documentation; a warning is an error."""
    if find_spec("myst_parser") is None:
        raise click.ClickException("needs Python 3.11 or later, and: pip install -e '.[docs]'")
    mark = output / ".site-of-adv2e"
    if output.is_dir() and any(output.iterdir()) and not mark.exists():
        raise click.ClickException(f"{output}: holds other files; name a new or an empty folder")
    output.mkdir(parents=True, exist_ok=True)
    mark.touch()
    source, pictures = output / "source", output / "pictures"
    shutil.rmtree(source, ignore_errors=True)
    stage(source)
    for name, write in (("effects", effects.write_pages), ("reference", reference.write_pages)):
        (source / name).mkdir(exist_ok=True)
        write(source / name, *[pictures] * (name == "effects"))
    shutil.copytree(pictures, source / "_pictures", ignore=shutil.ignore_patterns("*.made"))
    shutil.copytree(ROOT / ".readme", source / "_pictures", dirs_exist_ok=True)
    site = output / "html"
    shutil.rmtree(site, ignore_errors=True)
    build = ["-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-c", str(ROOT / "docs"), "-E"]
    build += ["-d", str(output / "trees"), str(source), str(site)]
    if status := subprocess.run([sys.executable, *build], check=False).returncode:
        sys.exit(status)
    click.echo(f"{site / 'index.html'}: open it in a browser; it needs no network")


if __name__ == "__main__":
    main()
