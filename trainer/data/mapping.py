"""A grower's own export: one YAML file says how it is laid out, and which of its columns is which quantity.

    time: {column: Datum, time_of_day: Tijd, format: "%d-%m-%Y %H:%M", time_zone: Europe/Amsterdam}
    delimiter: ";"
    decimal: ","
    columns:
      air_temperature: {column: "Temp kas (C)"}
      energy_screen: {column: "Doek", scale: -1, offset: 100}            # the export's 100 is open
      lamp_power: {column: "HPS", add: ["LED"], scale: 81, words: {Aan: 1, Uit: 0}}
      global_radiation: {column: "Stralingssom", amount: day, scale: 10000}   # J cm-2 since midnight

A value becomes value * scale + offset. Where a quantity is spread over several columns, `add` names the further ones;
they are added before the scale is applied. `igrow-trainer import` writes such a file.
"""

from __future__ import annotations

# ruff: noqa: RUF009 - `setting` makes a dataclass field
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from igrow.core.errors import IgrowError
from igrow.core.local_time import zone
from igrow.core.quantities import QUANTITIES
from igrow.core.yaml_schema import SettingError, setting

Amount = Literal["rate", "interval", "day", "total"]
"""What a number is: a rate or a state, an amount since the row before, since midnight, or since the start."""
MISSING = ("", "NaN", "nan", "-", "--", "---", "#N/A", "#N/B", "#NV", "#DIV/0!", "N/A", "n/a", "NULL", "null")


@dataclass(frozen=True)
class TimeColumn:
    """Where the time stands, and how it is written."""

    column: str = setting(
        default="time",
        help="its name in the export; (day in the name): the day that the sheet or the file is named after",
    )
    time_of_day: str | None = setting(
        default=None, help="column of the time of day, where the first has the date alone"
    )
    format: str = setting(
        default="ISO 8601",
        help="ISO 8601, excel (days since 1899-12-30), unix (or unix ms, us, ns: of parts of a second), or as strptime "
        "has it; %Z at the end: EST, CET",
    )
    time_zone: str = setting(
        default="UTC", help="IANA name of the zone of times without one, and of abbreviations that several zones have"
    )

    def __post_init__(self) -> None:
        try:
            zone(self.time_zone)
        except IgrowError as error:
            raise SettingError(str(error), "time_zone") from None


@dataclass(frozen=True)
class ColumnMapping:
    """One column of the export."""

    column: str = setting(help="its name in the export")
    scale: float = setting(default=1.0, help="factor from the export's unit to the registry's")
    offset: float = setting(default=0.0, help="added after the factor, in the registry's unit")
    add: tuple[str, ...] = setting(default=(), help="further columns, added to the first before the factor")
    amount: Amount = setting(
        default="rate",
        help="what a number is: a rate or a state; an amount since the row before; since midnight; or since the start. "
        "Amounts become rates per second before the factor",
    )
    words: Mapping[str, float] = setting(default_factory=dict, help="numbers that words stand for, such as {On: 1}")


@dataclass(frozen=True)
class LongTable:
    """An export with one reading a row."""

    name: str = setting(help="column that names what was read")
    value: str = setting(help="column of the reading")


@dataclass(frozen=True)
class ExportMapping:
    """What a grower's export means."""

    columns: Mapping[str, ColumnMapping] = setting(help="our name -> the export's column", keys=tuple(QUANTITIES))
    time: TimeColumn = setting(default_factory=TimeColumn, help="the time")
    delimiter: str = setting(
        default=",", help="between cells of a text file; a blank where columns stand at fixed places"
    )
    decimal: str = setting(default=".", help="decimal sign of numbers")
    missing: tuple[str, ...] = setting(default=MISSING, help="texts that stand for no value")
    encoding: str = setting(default="utf-8", help="of a text file")
    sheet: str | None = setting(default=None, help="of a workbook; all with these columns, where none is named")
    header: tuple[int, ...] = setting(default=(1,), low=1, help="lines that together name the columns")
    first_row: int | None = setting(default=None, low=2, help="line of the first reading; the one after the header")
    transposed: bool = setting(default=False, help="whether times stand across, with a line for each sensor")
    only: Mapping[str, str] = setting(default_factory=dict, help="rows to read: column -> its text there")
    long: LongTable | None = setting(default=None, help="for an export with one reading a row")

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1:
            raise SettingError(f"delimiter is {self.delimiter!r}: one character is needed", "delimiter")
        if self.decimal not in {".", ","}:
            raise SettingError(f"decimal is {self.decimal!r}: . or , is needed", "decimal")
        if not self.header:
            raise SettingError("header is empty: the line with the columns' names is needed", "header")

    @property
    def names(self) -> set[str]:
        """The columns of an export that are read."""
        if self.long is not None:
            read = [self.long.name, self.long.value]
        else:
            read = [name for rule in self.columns.values() for name in (rule.column, *rule.add)]
        return {self.time.column, *filter(None, [self.time.time_of_day]), *read, *self.only}
