"""HTML and SVG elements as text that is escaped by construction."""

from __future__ import annotations

import html
import re

_NOT_IN_A_TEXT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")

_EMPTY = frozenset({"br", "img", "meta"})
"""Elements of HTML that have no end tag."""


class Markup(str):
    """Text that is markup already; any other text is escaped when it is put into an element."""

    __slots__ = ()


def plain(text: object) -> str:
    """Return `text` without what no text file should hold: control characters, half characters.

    File names may hold either; each becomes the replacement character.
    """
    return _NOT_IN_A_TEXT.sub("\ufffd", str(text))


def markup(content: object) -> Markup:
    """Return `content` as markup: escaped, unless it is :class:`Markup`."""
    if isinstance(content, Markup):
        return content
    return Markup(html.escape(plain(content)))


def tag(name: str, /, *content: object, **attributes: object) -> Markup:
    """Return the element `name`.

    Parameters
    ----------
    name : str
    *content : object
        Texts and elements, one after the other.
    **attributes : object
        ``class_`` is *class* and ``aria_label`` is *aria-label*; None leaves the attribute out.
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(plain(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in _EMPTY:
        return Markup(f"<{name}{given}>")
    return Markup(f"<{name}{given}>{join(*content)}</{name}>")


def join(*content: object) -> Markup:
    """Return several texts and elements as one."""
    return Markup("".join(markup(part) for part in content))
