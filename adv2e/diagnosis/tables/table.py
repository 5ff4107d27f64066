"""Tables of measurements: delimited text with a header that names the columns, units included.

The delimiter is a comma, a semicolon or a tab, whichever the header holds most of; a table with
semicolons or tabs may have decimal commas.  Lines that begin with ``#`` and empty lines are passed
over; cells may be quoted.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, UsageError
from adv2e.files.regular import read_text_bytes

DELIMITERS = ",;\t"

_SHOWN = 12
"""Values of a column that an error lists."""


@dataclass(frozen=True)
class Table:
    """A table as text, with the line each row stood on.

    Attributes
    ----------
    name : str
        The file, for messages.
    columns : tuple of str
    rows : tuple of tuples of str
    lines : tuple of int
        Line number of each row, from 1.
    decimal_comma : bool
        Whether numbers may be written with a comma.
    """

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    decimal_comma: bool = False

    def __len__(self) -> int:
        return len(self.rows)

    def texts(self, column: str) -> list[str]:
        """Return the cells of a column."""
        at = self.columns.index(column)
        return [row[at] for row in self.rows]

    def numbers(
        self,
        column: str,
        *,
        above: float = -math.inf,
        at_least: float = -math.inf,
        required: bool = False,
    ) -> NDArray[np.float64]:
        """Return a column as numbers, (rows,); an empty cell, or a column not there, is NaN.

        Raises
        ------
        DataError
            A cell is no finite number, or outside of the range, or empty though `required`; file,
            line and column are named.
        """
        values = np.full(len(self), np.nan)
        or_empty = "" if required else ", or empty"
        for k, text in enumerate(self.texts(column) if column in self.columns else []):
            if not text and not required:
                continue
            try:
                values[k] = self._number(text)
            except ValueError:
                raise self.wrong(k, column, "must be a number") from None
            if not math.isfinite(values[k]):
                raise self.wrong(k, column, f"must be a finite number{or_empty}")
            if not values[k] > above:
                raise self.wrong(k, column, f"must be above {above:g}")
            if not values[k] >= at_least:
                raise self.wrong(k, column, f"must be at least {at_least:g}")
        return values

    def _number(self, text: str) -> float:
        return float(text.replace(",", ".") if self.decimal_comma else text)

    def wrong(self, row: int, column: str, text: str) -> DataError:
        """Return the error that says `text` of one cell."""
        cell = self.texts(column)[row]
        found = f"{text}, got {cell!r}" if cell else f"is empty, {text}"
        return DataError(f"{self.name}:{self.lines[row]}: {column}: {found}")

    def kept(self, keep: Sequence[bool]) -> Table:
        """Return the table of the rows where `keep` is true."""
        rows = tuple(row for row, use in zip(self.rows, keep, strict=True) if use)
        lines = tuple(line for line, use in zip(self.lines, keep, strict=True) if use)
        return Table(self.name, self.columns, rows, lines, self.decimal_comma)

    def matching(self, condition: str, option: str) -> list[bool]:
        """Return a mask of the rows that match ``COLUMN=VALUE``, (rows,).

        Values that are numbers are compared as numbers.

        Raises
        ------
        DataError
            There is no such column, or no such row; the text names what there is.
        UsageError
            `condition` has no such form.
        """
        column, equals, value = (part.strip() for part in condition.partition("="))
        if not equals or not column:
            raise UsageError(f"{option} {condition}: must be COLUMN=VALUE, such as camera=CAM2")
        if column not in self.columns:
            there = ", ".join(self.columns)
            raise DataError(f"{self.name}: has no column {column!r} for {option} (there: {there})")
        found = [self._same(text, value) for text in self.texts(column)]
        if not any(found):
            values = sorted(set(self.texts(column)))
            there = ", ".join([*values[:_SHOWN], *["..."] * (len(values) > _SHOWN)])
            raise DataError(
                f"{self.name}: {option}: no row has {column} = {value} (there: {there})"
            )
        return found

    def _same(self, text: str, value: str) -> bool:
        try:
            return self._number(text) == self._number(value)
        except ValueError:
            return text == value


def read_table(path: str | Path) -> Table:
    """Return the table in the file `path`.

    Raises
    ------
    DataError
        The file cannot be read, has no header or no rows, a name stands twice in the header, or a
        row has another number of cells; file and line are named.
    """
    path = Path(path)
    try:
        text = read_text_bytes(path).decode("utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: byte {error.start} is not UTF-8 text") from None
    return parse_table(text, str(path))


def parse_table(text: str, name: str) -> Table:
    """Return the table in `text`; `name` stands for the file in messages (see `read_table`)."""
    numbered = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip(f" {DELIMITERS}") and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise DataError(f"{name}: is empty, must hold a header line and rows below it")
    header_line, header_text = numbered[0]
    delimiter = max(DELIMITERS, key=header_text.count)
    header = _cells(header_text, delimiter)
    if len(header) == 1 and len(header_text.split()) > 1 and '"' not in header_text:
        raise DataError(
            f"{name}:{header_line}: the header has no comma, semicolon or tab between its columns"
        )
    for column in header:
        if not column:
            raise DataError(f"{name}:{header_line}: the header has a column without a name")
        if header.count(column) > 1:
            raise DataError(f"{name}:{header_line}: the header has {column!r} twice")
    if len(numbered) == 1:
        raise DataError(f"{name}:{header_line}: there are no rows below the header")
    rows = []
    for number, line in numbered[1:]:
        cells = _cells(line, delimiter)
        if len(cells) != len(header):
            raise DataError(
                f"{name}:{number}: has {len(cells)} cells, must have {len(header)} as the header"
            )
        rows.append(cells)
    lines = tuple(number for number, _ in numbered[1:])
    return Table(name, header, tuple(rows), lines, delimiter != ",")


def _cells(line: str, delimiter: str) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter)))
