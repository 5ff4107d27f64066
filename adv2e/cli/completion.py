"""Shell completion: file names, and names that this program knows.

Click completes options and their choices by itself.  Functions here import as little as they can:
somebody waits.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable

import click
from click.shell_completion import CompletionItem

Offer = list[CompletionItem]


def starting(names: Iterable[str], incomplete: str) -> Offer:
    """Return completions: the names that begin with the typed text `incomplete`."""
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]


def files(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Let the shell offer files and folders."""
    return [CompletionItem(incomplete, type="file")]


def configurations(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the shipped configurations; where none begins so, files."""
    from adv2e.config.files import shipped

    return starting(shipped(), incomplete) or files(ctx, param, incomplete)


def keys(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the keys of a configuration."""
    from adv2e.config import all_keys

    return starting((f"{key.path}=" for key in all_keys() if not key.is_section), incomplete)


def _offering(module: str, function: str) -> Callable[..., Offer]:
    """Return a completion that offers the names which a function of a module returns."""

    def offer(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
        return starting(getattr(importlib.import_module(module), function)(), incomplete)

    return offer


effects = _offering("adv2e.effects", "named")
"""Offers the effects that have a page, by all of their names."""

library = _offering("adv2e.diagnosis.fitting.library", "names")
"""Offers the effects that a diagnosis looks for."""

formats = _offering("adv2e.formats.registry", "names")
"""Offers the formats that can be written."""

layouts = _offering("adv2e.formats.registry", "layouts")
"""Offers the layouts of HDF5 files."""
