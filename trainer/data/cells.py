"""Tables as cells of text, from whatever a greenhouse computer writes: CSV, tab-separated text, Excel, Parquet."""

from __future__ import annotations

import csv
import datetime
import gzip
import io
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError, first_line
from igrow.trainer.data import fixed_places

EXCEL = (".xlsx", ".xls", ".xlsm", ".xlsb", ".ods")
TEXT = (".csv", ".csv.gz", ".txt", ".tsv", ".dat", ".txt.gz", ".tsv.gz")
ENDINGS = (*TEXT, ".parquet", *EXCEL)
"""Endings of files that hold a table."""
ARCHIVE = ".zip"
"""Ending of a file that holds several; `igrow-trainer import` unpacks it into a folder of its name."""


def may_be_table(name: str) -> bool:
    """Tell whether a file among others may be a table by its name: hidden ones and those that explain are none."""
    return name.lower().endswith(ENDINGS) and not name.lower().startswith((".", "readme", "license", "licence"))


def is_archive(path: Path) -> bool:
    """Tell whether a file is called an archive."""
    return path.is_file() and path.name.lower().endswith(ARCHIVE)


@dataclass(frozen=True)
class Cells:
    """The rows of a file, each a list of texts as long as it happens to be."""

    path: Path
    rows: Sequence[list[str]]
    lines: Sequence[int]
    """Line (or row of the sheet) of each, from 1."""
    sheet: str = ""
    """Its name, where the file is a workbook and it was asked for by name."""


_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Of texts in UTF-16, which are full of zeros."""
_OTHER_ARCHIVE = rb"7z\xbc\xaf\x27\x1c|Rar!|.{257}ustar"
_PAGE, _JSON = rb"\s*<(?i:!doctype|html|table|\?xml)", rb'\s*(\{\s*"|\[\s*[\[{])'
_NO_TEXT: Mapping[bytes, str] = {
    rb"PK\x03\x04": "a zip archive or a workbook: let its name end in .zip or .xlsx",
    rb"\xd0\xcf\x11\xe0": "a workbook: let its name end in .xls",
    rb"%PDF": "a PDF: a table is needed, such as CSV or Excel",
    _OTHER_ARCHIVE: "an archive that is not read: unpack it, and give the folder, or a zip archive of it",
    _PAGE: "a page of HTML or XML: open it in a spreadsheet and save it as CSV or .xlsx",
    _JSON: "JSON: a table is needed, such as CSV with a row for each time and a column for each sensor",
}
"""How files begin that are something else than text: what they are, and what would be right."""


def is_text(path: Path) -> bool:
    """Tell whether a file is read as text; many a computer calls a text with tabs ``.xls``."""
    name = path.name.lower()
    if not name.endswith(EXCEL):
        return not name.endswith(".parquet")
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError:
        return False
    return name.endswith(".xls") and bool(start) and (start.startswith(_MARKS) or b"\x00" not in start)


def _refuse_what_is_no_text(path: Path, data: bytes) -> None:
    """Raise IgrowError that names what a file is, where it is something else than text."""
    told = next((text for start, text in _NO_TEXT.items() if re.match(start, data[:300], re.DOTALL)), None)
    if told is not None:
        raise IgrowError(f"{path}: is {told}")


def read_bytes(path: Path) -> bytes:
    """Return a file's content, unpacked where it is gzip; raises IgrowError where it cannot be read."""
    try:
        data = path.read_bytes()
        return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data
    except OSError as error:
        raise IgrowError(f"{path}: cannot be read: {error.strerror or 'not a whole gzip file'}") from None
    except (EOFError, zlib.error):
        raise IgrowError(f"{path}: the gzip file ends too early or is damaged") from None


def read_text(path: Path, encoding: str) -> str:
    """Return a text file; raises IgrowError where it is not of that encoding."""
    data = read_bytes(path)
    _refuse_what_is_no_text(path, data)
    try:
        # A byte order mark is no part of the text.
        return data.decode("utf-8-sig" if encoding.lower() in {"utf-8", "utf8"} else encoding).removeprefix("\ufeff")
    except LookupError:
        raise IgrowError(f"{path}: encoding {encoding!r} is not known: one such as utf-8 or cp1252 is needed") from None
    except UnicodeDecodeError:
        raise IgrowError(f"{path}: is not {encoding} text") from None


