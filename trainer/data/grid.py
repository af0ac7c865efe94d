"""One regular grid for every log: jittered times are snapped, and the working step divides the hour.

A log's own step is that of its air temperature, in whole minutes. The working step is the multiple of it that divides
the hour and lies nearest to a quarter of an hour; where no multiple divides the hour (7 minutes), the log is read
between its rows.
"""

from __future__ import annotations

import numpy as np

from igrow.core import gaps
from igrow.core.arrays import Floats, Mask, Times
from igrow.core.quantities import ACTUATORS, SETPOINTS
from igrow.core.telemetry import Telemetry, to_grid

WORKING_STEP = 900.0
"""Seconds: the pace of a greenhouse's air; the working step lies as near to it as the log allows."""
HOUR = 3600.0
SHORTEST = 60.0
"""Seconds; a log of shorter steps is averaged to it."""
HALF = 0.5
"""Share of an interval's rows from which on it counts."""
_REGULAR = 0.5
"""Share of a log's steps that must lie near the usual one, else its times are irregular."""
_OCCUPIED = 0.7
"""Share of the grid's rows that irregular times must reach."""
_DIVISORS = tuple(60.0 * minutes for minutes in (1, 2, 3, 4, 5, 6, 10, 12, 15, 20, 30, 60))


def own_step(time: Times) -> float:
    """Return the step of a log in seconds: whole minutes where its times allow, at least one; NaN below two rows."""
    if len(time) < 2:
        return float("nan")
    steps = np.diff(time.astype("datetime64[s]").astype(np.int64)).astype(np.float64)
    middle = float(np.median(steps))
    usual = steps[(steps > 0.5 * middle) & (steps < 1.5 * middle)]
    if len(usual) < _REGULAR * len(steps):
        return _step_of_irregular(time, middle)
    # Jitter goes from one step into the next, so that the mean knows the step better than the median.
    mean = float(usual.mean())
    for unit in (60.0, 30.0, 1.0):
        step = unit * round(mean / unit)
        if step and abs(step - mean) <= 0.04 * step:
            return max(step, SHORTEST)
    return max(mean, SHORTEST)


