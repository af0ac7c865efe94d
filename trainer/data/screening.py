"""Sensors before physics: stretches that no model may be fitted to are set aside, and said so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from igrow.core.arrays import Floats, Mask, Times
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault

STUCK: Mapping[str, tuple[float, float]] = {
    "air_temperature": (6.0, 0.25),
    "air_humidity": (8.0, 0.9),
    "air_co2": (6.0, 9.0),
    "outdoor_temperature": (8.0, 0.25),
    "outdoor_humidity": (24.0, 0.9),
    "sky_temperature": (12.0, 0.9),
}
"""Hours after which an unchanged reading is no reading (saturated humidity aside), and the steps of a column that may
well stand still for three times as long."""
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
class Screened:
    """A stretch of one quantity that was set aside."""

    quantity: str
    start: np.datetime64
    end: np.datetime64
    reason: str


@dataclass(frozen=True)
class Screening:
    """The log without what was set aside."""

    telemetry: Telemetry
    screened: tuple[Screened, ...]
    faults: tuple[DataFault, ...]
    """Needed quantities of which too little is left."""
    notes: tuple[str, ...]
    """What was set aside, a sentence for each quantity and reason."""


def screen(telemetry: Telemetry) -> Screening:
    """Set aside rows of an outage, and readings that are out of range, spikes, or stuck.

    A sensor that lost more than half of its readings is set aside whole; where nothing can be said without it, the
    log is at fault.
    """
    out = outage_rows(telemetry)
    columns: dict[str, Floats] = {}
    found: list[Screened] = []
    faults: list[DataFault] = []
    notes: list[str] = []
    for name, raw in telemetry.columns.items():
        values = np.where(out, np.nan, raw)
        quantity = QUANTITIES[name]
        with np.errstate(invalid="ignore"):
            wrong = (values < quantity.low) | (values > quantity.high)
        checks = [("out of range", wrong)]
        if name in SENSED:
            checks.insert(0, ("outage", out & np.isfinite(raw)))
        if name in SPIKE:
            checks.append(("spike", _spikes(np.where(wrong, np.nan, values), SPIKE[name])))
        if name in STUCK:
            hours, coarse = STUCK[name]
            hours *= 3.0 if _resolution(values) >= coarse else 1.0
            checks.append(("stuck", _stuck(telemetry.time, values, hours, saturated=name.endswith("humidity"))))
        before = int(np.isfinite(raw).sum())
        for reason, rows in checks:
            stretches = [
                Screened(name, telemetry.time[first], telemetry.time[last], reason) for first, last in _stretches(rows)
            ]
            if stretches and reason != "outage":
                notes.append(_sentence(name, reason, int(rows.sum()), stretches))
            found += stretches
            values[rows] = np.nan
        left = int(np.isfinite(values).sum())
        if name in (*NEEDED, *SENSED) and before and left < LARGEST_LOSS * before:
            lost = f"{100 * (1 - left / before):.0f} % of its readings were set aside"
            if name in NEEDED:
                why = " and ".join(reason for reason, rows in checks if rows.any())
                seen = f"the sensor of {name} does not work, {lost}{f' ({why})' if why else ''}"
                faults.append(DataFault("sensor", name, seen, "look at it, and at how its readings are logged"))
            else:
                values[:] = np.nan
                notes.append(f"{name}: {lost}; nothing is said of it")
        columns[name] = values
    if out.any():
        notes.insert(0, f"{int(out.sum())} rows in which all sensors read 0 were set aside whole: an outage")
    return Screening(Telemetry(telemetry.time, columns), tuple(found), tuple(faults), tuple(notes))


def outage_rows(telemetry: Telemetry) -> Mask:
    """Tell in which rows every climate sensor that the log has reads exactly 0, at least two of them, (n,)."""
    rows = np.ones(len(telemetry), dtype=bool)
    zeros = np.zeros(len(telemetry), dtype=np.int64)
    for name in SENSED:
        if name in telemetry:
            values = telemetry[name]
            rows &= ~(np.abs(values) > 0.0)
            zeros += values == 0.0
    return np.asarray(rows & (zeros >= 2))


def _sentence(name: str, reason: str, count: int, stretches: Sequence[Screened]) -> str:
    first, last = (
        str(one.astype("datetime64[m]")).replace("T", " ") for one in (stretches[0].start, stretches[-1].end)
    )
    when = f"at {first}" if first == last else f"between {first} and {last}"
    return f"{name}: {count} reading{'s' * (count > 1)} {when} UTC set aside: {reason}"


def _spikes(values: Floats, size: float) -> Mask:
    rows = np.zeros(len(values), dtype=bool)
    if len(values) > 2:
        before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
        with np.errstate(invalid="ignore"):
            rows[1:-1] = (np.minimum(np.abs(before), np.abs(after)) > size) & (before * after > 0.0)
    return rows


def _resolution(values: Floats) -> float:
    """Return the step in which a column is written: the smallest change that is not rare (0 without any)."""
    change = np.abs(np.diff(values[np.isfinite(values)]))
    change = change[change > 0.0]
    return float(np.quantile(change, 0.02)) if len(change) else 0.0


def _stuck(time: Times, values: Floats, hours: float, *, saturated: bool) -> Mask:
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


def _stretches(rows: Mask) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(np.int8), [0]])))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]