def read_cells(
    path: Path, *, delimiter: str = ",", encoding: str = "utf-8", sheet: str | None = None, transposed: bool = False
) -> Cells:
    """Return the cells of a file; rows without any text are left out.

    Args:
        path: of a text file (gzip or not), a workbook, or Parquet.
        delimiter: between the cells of a text file; a blank where columns stand at fixed places.
        encoding: of a text file.
        sheet: of a workbook; None: the first.
        transposed: whether rows and columns are to be exchanged.

    Raises:
        IgrowError: the file cannot be read, or has no such sheet.
    """
    if is_workbook(path):
        table = _workbook(path, sheet)
    elif path.name.lower().endswith(".parquet"):
        table = _parquet(path)
    elif delimiter == " ":
        table = fixed_places.split(read_text(path, encoding))
    else:
        text = unquoted(read_text(path, encoding))
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        try:
            table = [(row, reader.line_num) for row in reader]
        except csv.Error as error:
            raise IgrowError(f"{path}:{reader.line_num}: cannot be read as a table: {error}") from None
    return _cells(path, table, sheet or "", transposed=transposed)


def read_sheets(path: Path, *, transposed: bool = False) -> dict[str, Cells]:
    """Return the cells of each sheet of a workbook, in its order; raises IgrowError where it cannot be read."""
    book = _open_workbook(path)
    return {name: _cells(path, _rows_of(book, name), name, transposed=transposed) for name in book.sheet_names}


def is_workbook(path: Path) -> bool:
    """Tell whether a file has sheets."""
    return path.name.lower().endswith(EXCEL) and not is_text(path)


def _cells(path: Path, table: Sequence[tuple[list[str], int]], sheet: str, *, transposed: bool) -> Cells:
    """Return a table's cells without the rows that have no text."""
    if transposed:
        columns = zip_longest(*(row for row, _ in table), fillvalue="")
        table = [(list(column), number) for number, column in enumerate(columns, 1)]
    kept = [([cell.strip() for cell in row], line) for row, line in table if any(cell.strip() for cell in row)]
    return Cells(path, [row for row, _ in kept], [line for _, line in kept], sheet)


def unquoted(text: str) -> str:
    """Return a text whose lines each stand in quotes as a whole without them: what a spreadsheet made of a CSV."""
    lines = [line for line in text.splitlines() if line.strip()]
    inside = [line.strip()[1:-1] for line in lines]
    whole = all(
        line.strip() == f'"{own}"' and '"' not in own.replace('""', "") for line, own in zip(lines, inside, strict=True)
    )
    return "\n".join(own.replace('""', '"') for own in inside) if lines and whole else text


def _open_workbook(path: Path) -> Any:
    import python_calamine  # noqa: PLC0415  (only workbooks need it)

    try:
        return python_calamine.CalamineWorkbook.from_path(str(path))
    except (OSError, python_calamine.CalamineError) as error:
        raise IgrowError(f"{path}: cannot be read as a workbook: {first_line(error)}") from None


def _workbook(path: Path, sheet: str | None) -> list[tuple[list[str], int]]:
    book = _open_workbook(path)
    names = list(book.sheet_names)
    if sheet is not None and sheet not in names:
        raise IgrowError(f"{path}: no sheet {sheet!r}; it has {', '.join(names)}")
    if not names:
        raise IgrowError(f"{path}: the workbook has no sheet")
    return _rows_of(book, sheet or names[0])


def _rows_of(book: Any, sheet: str) -> list[tuple[list[str], int]]:
    rows = book.get_sheet_by_name(sheet).to_python(skip_empty_area=False)
    return [([_text(cell) for cell in row], line) for line, row in enumerate(rows, 1)]


def read_frame(path: Path) -> Any:
    """Return a Parquet file as a `pandas.DataFrame`; raises IgrowError."""
    import pandas as pd  # noqa: PLC0415  (slow to import)

    try:
        return pd.read_parquet(path)
    except (OSError, ValueError) as error:
        raise IgrowError(f"{path}: cannot be read as Parquet: {first_line(error)}") from None


def _parquet(path: Path) -> list[tuple[list[str], int]]:
    import pandas as pd  # noqa: PLC0415  (slow to import)

    frame = read_frame(path)
    name = frame.index.name or "time"
    if isinstance(frame.index, pd.DatetimeIndex) and name not in frame.columns:
        frame = frame.reset_index(names=name)
    columns = [[_text(cell) for cell in frame[name].tolist()] for name in frame.columns]
    head = [str(name) for name in frame.columns]
    return [(head, 1), *((list(row), line) for line, row in enumerate(zip(*columns, strict=True), 2))]


def _text(cell: object) -> str:
    """Return a typed cell as text: times in ISO 8601, numbers plain, nothing as nothing."""
    if cell is None or cell != cell:  # noqa: PLR0124 - NaN and NaT
        return ""
    if isinstance(cell, datetime.datetime):
        return cell.isoformat(sep=" ")
    if isinstance(cell, (datetime.date, datetime.time)):
        return cell.isoformat()
    if isinstance(cell, datetime.timedelta):
        # A workbook's time of day that is no more than a length of time.
        return (datetime.datetime(1900, 1, 1) + cell).time().isoformat()
    if isinstance(cell, bool):
        return "1" if cell else "0"
    if isinstance(cell, float):
        return f"{cell:.15g}"
    return str(cell)
