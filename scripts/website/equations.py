r"""Equations of docstrings, in ASCII, as LaTeX: ``dr/dt = -(R0 + R1 DN/255) C_on xi``.

A blank multiplies, a slash divides what stands next to it, and what stands behind an underscore is
an index.  Words of English remain words.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

GREEK = {"phi", "rho", "xi", "sigma", "tau", "lambda", "epsilon", "theta", "pi"}
FUNCTIONS = {"ln", "exp", "max", "min", "sin", "log"}
WORDS = {
    *("for", "where", "and", "normal", "with", "mean", "variance", "from", "to", "so", "that"),
    *("is", "uniform", "between", "over", "frames", "there", "on"),
}
SIGNS = {"<=": r"\le ", ">=": r"\ge ", "<-": r"\leftarrow ", "*": r"\cdot ", ",": r",\;"}

_TOKEN = re.compile(
    r"\s*(integral of|sum over frames of|[A-Za-z]+\d*'?|\d+(?:\.\d+)?|<=|>=|<-|[-+*/^_=<>(),|'])"
)


class EquationError(ValueError):
    """What is no equation."""


def latex(text: str) -> str:
    """Return a line as LaTeX; raise EquationError for what is not understood."""
    parts = re.split(r",?\s{4,}", text.strip())
    return r" \qquad ".join(_expression(_Tokens(part), ends="") for part in parts)


class _Tokens:
    """The tokens of a line, and where one is."""

    def __init__(self, text: str) -> None:
        self._tokens, at = [], 0
        while at < len(text.rstrip()):
            found = _TOKEN.match(text, at)
            if not found:
                raise EquationError(text[at:])
            self._tokens.append((found[1], text[found.end() : found.end() + 1]))
            at = found.end()
        self._at = 0

    @property
    def next(self) -> str:
        return self._tokens[self._at][0] if self._at < len(self._tokens) else ""

    def take(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1][0]

    @property
    def touches(self) -> bool:
        """Tell whether no blank stands behind the token last taken."""
        return not self._tokens[self._at - 1][1].isspace()


def _expression(tokens: _Tokens, ends: str) -> str:
    return " ".join(_factors(tokens, ends))


def _factors(tokens: _Tokens, ends: str) -> Iterator[str]:
    before = ""
    while tokens.next and tokens.next != ends:
        if tokens.next == "/":
            tokens.take()
            below = _factor(tokens)
            before = rf"\frac{{{_bare(before)}}}{{{_bare(below)}}}"
            continue
        if before:
            yield before
        before = _factor(tokens)
    yield before


def _bare(text: str) -> str:
    """Return what stands within a pair of parentheses that a fraction makes needless."""
    found = re.fullmatch(r"\\left\((.*)\\right\)", text)
    depth = 0
    for word in re.findall(r"\\left|\\right", found[1] if found else ""):
        depth += 1 if word == r"\left" else -1
        if depth < 0:
            return text
    return found[1] if found and depth == 0 else text


def _factor(tokens: _Tokens) -> str:
    if not tokens.next:
        raise EquationError("something is missing at the end")
    is_name = tokens.next[0].isalpha() and tokens.next not in WORDS
    text = _atom(tokens)
    while tokens.next in ("^", "_"):
        sign = tokens.take()
        text += f"{sign}{{{_index(tokens) if sign == '_' else _bare(_atom(tokens))}}}"
    called = is_name and tokens.next == "(" and tokens.touches
    return text + (_atom(tokens) if called else "")


def _index(tokens: _Tokens) -> str:
    if tokens.next == "(":
        return _bare(_atom(tokens))
    name = tokens.take()
    return rf"\mathrm{{{name}}}" if len(name) > 1 else name


def _atom(tokens: _Tokens) -> str:
    token = tokens.take()
    if token == "(":
        inside = _expression(tokens, ")")
        if tokens.next != ")":
            raise EquationError("a parenthesis without an end")
        tokens.take()
        return rf"\left({inside}\right)"
    if token == "integral of":
        return r"\int "
    if token == "sum over frames of":
        return r"\sum_{\text{frames}} "
    if token in SIGNS:
        return SIGNS[token]
    if not token[0].isalpha():
        return token
    return _name(token, tokens)


def _name(token: str, tokens: _Tokens) -> str:
    name, prime = token.rstrip("'"), "'" * token.endswith("'")
    if name in WORDS:
        return rf"\;\text{{{name}}}\;"
    if name == "sqrt" and tokens.next == "(":
        return rf"\sqrt{{{_bare(_atom(tokens))}}}"
    if name == "ceil" and tokens.next == "(":
        return rf"\lceil {_bare(_atom(tokens))} \rceil "
    if name in FUNCTIONS:
        called = _atom(tokens) if tokens.next == "(" else ""
        return rf"\{name}{called}"
    letters, digits = re.fullmatch(r"([A-Za-z]+)(\d*)", name).groups()  # type: ignore[union-attr]
    index = f"_{{{digits}}}" if digits else ""
    is_difference = len(letters) == 2 and letters[0] == "d"
    if letters == "eps":
        letters = r"\epsilon"
    elif letters in GREEK:
        letters = rf"\{letters}"
    elif is_difference:
        letters = f"d{letters[1]}"
    elif len(letters) > 1:
        letters = rf"\mathrm{{{letters}}}"
    return f"{letters}{index}{prime}"