def _step_of_irregular(time: Times, middle: float) -> float:
    """Return the shortest divisor of the hour, not below the median step, of which most cells hold a row."""
    seconds = time.astype("datetime64[s]").astype(np.int64)
    for step in _DIVISORS:
        cells = np.unique(seconds // int(step))
        # Cells of long gaps do not count.
        apart = np.minimum(np.diff(cells), round(HOUR / step) + 1)
        if step >= middle and len(cells) >= _OCCUPIED * (apart.sum() + 1):
            return step
    return max(middle, HOUR)


def working_step(step: float) -> float:
    """Return the seconds between rows of the record of a log whose rows lie `step` seconds apart (up to an hour)."""
    multiples = [k * step for k in range(1, int(HOUR // step) + 1) if HOUR % (k * step) == 0.0]
    if multiples:
        return min(multiples, key=lambda one: (abs(one - WORKING_STEP), one))
    return min(one for one in _DIVISORS if one >= max(step, WORKING_STEP))


def on_grid(telemetry: Telemetry) -> Telemetry:
    """Return a log on a regular grid without missing times, whose step has a multiple that divides the hour.

    Rows are snapped to the nearest time of the grid (two of them at one are averaged); gaps become rows of NaN. A
    column that was written less often than the air temperature (hourly weather beside climate every five minutes) is
    filled between its readings where these lie at most an hour apart. Rows more than an hour apart stay as they are.
    """
    anchor = telemetry.columns.get("air_temperature")
    there = np.isfinite(anchor) if anchor is not None else np.zeros(len(telemetry), dtype=bool)
    time = telemetry.time[there] if there.sum() > 1 else telemetry.time
    step = own_step(time)
    if not step <= HOUR:
        return telemetry
    divides = working_step(step) % step == 0.0
    return _with_slow_columns_filled(_snapped(telemetry, step) if divides else _between_rows(telemetry, step))


def interval_means(values: Floats, counted: Mask, rows: int) -> tuple[Floats, Mask]:
    """Return the means over intervals of `rows` rows along the last axis, of the rows that count, and which count.

    An interval counts from half of its rows on; else its mean is 0.

    Args:
        values: (..., n).
        counted: which rows count, of a shape that broadcasts with `values`, (..., n).
        rows: in an interval.
    """
    whole = values.shape[-1] // rows
    present = np.broadcast_to(counted, np.broadcast_shapes(counted.shape, values.shape))[..., : whole * rows]
    present = present.reshape(*present.shape[:-1], whole, rows)
    cut = np.broadcast_to(values, present.shape[:-2] + values.shape[-1:])[..., : whole * rows].reshape(present.shape)
    number = present.sum(axis=-1)
    enough = number >= HALF * rows
    means: Floats = np.where(enough, np.where(present, cut, 0.0).sum(axis=-1) / np.maximum(number, 1), 0.0)
    return means, enough


def _snapped(telemetry: Telemetry, step: float) -> Telemetry:
    """Return the table at the times of the grid: the nearest row, or the mean of those nearest."""
    size = int(step)
    shifted = telemetry.time + np.timedelta64(size // 2, "s")
    cell = shifted.astype(np.int64) // size
    if (np.diff(cell) == 0).any():
        return to_grid(Telemetry(shifted, telemetry.columns), size)
    # A mean of one reading is that reading, but for angles, whose sine and cosine round.
    index, count = cell - cell[0], int(cell[-1] - cell[0]) + 1
    columns = {}
    for name, values in telemetry.columns.items():
        columns[name] = np.full(count, np.nan)
        columns[name][index] = values
    return Telemetry(((cell[0] + np.arange(count)) * size).astype("datetime64[s]"), columns)


def _between_rows(telemetry: Telemetry, step: float) -> Telemetry:
    """Return a log on its working step, read between its rows: states at each time, what is held as means to the next.

    Nothing is read across a gap of more than one and a half steps.
    """
    wide = working_step(step)
    seconds = telemetry.time.astype(np.int64).astype(np.float64)
    first = np.ceil(seconds[0] / wide) * wide
    grid = np.arange(first, seconds[-1] + 1.0, wide)
    minutes = grid[:, None] + np.arange(0.0, wide, 60.0)
    columns: dict[str, Floats] = {}
    for name, values in telemetry.columns.items():
        there = np.isfinite(values)
        known, given = seconds[there], values[there]
        if len(known) == 0:
            columns[name] = np.full(len(grid), np.nan)
            continue
        at = minutes if name in (*ACTUATORS, *SETPOINTS) else grid
        before = np.clip(np.searchsorted(known, at, side="right") - 1, 0, None)
        after = np.clip(np.searchsorted(known, at, side="left"), None, len(known) - 1)
        near = (known[after] - known[before] <= 1.5 * step) & (at >= known[0]) & (at <= known[-1])
        if at is grid:
            columns[name] = np.where(near, np.interp(at, known, given), np.nan)
        else:
            means, enough = interval_means(np.where(near, given[before], 0.0).ravel(), near.ravel(), at.shape[1])
            columns[name] = np.where(enough, means, np.nan)
    return Telemetry(grid.astype(np.int64).astype("datetime64[s]"), columns)


def _with_slow_columns_filled(table: Telemetry) -> Telemetry:
    """Return the table with columns that were written at a slower pace, of an hour at most, filled between."""
    filled: dict[str, Floats] = {}
    step = table.step
    for name, values in table.columns.items():
        known = np.flatnonzero(np.isfinite(values))
        if len(known) < 3 or name in ("air_temperature", "air_humidity", "air_co2"):
            continue
        apart = np.diff(known)
        pace = int(np.median(apart))
        if pace < 2 or pace * step > HOUR or np.mean(apart == pace) < _REGULAR:
            continue
        between = gaps.held(values) if name in (*ACTUATORS, *SETPOINTS) else gaps.interpolated(values)
        filled[name] = np.where(gaps.short_gaps(values, pace - 1), between, np.nan)
    return table.with_columns(filled) if filled else table
