"""Syntax of distributions in place of numbers; see :mod:`adv2e.config.distributions`."""

from __future__ import annotations

from adv2e.config.yaml12 import Value, scalar_text

LAWS = ("uniform", "log_uniform", "normal", "choice")
TIE = "same_as"


def is_form(value: Value) -> bool:
    """Tell whether a value looks like a distribution, rather than like a section."""
    return isinstance(value.content, dict) and bool({*LAWS, TIE} & value.content.keys())


def form_text(value: Value) -> str:
    """Return a distribution in one line of YAML."""
    if isinstance(value.content, dict):
        items = (f"{key}: {form_text(item)}" for key, item in value.content.items())
        return f"{{{', '.join(items)}}}"
    if isinstance(value.content, list):
        return f"[{', '.join(map(form_text, value.content))}]"
    return scalar_text(value.content)
