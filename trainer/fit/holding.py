"""Fits how a PLC holds its setpoints (`igrow.core.simulator.holding`) to a log: plain robust statistics."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.simulator.holding import PARAMETERS
from igrow.core.simulator.hybrid.record import Record

_ENOUGH = 100
"""Rows that a statistic needs; with fewer the known value stays."""


def fit_holding(
    record: Record, setpoints: Mapping[str, Floats], physical: Mapping[str, float], known: Mapping[str, float]
) -> dict[str, float]:
    """Return the holding parameters by name.

    Args:
        record: the log.
        setpoints: on its grid, (n,) each.
        physical: parameters of the climate stage.
        known: what holds where the log says nothing.
    """
    values = dict(known)
    air = record.measured["air_temperature"]
    rail = np.maximum(record.inputs["rail_pipe_temperature"] - air, 0.0)
    grow = np.maximum(record.inputs["grow_pipe_temperature"] - air, 0.0)
    heat = physical["rail_pipe_heat_transfer"] * rail + physical["grow_pipe_heat_transfer"] * grow
    above = air - setpoints["heating_setpoint"]
    fine = record.usable & np.isfinite(above) & np.isfinite(heat)
    if "rail_pipe_temperature" not in record.missing and fine.sum() > _ENOUGH:
        largest = float(np.quantile(heat[fine], 0.998))
        heating = fine & (heat > 0.15 * largest) & (heat < 0.9 * largest)
        idle = fine & (above > 1.5)
        if heating.sum() > _ENOUGH:
            values["heating_offset"] = float(np.median(above[heating]))
            values["grow_share"] = float(np.sum(grow[heating]) / max(float(np.sum(rail[heating])), 1e-9))
        if idle.sum() > _ENOUGH:
            # Pipes that still cool down after a setpoint fell are no minimum.
            values["heating_minimum"] = float(np.quantile(heat[idle], 0.1))
        values["heating_capacity"] = max(largest, values["heating_minimum"] + 5.0)
    ppm, dose = record.measured["air_co2"], record.inputs["co2_dosing"]
    fine = record.usable & np.isfinite(ppm)
    if "co2_dosing" not in record.missing and fine.sum() > _ENOUGH and (dose[fine] > 0.0).any():
        largest = float(np.quantile(dose[fine & (dose > 0.0)], 0.99))
        dosing = fine & (dose > 0.05 * largest) & (dose < 0.8 * largest)
        if dosing.sum() > _ENOUGH:
            values["co2_offset"] = float(np.median((ppm - setpoints["co2_setpoint"])[dosing]))
        values["co2_capacity"] = largest
    return {name: float(np.clip(value, PARAMETERS[name].low, PARAMETERS[name].high)) for name, value in values.items()}
