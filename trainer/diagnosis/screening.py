"""Sensors before physics: stretches that no model may be fitted to are set aside, and said so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis.result import Screened

Floats = NDArray[np.float64]

STUCK_HOURS: Mapping[str, float] = {
    "air_temperature": 6.0,
    "air_humidity": 8.0,
    "air_co2": 6.0,
    "outdoor_temperature": 8.0,
    "outdoor_humidity": 24.0,
    "sky_temperature": 12.0,
}
"""Hours after which an unchanged reading is no reading (saturated humidity aside)."""
SPIKE: Mapping[str, float] = {
    "air_temperature": 4.0,
    "air_humidity": 15.0,
    "air_co2": 400.0,
    "outdoor_temperature": 5.0,
}
"""A reading that leaves both its neighbours by so much, to the same side, is a spike."""
LARGEST_LOSS = 0.5
"""Share of a needed quantity that may be set aside before the log as a whole is a data fault."""
NEEDED = ("outdoor_temperature", "air_temperature")
SENSED = ("air_temperature", "air_humidity", "air_co2")


@dataclass(frozen=True)
class Screening:
    """The log without what was set aside."""

    telemetry: Telemetry
    screened: tuple[Screened, ...]
    faults: tuple[str, ...]
    """Needed quantities of which too little is left, each with the reason, for people."""


def screen(telemetry: Telemetry) -> Screening:
    """Set aside readings that are out of range, spikes, or stuck."""
    columns = {}
    found: list[Screened] = []
    faults: list[str] = []
    for name, raw in telemetry.columns.items():
        values = np.array(raw)
        quantity = QUANTITIES[name]
        with np.errstate(invalid="ignore"):
            wrong = (values < quantity.low) | (values > quantity.high)
        checks = [("out of range", wrong)]
        if name in SPIKE:
            checks.append(("spike", _spikes(np.where(wrong, np.nan, values), SPIKE[name])))
        if name in STUCK_HOURS:
            checks.append(
                ("stuck", _stuck(telemetry.time, values, STUCK_HOURS[name], saturated=name.endswith("humidity")))
            )
        before = int(np.isfinite(values).sum())
        for reason, rows in checks:
            found += [
                Screened(name, telemetry.time[first], telemetry.time[last], reason) for first, last in _stretches(rows)
            ]
            values[rows] = np.nan
        columns[name] = values
        left = int(np.isfinite(values).sum())
        if name in (*NEEDED, *SENSED) and before and left < LARGEST_LOSS * before:
            faults.append(f"{name}: {100 * (1 - left / before):.0f} % of its readings were set aside")
    return Screening(Telemetry(telemetry.time, columns), tuple(found), tuple(faults))


def _spikes(values: Floats, size: float) -> NDArray[np.bool_]:
    rows = np.zeros(len(values), dtype=bool)
    if len(values) > 2:
        before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
        with np.errstate(invalid="ignore"):
            rows[1:-1] = (np.minimum(np.abs(before), np.abs(after)) > size) & (before * after > 0.0)
    return rows


def _stuck(time: NDArray[np.datetime64], values: Floats, hours: float, *, saturated: bool) -> NDArray[np.bool_]:
    rows = np.zeros(len(values), dtype=bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return rows
    seconds = time[known].astype("datetime64[s]").astype(np.int64)
    change = np.flatnonzero(np.concatenate([[True], np.diff(values[known]) != 0.0, [True]]))
    for first, end in pairwise(change):
        lasted = seconds[end - 1] - seconds[first]
        if lasted >= hours * 3600.0 and not (saturated and values[known[first]] >= 99.0):
            rows[known[first] : known[end - 1] + 1] = True
    return rows & np.isfinite(values)


def _stretches(rows: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(np.int8), [0]])))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]
