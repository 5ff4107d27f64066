"""What was found, written down: ``report.json``, ``model.yaml``, ``report.html``, a summary."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from adv2e.characterisation.svg import AFTER, BEFORE, MEASURED, curve_svg
from adv2e.config.yaml12 import scalar_text
from adv2e.diagnosis.result import Diagnosis, Finding
from adv2e.sinks.staging import Staging

FILES = ("report.json", "model.yaml", "report.html")


def write_report(found: Diagnosis, folder: Path, overwrite: bool) -> None:
    """Write all files into `folder`, together or not at all.

    Raises
    ------
    OutputError
        One of them exists and `overwrite` is false, or `folder` is a file.
    """
    staging, paths = _staged(folder, overwrite)
    texts = {
        "report.json": json.dumps(report_dict(found), indent=2, ensure_ascii=False) + "\n",
        "model.yaml": model_yaml(found),
        "report.html": report_html(found),
    }
    try:
        staging.prepare()
        for name, path in paths.items():
            path.write_text(texts[name], encoding="utf-8")
        staging.commit()
    except BaseException:
        staging.discard()
        raise


def check_free(folder: Path, overwrite: bool) -> None:
    """Raise OutputError, before anything is computed, where `write_report` would."""
    _staged(folder, overwrite)


def _staged(folder: Path, overwrite: bool) -> tuple[Staging, dict[str, Path]]:
    staging = Staging(overwrite)
    return staging, {name: staging.file(folder / name) for name in FILES}


def report_dict(found: Diagnosis) -> dict[str, Any]:
    """Return the report as plain values for JSON."""
    first = found.errors[0]
    return {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "table": found.recording,
        "declared": found.declared,
        "effects": [
            {
                "name": effect.name,
                "parameters": dict(effect.parameters),
                "interval": {key: list(ends) for key, ends in effect.interval.items()},
            }
            for effect in found.effects
        ],
        "alternatives": found.alternatives,
        "nuisances": dict(found.nuisances),
        "rejected": [
            {
                "name": item.name,
                "reason": item.reason,
                "parameters": dict(item.parameters),
                "held_out": item.held_out,
            }
            for item in found.rejected
        ],
        "error": {
            "name": first.name,
            "before": first.before.value,
            "after": first.after.value,
            "floor": first.floor.value,
            "held_out": True,
        },
        "errors": [
            {
                "name": row.name,
                "before": row.before.value,
                "after": row.after.value,
                "floor": row.floor.value,
            }
            for row in found.errors
        ],
        "global_p": {"before": found.global_p_before, "after": found.global_p_after},
        "signatures": [],
        "split": found.split,
        "notes": found.notes,
        "facts": dict(found.facts),
    }


def model_yaml(found: Diagnosis) -> str:
    """Return the model found as a configuration; what was fitted stands above it."""
    lines = [f"# {found.sentence}", f"# From {found.recording}, beside: {found.declared}."]
    lines += [f"# {effect.name}: {_parameters(effect)}" for effect in found.effects]
    lines += _yaml(found.model, 0)
    return "\n".join(lines) + "\n"


def _yaml(tree: Mapping[str, Any], depth: int) -> Iterator[str]:
    indent = "  " * depth
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield f"{indent}{key}:" if value else f"{indent}{key}: {{}}"
            yield from _yaml(value, depth + 1)
        else:
            items = value if isinstance(value, (list, tuple)) else None
            text = (
                scalar_text(value) if items is None else f"[{', '.join(map(scalar_text, items))}]"
            )
            yield f"{indent}{key}: {text}"


def summary(found: Diagnosis) -> str:
    """Return the report for a terminal."""
    first = found.errors[0]
    lines = [
        f"{found.verdict}: {found.sentence}",
        f"held out: {found.split}",
        f"error: {first.before.value:.3g} before, {first.after.value:.3g} after,"
        f" {first.floor.value:.3g} the errors of the rows ({first.name})",
        f"p of the misfit: {found.global_p_before:.3f} before, {found.global_p_after:.3f} after",
    ]
    lines += [f"effect {effect.name}: {_parameters(effect)}" for effect in found.effects]
    if found.alternatives:
        lines.append(f"alternatives: {', '.join(found.alternatives)}")
    lines += [f"fitted besides: {key} = {value:.4g}" for key, value in found.nuisances.items()]
    lines += [f"rejected {item.name}: {item.reason}" for item in found.rejected]
    lines += [f"note: {note}" for note in found.notes]
    return "\n".join(lines)


def _parameters(effect: Finding) -> str:
    texts = []
    for key, value in effect.parameters.items():
        low, high = effect.interval.get(key, (None, None))
        inside = "" if low is None else f" ({low:.4g} to {high:.4g})"
        texts.append(f"{key} = {value:.4g}{inside}")
    return ", ".join(texts)


_STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { border: 1px solid #bbb; padding: 0.25em 0.6em; text-align: left; }
svg { max-width: 100%; height: auto; }
"""


def report_html(found: Diagnosis) -> str:
    """Return one page that needs nothing besides itself."""
    legend = (
        f'<p>Points: <b style="color:{MEASURED}">measured</b>. Dashes: '
        f'<b style="color:{BEFORE}">declared model</b>. Line: '
        f'<b style="color:{AFTER}">model found</b>. Bands: 95 % of fits to drawn tables.</p>'
    )
    effects = [
        (effect.name, key, f"{value:.4g}", _ends(effect, key))
        for effect in found.effects
        for key, value in effect.parameters.items()
    ]
    errors = [
        (row.name, *(f"{e.value:.3g}" for e in (row.before, row.after, row.floor)))
        for row in found.errors
    ]
    nuisances = [(key, f"{value:.4g}") for key, value in found.nuisances.items()]
    rejected = [(item.name, item.reason) for item in found.rejected]
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(found.recording)}: {escape(found.verdict)}</title>",
        f"<style>{_STYLE}</style></head><body>",
        f"<h1>{escape(found.verdict.replace('_', ' '))}</h1><p>{escape(found.sentence)}</p>",
        f"<p>Table: {escape(found.recording)}. Declared: {escape(found.declared)}. Held out:"
        f" {escape(found.split)}.</p>",
        _table("Effects found", ("effect", "key", "value", "95 %"), effects),
        f"<p>As well: {escape(', '.join(found.alternatives))}</p>" if found.alternatives else "",
        legend,
        *(curve_svg(curve) for curve in found.curves),
        _table("Errors", ("measure", "declared", "found", "errors of the rows"), errors),
        f"<p>Probability of such a misfit: {found.global_p_before:.3f} declared,"
        f" {found.global_p_after:.3f} found.</p>",
        _table("Fitted besides", ("key", "value"), nuisances),
        _table("Not taken", ("effects", "why"), rejected),
        "<ul>" + "".join(f"<li>{escape(note)}</li>" for note in found.notes) + "</ul>",
        _table("Facts", ("what", "value"), list(found.facts.items())),
        "</body></html>\n",
    ]
    return "\n".join(part for part in parts if part)


def _ends(effect: Finding, key: str) -> str:
    ends = effect.interval.get(key)
    return "held" if ends is None else f"{ends[0]:.4g} to {ends[1]:.4g}"


def _table(title: str, head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    if not rows:
        return ""
    cells = "".join(f"<th>{escape(text)}</th>" for text in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows
    )
    return f"<h2>{escape(title)}</h2><table><tr>{cells}</tr>{body}</table>"
