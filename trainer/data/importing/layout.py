"""The layout of a file: encoding, delimiter, decimal sign, lines with names, line with units, first reading."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import charset_normalizer

from igrow.core.errors import IgrowError
from igrow.trainer.data import vocabulary
from igrow.trainer.data.cells import Cells, is_text, is_workbook, read_bytes, read_cells, unquoted
from igrow.trainer.data.fixed_places import stands_at_fixed_places
from igrow.trainer.data.importing.first_reading import first_reading, is_value, times_have_no_day, times_stand_across
from igrow.trainer.data.importing.sheets import fullest_sheet
from igrow.trainer.data.named_days import day_in

DELIMITERS = (";", "\t", "|", ",")
"""In the order in which they are believed: a comma may be a decimal sign."""
_ENCODINGS = ("cp1252", "cp1250", "cp1254", "cp1251", "gb18030", "cp932", "big5")
"""Of which the first that fits best is taken."""
_BYTES, _HEAD = 100_000, 30
"""Of a text that are looked at for its encoding, and lines in which columns' names stand."""
_SAMPLE = 400
"""Rows that are looked at."""
_DIGITS = re.compile(r"[-+\u2212]?(\d[\d.,]*)(?![\d:/-])")
_GROUPED = re.compile(r"[1-9]\d{0,2}([.,]\d{3})+")


@dataclass(frozen=True)
class Layout:
    """Where things stand in a file."""

    encoding: str
    delimiter: str
    decimal: str
    sheet: str | None
    header: tuple[int, ...]
    units: int | None
    """Line with the units, where it has its own."""
    first_row: int
    transposed: bool = False
    """Whether times stand across."""
    day_in_name: bool = False
    """Whether rows have a time of day alone, and the day is that of the sheet's or the file's name."""


def find_layout(path: Path, sheet: str | None = None) -> tuple[Layout, Cells]:
    """Return the layout of a file, and its cells.

    Raises:
        IgrowError: it cannot be read, or no row of it has a time and numbers.
    """
    encoding, delimiter = "utf-8", ","
    if is_text(path):
        encoding = find_encoding(read_bytes(path))
        text = read_bytes(path).decode(encoding, errors="replace").removeprefix("\ufeff")
        delimiter = " " if stands_at_fixed_places(text) else find_delimiter(unquoted(text))
    elif is_workbook(path) and sheet is None:
        sheet = fullest_sheet(path)
    cells = read_cells(path, delimiter=delimiter, encoding=encoding, sheet=sheet)
    transposed = times_stand_across(cells)
    if transposed:
        cells = read_cells(path, delimiter=delimiter, encoding=encoding, sheet=sheet, transposed=True)
    day_in_name = times_have_no_day(cells) and bool(day_in(cells.sheet) or day_in(path.name))
    first = first_reading(cells, day_in_name=day_in_name)
    head, units = _header(cells, first)
    body = list(zip_longest(*cells.rows[first : first + _SAMPLE], fillvalue=""))
    return Layout(
        encoding,
        delimiter,
        find_decimal(body),
        sheet,
        tuple(cells.lines[row] for row in head),
        None if units is None else cells.lines[units],
        cells.lines[first],
        transposed,
        day_in_name,
    ), cells


def find_encoding(data: bytes) -> str:
    """Return the encoding of a text file."""
    for mark, name in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
        if data.startswith(mark):
            return name
    try:
        if b"\x00" in data[:_BYTES]:
            # Half of the bytes of UTF-16 are zero; without a mark their place tells the order.
            return "utf-16-be" if data[:_BYTES:2].count(0) > data[1:_BYTES:2].count(0) else "utf-16-le"
        data.decode("utf-8")
    except UnicodeDecodeError:
        return _likeliest_encoding(data[:_BYTES])
    return "utf-8"


