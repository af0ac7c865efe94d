"""Columns that only grow and start anew: running sums, where a rate is meant."""

from __future__ import annotations

from typing import Literal

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault

RATES = ("co2_dosing", "irrigation")


def running_sum(time: Times, values: Floats) -> Literal["day", "total"] | None:
    """Return ``day`` for a sum that starts anew about once a day, ``total`` for one that never does, else None.

    A sum hardly ever falls, and where it does it falls to about nothing.

    Args:
        time: (n,).
        values: (n,), NaN where nothing was read.
    """
    known = np.isfinite(values)
    when, seen = time[known], values[known]
    if len(seen) < 48 or np.ptp(seen) <= 0.0:
        return None
    days = float((when[-1] - when[0]).astype(np.int64)) / 86_400.0
    change = np.diff(seen)
    falls, rises = np.flatnonzero(change < 0.0), int((change > 0.0).sum())
    if days < 3.0 or rises < 4.0 * days or len(falls) > 1.3 * days + 2.0:
        return None
    if len(falls) and np.mean(seen[falls + 1] <= 0.1 * seen[falls]) < 0.8:
        return None
    if len(falls) >= 0.5 * days:
        return "day"
    return "total" if len(falls) <= 0.1 * days else None


def summed_rates(telemetry: Telemetry) -> list[DataFault]:
    """Return the rates of dosing and irrigation that are running sums."""
    found = []
    for name in RATES:
        kind = running_sum(telemetry.time, telemetry[name]) if name in telemetry else None
        if kind is not None:
            grows = "from midnight on" if kind == "day" else "all along"
            rule = f"{name}: {{column: ..., amount: {kind}, scale: 3600}}"
            mend = f"in the mapping: {rule}, for a sum in the unit without h-1"
            found.append(DataFault("running_sum", name, f"{name} only grows {grows}: it is a sum", mend))
    return found
