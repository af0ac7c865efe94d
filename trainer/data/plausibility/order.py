"""Rows too far apart, and rows that do not follow from each other."""

from __future__ import annotations

import numpy as np

from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault
from igrow.trainer.data.grid import HOUR, own_step
from igrow.trainer.data.plausibility.units import readings
from igrow.trainer.data.screening import NEEDED

LEAST_DAYS = 5
"""Days with readings in half of their hours that a log needs, if it has more days than these."""
LEAST_CORRELATION = 0.3
"""Of one row with the next: outdoor temperature, an hour later, has 0.97 and more."""
_LEAST_ROWS = 100


def days_read(telemetry: Telemetry, name: str) -> int:
    """Return on how many days a quantity has readings in half of the hours."""
    if name not in telemetry:
        return 0
    hours = np.unique(telemetry.time.astype("datetime64[h]")[np.isfinite(telemetry[name])])
    _, count = np.unique(hours.astype("datetime64[D]"), return_counts=True)
    return int((count >= 12).sum())


def sparse(telemetry: Telemetry) -> DataFault | None:
    """Tell whether the rows, or the readings in them, lie too far apart for any model."""
    step = own_step(telemetry.time)
    mend = "export a row every hour or more, best every 5 min"
    if not step <= HOUR:
        pace = f"a row every {step / HOUR:.3g} h" if step > 0.0 else "a single row"
        return DataFault("sparse", "", f"{pace} is too sparse for any model", mend)
    days = np.unique(telemetry.time.astype("datetime64[D]"))
    for name in NEEDED:
        if name not in telemetry or not np.isfinite(telemetry[name]).any():
            continue
        whole = days_read(telemetry, name)
        if len(days) > LEAST_DAYS and whole < LEAST_DAYS:
            seen = f"{name} has readings in half of the hours on {whole} of {len(days)} days only"
            return DataFault("sparse", name, f"{seen}, too sparse for any model", mend)
    return None


def shuffled(telemetry: Telemetry) -> DataFault | None:
    """Tell whether one row says nothing of the next: the times are not those of the readings."""
    for name in ("outdoor_temperature", "air_temperature", "global_radiation"):
        values = readings(telemetry, name)
        if len(values) < _LEAST_ROWS or np.ptp(values) == 0.0:
            continue
        ranks = np.argsort(np.argsort(values, kind="stable"), kind="stable").astype(np.float64)
        correlation = float(np.corrcoef(ranks[1:], ranks[:-1])[0, 1])
        if correlation >= LEAST_CORRELATION:
            return None
        seen = f"{name} of one row says nothing of the next (correlation {correlation:.2f})"
        mend = "the times do not belong to the readings: export the log anew, without sorting single columns"
        return DataFault("shuffled_rows", name, seen, mend)
    return None
