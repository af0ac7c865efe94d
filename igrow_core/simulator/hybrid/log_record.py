"""A log made ready to drive the hybrid stage: its record, on a regular grid, with usual values for what it lacks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core import sun
from igrow.core.arrays import Floats
from igrow.core.simulator.hybrid import measurement
from igrow.core.simulator.hybrid.record import Record, bridge
from igrow.core.telemetry import Telemetry, to_grid

LONGEST_FILL = 1800.0
"""Inputs are bridged over gaps of at most this many seconds; longer ones make their rows unusable."""
_MEANS = ("outdoor_temperature", "outdoor_humidity", "global_radiation", "wind_speed", "sky_temperature", "rain")
"""Inputs that change smoothly, taken as the mean of both ends of the interval."""
_ABSENT: Mapping[str, float] = {
    "outdoor_co2": 420.0,
    "wind_speed": 3.0,
    "outdoor_humidity": 80.0,
    "global_radiation": 0.0,
    "rail_pipe_temperature": 0.0,
    "grow_pipe_temperature": 0.0,
    "vent_lee": 0.0,
    "vent_wind": 0.0,
    "energy_screen": 0.0,
    "blackout_screen": 0.0,
    "lamp_power": 0.0,
    "co2_dosing": 0.0,
    "irrigation": 0.0,
    "wind_direction": 0.0,
    "rain": 0.0,
}
"""What stands in for a column that the log lacks; the record names it in `missing`."""
SWITCHES: Mapping[str, str] = {"lamp_power": "lamp_on", "irrigation": "irrigation_on"}
"""What a log may tell of equipment whose own column it lacks: the balances cannot use it, a diagnosis can."""
_SKY_BELOW_AIR = 12.0
"""K, sky below outdoor air under a half-clouded sky, where no sky temperature is measured."""


def make_record(
    telemetry: Telemetry,
    *,
    step: float,
    latitude: float,
    longitude: float,
    mean_height: float,
    lamp_efficacy: float,
    leaf_area_index: float,
) -> Record:
    """Return the record of a log.

    Args:
        telemetry: any columns of the registry; outdoor and air temperature must be among them.
        step: seconds between rows of the record.
        latitude: degrees north.
        longitude: degrees east.
        mean_height: m, air volume per floor area.
        lamp_efficacy: umol J-1.
        leaf_area_index: m2 m-2, for rows without one.

    Raises:
        TelemetryError: the log has no outdoor_temperature or no air_temperature.
    """
    table = to_grid(telemetry, int(step))
    count = len(table)
    usable = np.ones(count, dtype=bool)
    longest = max(1, round(LONGEST_FILL / step))
    inputs: dict[str, Floats] = {}
    missing: list[str] = []
    outdoor, bridged = bridge(table["outdoor_temperature"], longest, smooth=True)
    inputs["outdoor_temperature"] = outdoor
    usable &= bridged
    if _present(table, "sky_temperature"):
        inputs["sky_temperature"], bridged = bridge(table["sky_temperature"], longest, smooth=True)
        usable &= bridged
    else:
        inputs["sky_temperature"] = outdoor - _SKY_BELOW_AIR
        missing.append("sky_temperature")
    for name, stand_in in _ABSENT.items():
        if _present(table, name):
            inputs[name], bridged = bridge(table[name], longest, smooth=name in _MEANS)
            usable &= bridged
        else:
            inputs[name] = np.full(count, stand_in)
            missing.append(name)
    for name, switch in SWITCHES.items():
        if name in missing and _present(table, switch):
            inputs[switch] = bridge(table[switch], longest, smooth=False)[0]
    if _present(table, "leaf_area_index"):
        inputs["leaf_area_index"] = bridge(table["leaf_area_index"], count, smooth=True)[0]
    else:
        inputs["leaf_area_index"] = np.full(count, leaf_area_index)
        missing.append("leaf_area_index")
    for name in _MEANS:
        values = inputs[name]
        inputs[name] = np.append(0.5 * (values[1:] + values[:-1]), values[-1:])
    inputs["mean_height"] = np.full(count, mean_height)
    middle = sun.unix_seconds(table.time) + 0.5 * step
    elevation, azimuth, hour = sun.position(np, middle, latitude, longitude)
    inputs |= {"sun_elevation": elevation, "sun_azimuth": azimuth, "hour": hour, "elapsed_days": np.zeros(count)}
    nothing = np.full(count, np.nan)
    measured = {name: np.array(table.columns.get(name, nothing)) for name in measurement.PREDICTED}
    measured["air_temperature"] = np.array(table["air_temperature"])
    return Record(table.time, float(step), inputs, measured, usable, tuple(missing), lamp_efficacy).since(None)


def _present(table: Telemetry, name: str) -> bool:
    return name in table and bool(np.isfinite(table[name]).any())
