"""Shell completion: file names, and names that this program knows.

Click completes options and their choices by itself.  Functions here import as little as they can:
somebody waits.
"""

from __future__ import annotations

from collections.abc import Iterable

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


def effects(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the effects that have a page, by all of their names."""
    from adv2e.effects import named

    return starting(named(), incomplete)


def library(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the effects that a diagnosis looks for."""
    from adv2e.diagnosis.fitting.library import names

    return starting(names(), incomplete)


def formats(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the formats that can be written."""
    from adv2e.formats.registry import names

    return starting(names(), incomplete)


def layouts(ctx: click.Context, param: click.Parameter, incomplete: str) -> Offer:
    """Offer the layouts of HDF5 files."""
    from adv2e.formats import registry

    return starting(registry.layouts(), incomplete)
