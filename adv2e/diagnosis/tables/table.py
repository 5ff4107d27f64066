"""Tables of measurements: delimited text with a header that names the columns, units included.

The delimiter is a comma, a semicolon or a tab, whichever the header holds most of; a table with
semicolons or tabs may have decimal commas.  Lines that begin with ``#`` and empty lines are passed
over; cells may be quoted.

Columns are known by their names; all others are labels, for ``--where`` and ``--judge``.

Light (one of them): ``irradiance_W_m2``, ``illuminance_lux``, ``light_dn``.

Latency tables

=============================== ==================================================================
``latency_us``, ``_ms``, ``_s`` time from a step of the light to the first event; the light is that
                                of the brighter side of the step
``latency_error_us``            its standard error
``latency_sd_us``, ``number``   instead: spread of single latencies, and how many there were
``latency_q25_us``, ``_q75_us`` instead of the spread
``contrast_ln``                 size of the step, ln of the ratio of the two lights
``polarity``                    1, ON, 0, OFF
``bias``                        rows with another bias have thresholds of their own
=============================== ==================================================================

Noise tables

=============================== ==================================================================
``on_rate_hz``, ``off_rate_hz`` events a pixel a second, mean over the pixels
``on_median_hz``, ``off_...``   median over the pixels
``on_share``, ``off_share``     share of the pixels with at least one event
``on_share_5``, ``off_...``     with at least five; any whole number
``pixels``, ``duration_s``      how many pixels were watched, and how long
``least_hz``                    least rate that would have shown; default: 1/(pixels duration)
=============================== ==================================================================
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adv2e.errors import DataError, UsageError
from adv2e.files.regular import read_text

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
        at = self._places[column]
        return [row[at] for row in self.rows]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {column: at for at, column in enumerate(self.columns)}

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
        for k, text in enumerate(self.texts(column) if column in self._places else []):
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
        cell = self.texts(column)[row]
        found = f"{text}, got {cell!r}" if cell else f"is empty, {text}"
        return DataError(f"{self.name}:{self.lines[row]}: {column}: {found}")

    def kept(self, keep: Sequence[bool]) -> Table:
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
    return parse_table(read_text(Path(path)), str(Path(path)))


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
    for column, number in Counter(header).items():
        if not column:
            raise DataError(f"{name}:{header_line}: the header has a column without a name")
        if number > 1:
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


# ---- Measurements of a table: latencies against light, or noise event rates against light.


Array = NDArray[np.float64]

LIGHTS = {"irradiance_W_m2": "W/m²", "illuminance_lux": "lux", "light_dn": "DN"}
"""Columns that may give the light, each with its unit."""

TIMES = {"us": 1.0, "ms": 1e3, "s": 1e6}
"""Units of time, each in us."""

POLARITIES = {"1": 1, "on": 1, "+": 1, "0": 0, "off": 0, "-": 0, "-1": 0}

LEAST_LEVELS = 3

_RATE = re.compile(r"(on|off)_(rate_hz|median_hz|share|share_[1-9][0-9]*)")


@dataclass(frozen=True)
class Latencies:
    """Latencies, a row each, in the table of that name.

    Attributes
    ----------
    light : (rows,)
        In `unit`; that of the brighter side of the step.
    latency_us : (rows,)
    error : (rows,)
        Standard error relative to the latency, NaN where the table gives none.
    contrast : (rows,) or None
        Size of the step [ln].
    polarity : (rows,) of int
        1 ON, 0 OFF.
    bias : tuple of str
        Label of the biases, empty where there is no such column.
    """

    name: str
    light: Array
    unit: str
    latency_us: Array
    error: Array
    contrast: Array | None
    polarity: NDArray[np.int64]
    bias: tuple[str, ...]


@dataclass(frozen=True)
class Noise:
    """Rates of noise events, a row each, by column; NaN where the table gives none."""

    light: Array
    unit: str
    rates: dict[str, Array]
    pixels: Array
    duration_s: Array
    least_hz: Array


def measurements_of(table: Table) -> Latencies | Noise:
    """Return the latencies or noise rates of a table, by its columns.

    Raises
    ------
    DataError
        No light, neither latency nor rate, both, or a wrong cell; file, line and column are named.
    """
    there = f"(there: {', '.join(table.columns)})"
    times = [f"latency_{unit}" for unit in TIMES if f"latency_{unit}" in table.columns]
    rates = [name for name in table.columns if _RATE.fullmatch(name)]
    if bool(times) == bool(rates):
        raise DataError(
            f"{table.name}: must have either a column latency_us (or _ms, _s) or columns"
            f" on_rate_hz and off_rate_hz {there}"
        )
    if len(times) > 1:
        raise DataError(f"{table.name}: has {' and '.join(times)}, must have one of them")
    lights = [name for name in LIGHTS if name in table.columns]
    if len(lights) != 1:
        raise DataError(
            f"{table.name}: must have one of the columns {', '.join(LIGHTS)}, has"
            f" {' and '.join(lights) or 'none'} {there}"
        )
    (column,) = lights
    light = table.numbers(column, above=0.0, required=True)
    _check_levels(table, light, f"{column}: has")
    if times:
        return _latencies(table, times[0], light, LIGHTS[column])
    return _noise(table, light, LIGHTS[column])


def _check_levels(table: Table, light: Array, has: str) -> None:
    levels = np.unique(light).size
    if levels < LEAST_LEVELS:
        raise DataError(
            f"{table.name}: {has} {levels} different values of light, at least {LEAST_LEVELS} are"
            " needed to hold one out"
        )


def _latencies(table: Table, column: str, light: Array, unit: str) -> Latencies:
    factor = TIMES[column.removeprefix("latency_")]
    latency_us = factor * table.numbers(column, above=0.0, required=True)
    contrast = None
    if "contrast_ln" in table.columns:
        contrast = table.numbers("contrast_ln", above=0.0, required=True)
    polarity = np.ones(len(table), dtype=np.int64)
    if "polarity" in table.columns:
        for k, text in enumerate(table.texts("polarity")):
            if text.lower() not in POLARITIES:
                raise table.wrong(k, "polarity", "must be 1 or ON, 0 or OFF")
            polarity[k] = POLARITIES[text.lower()]
    bias = table.texts("bias") if "bias" in table.columns else [""] * len(table)
    error = _standard_error_us(table) / latency_us
    return Latencies(table.name, light, unit, latency_us, error, contrast, polarity, tuple(bias))


def _standard_error_us(table: Table) -> Array:

    def column_of(what: str) -> tuple[str, Array]:
        names = {f"latency_{what}_{unit}": factor for unit, factor in TIMES.items()}
        name = next((name for name in names if name in table.columns), "")
        return name, table.numbers(name, at_least=0.0) * names.get(name, 1.0)

    given, error = column_of("error")
    if given:
        return error
    given, spread = column_of("sd")
    if not given:
        (lower_name, lower), (upper_name, upper) = column_of("q25"), column_of("q75")
        for k in np.flatnonzero(upper < lower):
            raise table.wrong(int(k), upper_name, f"must be at least {lower_name}")
        spread = (upper - lower) / 1.349  # of a normal distribution
    return spread / np.sqrt(table.numbers("number", at_least=1.0))


def _noise(table: Table, light: Array, unit: str) -> Noise:
    names = [name for name in table.columns if _RATE.fullmatch(name)]
    rates = {name: table.numbers(name, at_least=0.0) for name in names}
    shares = [name for name in rates if "_share" in name]
    for name in shares:
        for k in np.flatnonzero(rates[name] > 1.0):
            raise table.wrong(int(k), name, "must be a share from 0 to 1")
    pixels = table.numbers("pixels", at_least=1.0)
    duration = table.numbers("duration_s", above=0.0)
    if shares and np.isnan(duration).any():
        raise DataError(f"{table.name}: a share needs the column duration_s, in every row")
    told = ~np.all(np.isnan(list(rates.values())), axis=0)
    _check_levels(table, light[told], f"{' and '.join(rates)}: rows with a number have")
    least = table.numbers("least_hz", above=0.0)
    return Noise(light, unit, rates, pixels, duration, least)
