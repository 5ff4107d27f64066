"""Pages of the effects, from their modules: what `adv2e effects` prints, and pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import MISSING
from pathlib import Path

from adv2e.config import Key, all_keys
from adv2e.config.yaml12 import scalar_text
from adv2e.effects import EFFECTS, STAGES, Effect, label_of, separated_by
from website.equations import EquationError, latex
from website.pictures import SHOWN, make_picture

_PAIR = re.compile(r"(\S[^.]{0,24}?) {2,}(\S.*)$")
_TEXT_AT = 8
"""The least column where the text of a list of names begins."""


def write_pages(folder: Path, pictures: Path) -> list[str]:
    """Write a page for each effect and one that lists them; return the names of all."""
    for effect in EFFECTS:
        make_picture(effect.name, pictures / f"{effect.name}.png")
        (folder / f"{effect.name}.md").write_text(_page(effect), "utf-8")
    (folder / "index.md").write_text(_list(), "utf-8")
    return ["index", *(effect.name for effect in EFFECTS)]


def _list() -> str:
    lines = [
        "# All effects\n",
        "In the order in which the signal goes through them. `adv2e effects` prints this list, and"
        " `adv2e effects leak` what stands on the page of leak. [What made an"
        " event](../own_effects.md#causes-of-events), and [effects of your own](../own_effects.md),"
        " have a page.\n",
    ]
    for stage, meaning in STAGES.items():
        lines.append(f"\n## {stage.capitalize()}: {meaning}\n\n| effect | what it is |\n|---|---|")
        lines += [
            f"| [{effect.name}]({effect.name}.md) | {_cell(escaped(effect.summary()))} |"
            for effect in EFFECTS
            if effect.stage == stage
        ]
    pages = "\n".join(effect.name for effect in EFFECTS)
    return "\n".join([*lines, f"\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"])


def _page(effect: Effect) -> str:
    text, _, references = effect.text().partition("\nReferences\n")
    title, _, body = text.partition("\n")
    shown = SHOWN[effect.name]
    lines = [
        f"# {effect.name}\n",
        f"{escaped(title)}\n",
        f"![Events without and with {effect.name}](../_pictures/{effect.name}.png)\n",
        f"*{escaped(shown.caption)} ON is red, OFF is blue; the grey line is the light.*\n"
        if shown.drawn == "times"
        else f"*{escaped(shown.caption)}*\n",
        "\n".join(markdown(body)),
        "\n## Parameters\n",
        *_parameters(effect),
        "\n## In a diagnosis\n",
        *_in_a_diagnosis(effect),
        "\n## Code\n",
        *_code(effect),
    ]
    found = "\n".join(_references(references.partition("\n")[2]))
    if found:
        lines += ["\n## References\n", found]
    return "\n".join(lines) + "\n"


def _parameters(effect: Effect) -> Iterator[str]:
    keys = [key for key in all_keys() if f"{key.path}.".startswith(_below(effect))]
    yield "| key | unit | default | range | meaning |\n|---|---|---|---|---|"
    yield from map(row, (key for key in keys if not key.is_section))
    for key in (key for key in keys if key.is_section and key.optional):
        state = "off" if key.default is None else "on"
        yield f"\nBy default the effect is {state}; `{key.path}: null` switches it off."


def _below(effect: Effect) -> tuple[str, ...]:
    return tuple(f"{path}." for path in effect.paths)


def row(key: Key) -> str:
    """Return a key of the configuration as a row of a table."""
    about = key.about
    default = "none" if key.default is MISSING else f"`{scalar_text(key.default)}`"
    limits = {"above": about.above, "at least": about.at_least, "at most": about.at_most}
    span = [f"{word} {limit:g}" for word, limit in limits.items() if limit is not None]
    if about.choices is not None:
        span = [f"`{choice}`" for choice in about.choices]
    meaning = about.meaning + f" (source: {about.source})" * bool(about.source)
    unit = about.unit if about.unit != "-" else ""
    cells = (f"`{key.path}`", unit, default, ", ".join(span), escaped(meaning))
    return f"| {' | '.join(map(_cell, cells))} |"


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def _in_a_diagnosis(effect: Effect) -> Iterator[str]:
    for name in (effect.name, *effect.told_as):
        how = separated_by(name)
        told = f", told apart by {how}" if how else ""
        yield f"- `{name}`: {escaped(label_of(name) + told)}"


def _code(effect: Effect) -> Iterator[str]:
    path = effect.module.__name__.replace(".", "/")
    yield f"- `{path}.py`\n- `tests/effects/test_{path.split('/')[-1]}.py`"


def _references(text: str) -> Iterator[str]:
    for one in re.split(r"\n(?=\[\d+\] )", text.strip("-\n ")):
        number = re.match(r"\[(\d+)\] ", one)
        line = " ".join(one.split())
        yield f"{number[1]}. {_linked(escaped(line[number.end() :]))}" if number else escaped(line)


def _linked(text: str) -> str:
    text = re.sub(r"\bdoi:(10\.\d+/[^\s,;)]*[^\s,;.)])", r"[doi:\1](https://doi.org/\1)", text)
    text = re.sub(r"(?<!\()\bhttps?://[^\s,)]+", r"<\g<0>>", text)
    return re.sub(r"\barXiv:(\d+\.\d+)", r"[arXiv:\1](https://arxiv.org/abs/\1)", text)


def escaped(text: str) -> str:
    """Return plain text so that Markdown leaves it as it is; what is between backticks is code."""
    parts = re.split(r"(``?[^`]+``?)", text)
    return "".join(
        one if one.startswith("`") else re.sub(r"([\\*<>\[\]#~])", r"\\\1", one) for one in parts
    )


def markdown(body: str) -> Iterator[str]:
    """Yield a docstring as Markdown: equations, lists of names, and prose."""
    for paragraph in re.split(r"\n\s*\n", body.strip("\n")):
        lines = paragraph.splitlines()
        if all(line.startswith("    ") for line in lines):
            yield from _equations(lines)
        elif all(map(_starts_a_pair, lines)) and any(_PAIR.match(line) for line in lines):
            yield from _names(lines)
        else:
            yield f"{escaped(chr(10).join(lines))}\n"


def _starts_a_pair(line: str) -> bool:
    """Tell whether a line belongs to a list of names and what they mean."""
    pair = _PAIR.match(line)
    return line.startswith(" " * _TEXT_AT) or bool(pair and pair.start(2) >= _TEXT_AT)


def _equations(lines: list[str]) -> Iterator[str]:
    try:
        rows = [latex(line) for line in lines]
    except EquationError:
        yield "\n".join(["```text", *(line[4:] for line in lines), "```\n"])
        return
    yield from (f"```{{math}}\n{one}\n```\n" for one in rows)


def _names(lines: list[str]) -> Iterator[str]:
    pairs: list[list[str]] = []
    for line in lines:
        pair = _PAIR.match(line)
        if pair and not line.startswith(" "):
            pairs.append([pair[1], pair[2]])
        else:
            pairs[-1][1] += f" {line.strip()}" if "    " not in line.strip() else f"\n{line}"
    if any(re.search(r"\S {4,}\S", text) for _, text in pairs):  # columns, as of formulas
        yield "\n".join(["```text", *lines, "```\n"])
        return
    yield "| | |\n|---|---|"
    for name, text in pairs:
        yield f"| {_symbols(name)} | {_cell(escaped(text))} |"
    yield ""


def _symbols(names: str) -> str:
    """Return names as they stand in equations; keys and words as they are."""
    if re.fullmatch(r"[\w']{1,3}(_\w+)?(, [\w']{1,3}(_\w+)?)*|DN\w*'?|[a-z]{2,7}", names):
        symbols = names.split(", ")
        if all(len(s) < 4 or "_" in s or s in ("sigma", "epsilon", "lambda") for s in symbols):
            return ", ".join(f"{{math}}`{latex(one)}`" for one in symbols)
    return escaped(names)
