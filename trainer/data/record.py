"""From a log on its grid to the record that calibration and diagnosis run the simulator along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.core import gaps
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data.alignment import read_ahead
from igrow.trainer.data.grid import working_step

_WEATHER = ("outdoor_temperature", "outdoor_humidity", "global_radiation", "wind_speed", "sky_temperature", "rain")


def grid_record(telemetry: Telemetry, site: Site, shift: float = 0.0) -> Record:
    """Return the record of a log: inputs as means over each working step, measurements as at its first instant.

    Where a greenhouse doses CO2 and the log does not tell how much, its CO2 tells nothing: it is left out.

    Args:
        telemetry: on a regular grid (`igrow.trainer.data.grid.on_grid`).
        site: its description.
        shift: rows of the log by which its actuators are read ahead (`igrow.trainer.data.alignment`).

    Raises:
        TelemetryError: the log has no outdoor_temperature or no air_temperature.
    """
    telemetry = read_ahead(telemetry, shift)
    fine = telemetry.step
    step = working_step(fine)
    record = site_record(telemetry, site, step)
    if "co2_dosing" in record.missing:
        telemetry = telemetry.with_columns({"air_co2": np.full(len(telemetry), np.nan)})
        record = replace(record, measured={**record.measured, "air_co2": np.full(len(record), np.nan)})
    if fine >= step:
        return record
    grid = to_grid(telemetry, int(step))
    inputs = dict(record.inputs)
    for name in _WEATHER:
        if name in grid and np.isfinite(grid[name]).any():
            inputs[name] = gaps.interpolated(grid[name])
    # The reading on each cell's edge.
    position = np.searchsorted(telemetry.time, record.time)
    inside = np.minimum(position, len(telemetry) - 1)
    there = telemetry.time[inside] == record.time
    measured = {
        name: np.where(there, telemetry[name][inside], np.nan) if name in telemetry else values
        for name, values in record.measured.items()
    }
    return replace(record, inputs=inputs, measured=measured)
