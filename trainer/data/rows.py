"""Rows as they stand in a file, to rows in time: what is sorted, what stands twice, and what contradicts itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.telemetry import Telemetry, concatenate, from_rows
from igrow.trainer.data.fault import DataFault
from igrow.trainer.data.grid import HOUR, own_step

COMPARED = {
    "air_temperature": 0.1,
    "outdoor_temperature": 0.1,
    "air_humidity": 0.5,
    "air_co2": 5.0,
    "global_radiation": 10.0,
}
"""Quantities that are compared; differences below are nothing, whatever the pace of the log."""
LARGEST_RATIO = 3.0
"""How much further than the next row a repeated row may lie, in medians of each, before it contradicts the first."""
FAR_DAYS, FEW = 60, 0.01
"""Rows so many days away from all others, and fewer than such a share of them, are a clock's mistake."""
LEAST_STEP = 240.0
"""Seconds between rows from which on one row a day that stands between them is told from a clock that is uneven."""
LEAST_REPEATED = 12
"""Rows that stand twice from which on a contradiction is judged."""


@dataclass(frozen=True)
class Merged:
    """The table of one file."""

    telemetry: Telemetry
    notes: tuple[str, ...] = ()
    faults: tuple[DataFault, ...] = ()


def merge(time: Times, columns: Mapping[str, Floats]) -> Merged:
    """Return rows in any order as a table in time, with what had to be done for it.

    Of rows with one time a later one wins, as in the telemetry format; several columns' readings in rows of their own
    (a log in which each sensor writes a row) are no contradiction.

    Args:
        time: (n,), NaT for rows that are to be left out.
        columns: by quantity, (n,).
    """
    known = ~np.isnat(time)
    time, columns = time[known], {name: values[known] for name, values in columns.items()}
    table, notes = _without_rows_of_days(from_rows(time, columns))
    back = np.diff(time.astype(np.int64)) < 0
    if len(time) > 1 and back.all():
        notes.append("the rows stand in the order of time from the newest to the oldest: turned round")
    elif back.any() and back.mean() > 0.01:
        notes.append(f"{int(back.sum())} rows stand before an earlier one: put in the order of time")
    repeated = len(time) - len(np.unique(time))
    faults = []
    if repeated:
        sentence = _contradiction(time, columns, table) if repeated >= LEAST_REPEATED else None
        if sentence is None:
            notes.append(f"{repeated} rows have the time of another row: the later one of them counts")
        else:
            mend = (
                "export one compartment alone, or name its rows with `only` in the mapping; "
                "where it is the hour when clocks go back, name the time zone of the export"
            )
            seen = f"{repeated} rows have the time of another row, and {sentence}"
            faults.append(DataFault("repeated_times", "", seen, mend))
    return Merged(table, tuple(notes), tuple(faults))


def joined(parts: Sequence[Merged]) -> Merged:
    """Return the tables of several files joined in time, with a fault where those that overlap contradict each other.

    Where rows overlap the later file counts; files of one sensor each overlap without a contradiction.
    """
    if len(parts) == 1:
        return parts[0]
    tables = [one.telemetry for one in parts]
    table = concatenate(tables)
    faults = dict.fromkeys(fault for one in parts for fault in one.faults)
    repeated = sum(map(len, tables)) - len(table)
    if repeated >= LEAST_REPEATED:
        compared = [one.only([name for name in COMPARED if name in one]) for one in tables]
        time = np.concatenate([one.time for one in compared])
        empty = {name: [one.columns.get(name, np.full(len(one), np.nan)) for one in compared] for name in COMPARED}
        columns = {name: np.concatenate(values) for name, values in empty.items() if name in table}
        sentence = _contradiction(time, columns, table)
        if sentence is not None:
            seen = f"several files have rows of the same times, and {sentence}"
            mend = "read one compartment alone: its files in a folder of their own"
            faults[DataFault("repeated_times", "", seen, mend)] = None
    notes = dict.fromkeys(note for one in parts for note in one.notes)
    return Merged(table, tuple(notes), tuple(faults))


def _without_rows_of_days(table: Telemetry) -> tuple[Telemetry, list[str]]:
    """Return a table without one row a day that stands between the times of all others, and a note on them.

    It is the day's sum or mean, under the last second of the day.
    """
    step, seconds = own_step(table.time), table.time.astype(np.int64)
    if not LEAST_STEP <= step <= HOUR:
        return table, []
    phases, counts = np.unique(seconds % int(step), return_counts=True)
    off = seconds % int(step) != phases[np.argmax(counts)]
    days = len(np.unique(seconds // 86_400))
    clock = np.unique(seconds[off] % 86_400)
    if not 3 <= off.sum() <= days + 1 or off.sum() < 0.8 * (days - 1) or len(clock) > 2 or len(table) < 8 * days:
        return table, []
    kept = Telemetry(table.time[~off], {name: values[~off] for name, values in table.columns.items()})
    when = f"{clock[0] // 3600:02d}:{clock[0] % 3600 // 60:02d}"
    return kept, [f"{off.sum()} rows, one a day at {when} UTC, stand between the times of all others: set aside"]


def without_strays(telemetry: Telemetry) -> tuple[Telemetry, tuple[str, ...]]:
    """Return a log without the few rows that stand months away from all others, and a note on them.

    A clock that was not set yet, or a misprint of the year, writes such rows.
    """
    if len(telemetry) < 3:
        return telemetry, ()
    far = np.flatnonzero(np.diff(telemetry.time).astype("timedelta64[D]").astype(np.int64) > FAR_DAYS)
    edges = [0, *(int(row) + 1 for row in far), len(telemetry)]
    parts = [(first, last) for first, last in pairwise(edges) if last - first > FEW * len(telemetry)]
    kept = np.zeros(len(telemetry), dtype=bool)
    for first, last in parts:
        kept[first:last] = True
    if kept.all():
        return telemetry, ()
    lost = telemetry.time[~kept]
    when = ", ".join(dict.fromkeys(str(time.astype("datetime64[D]")) for time in lost[:5]))
    table = Telemetry(telemetry.time[kept], {name: values[kept] for name, values in telemetry.columns.items()})
    return table, (f"{len(lost)} rows stand months away from all others ({when}): set aside",)


def _contradiction(time: Times, columns: Mapping[str, Floats], table: Telemetry) -> str | None:
    """Return how rows of one time differ, where they do so by far more than a row does from the next."""
    for name, nothing in COMPARED.items():
        if name not in columns:
            continue
        read = np.flatnonzero(np.isfinite(columns[name]))
        order = read[np.argsort(time[read], kind="stable")]
        same = np.flatnonzero(np.diff(time[order].astype(np.int64)) == 0)
        values = columns[name][order]
        apart = np.abs(values[same + 1] - values[same])
        usual = _median_step(table[name])
        if len(apart) >= LEAST_REPEATED and usual is not None:
            middle = float(np.median(apart))
            if middle > LARGEST_RATIO * max(usual, nothing):
                return f"their {name} differs by {middle:.3g}, where a row differs from the next by {usual:.3g}"
    return None


def _median_step(values: Floats) -> float | None:
    steps = np.abs(np.diff(values))
    steps = steps[np.isfinite(steps)]
    return float(np.median(steps)) if len(steps) else None
