"""How much CO2 a crop has had since planting: it decides on the price of the next kilogram (`igrow.core.economics`).

The log of a gateway reaches back some days, a crop lives for months. So a count goes on from plan to plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from igrow.core.site import Site
from igrow.core.telemetry import Telemetry


@dataclass(frozen=True)
class CO2Count:
    """What a crop has had of CO2 until a time."""

    time: float
    """Seconds since 1970 UTC."""
    amount: float
    """kg m-2."""

    @classmethod
    def of_plan(cls, event: Mapping[str, Any] | None) -> CO2Count | None:
        """Return the count that a plan's event holds; None without one (older daemons wrote none down)."""
        if event is None or "co2_before" not in event:
            return None
        return cls(datetime.fromisoformat(event["start"]).timestamp(), float(event["co2_before"]))


def co2_since_planting(site: Site, log: Telemetry, start: int, counted: CO2Count | None = None) -> float:
    """Return how much CO2 the crop has probably had at `start`, kg m-2: it decides on the price of the next kilogram.

    An earlier count of the same crop goes on by what the log holds since. Without one the days since planting count as
    those that the log holds, which is believed once: it reaches back some days only, and what doses more since last
    week (a leak, a plan) did not do so all along.
    """
    planted = int(np.datetime64(site.crop.planting_date, "s").astype(np.int64))
    if counted is None or counted.time <= planted:
        counted = CO2Count(planted, 0.0)
    dosing = log.columns.get("co2_dosing", np.full(len(log), np.nan))
    known = np.isfinite(dosing)
    since = known & (log.time >= np.datetime64(int(counted.time), "s"))
    if not known.any():
        return counted.amount
    rate = float(dosing[since if since.any() else known].mean())
    return counted.amount + rate * max(start - counted.time, 0.0) / 3600.0