def _likeliest_encoding(data: bytes) -> str:
    """Return the encoding in which a text has most of the words that columns are made of."""
    told: dict[str, int] = {}
    for name in _ENCODINGS:
        try:
            # The last character may be cut in two.
            text = codecs.getincrementaldecoder(name)().decode(data)
        except UnicodeDecodeError:
            continue
        told[name] = sum(len(vocabulary.words_in(line)) for line in text.splitlines()[:_HEAD])
    best = max(told, key=lambda name: told[name], default="cp1252")
    if told.get(best, 0):
        return best
    guess = charset_normalizer.from_bytes(data, cp_isolation=list(_ENCODINGS)).best()
    return "cp1252" if guess is None else guess.encoding.replace("_", "-")


def find_delimiter(text: str) -> str:
    """Return the sign between the cells of a text file: the one that gives most rows the same number of cells."""
    lines = [line for line in text.splitlines() if line.strip()][:_SAMPLE]
    if lines and (hint := re.fullmatch(r"sep=(.)", lines[0].strip())):
        return hint[1]
    best, found = 0.0, ","
    for delimiter in DELIMITERS:
        try:
            widths = [len(row) for row in csv.reader(io.StringIO("\n".join(lines)), delimiter=delimiter)]
        except csv.Error:
            continue
        width, count = Counter(widths).most_common(1)[0] if widths else (1, 0)
        share = count / max(len(widths), 1)
        if width > 1 and share > best + 0.05:
            best, found = share, delimiter
    return found


def find_decimal(columns: Sequence[Sequence[str]]) -> str:
    """Return the decimal sign of the numbers in a table's columns, each a sequence of cells.

    A sign that stands before three digits may be one of thousands. It is, where other numbers of its column have none:
    980, then 1.020.
    """
    certain: Counter[str] = Counter()
    unsure: Counter[str] = Counter()
    for cells in columns:
        own: Counter[str] = Counter()
        grouped: Counter[str] = Counter()
        whole = 0
        for cell in cells:
            digits = _DIGITS.match(cell)
            signs = [sign for sign in (digits[1].rstrip(".,") if digits else "") if sign in ".,"]
            if digits is not None and not signs:
                whole += 1
            elif len(set(signs)) == 2 or (signs and digits is not None and _is_decimal(digits[1])):
                own[signs[-1]] += 1
            elif digits is not None and _GROUPED.fullmatch(digits[1]):
                grouped[signs[0]] += 1
        certain += own
        for sign, count in grouped.items():
            if whole and not own[sign]:
                certain["," if sign == "." else "."] += count
            else:
                unsure[sign] += count
    told = certain or unsure
    return "," if told[","] > told["."] else "."


def _is_decimal(digits: str) -> bool:
    return len(re.findall(r"[.,]", digits)) == 1 and _GROUPED.fullmatch(digits) is None


def _header(cells: Cells, first: int) -> tuple[list[int], int | None]:
    """Return the rows that name the columns, and the row of units (None: it has none of its own)."""
    width = len(cells.rows[first])
    above = [
        row
        for row in range(first)
        if sum(bool(cell) for cell in cells.rows[row]) >= max(2, 0.3 * width)
        and sum(is_value(cell) for cell in cells.rows[row] if cell) < 0.5 * sum(bool(cell) for cell in cells.rows[row])
    ]
    # Lines of names stand together, right above the readings.
    above = [row for row in above if row >= first - 4]
    units = next((row for row in reversed(above) if _is_unit_row(cells.rows[row])), None)
    names = [row for row in above if row != units]
    if not names:
        raise IgrowError(f"{cells.path}: no line names the columns: put one above the first reading")
    return names, units


def _is_unit_row(row: Sequence[str]) -> bool:
    """Tell whether most cells of a row are units."""
    filled = [cell for cell in row if cell]
    known = [cell for cell in filled if vocabulary.find_units([vocabulary.compact(cell)])]
    return len(known) >= 0.5 * len(filled) and len(known) >= 2
