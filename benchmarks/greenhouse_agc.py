"""Is the mechanistic greenhouse plausible? A free run from the setpoints and the weather of a measured season.

The Autonomous Greenhouse Challenge's Reference compartment: its setpoints and its weather drive the plant with its
own climate computer and the default parameters, nothing is fitted, and no measured climate enters after the
first hour.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from igrow.core.greenhouse import GreenhouseParameters, simulate
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import read_log

LAMP_CAPACITY = 142.5
"""Sodium lamps and diodes at full power, W m-2."""
LAMP_PHOTONS = 197.0 / LAMP_CAPACITY
"""umol J-1 (challenge economics)."""
SHOWN = ("air_temperature", "air_humidity", "air_co2", "vent_lee", "rail_pipe_temperature")


def table(data: Path) -> list[str]:
    """Return the lines of the report."""
    folder = data / "agc2019"
    log = read_log(folder if folder.is_dir() else data, compartment="Reference")
    measured = log.telemetry
    lamp = np.nan_to_num(measured["lamp_power"]) / LAMP_CAPACITY
    setpoints = Telemetry(
        measured.time,
        {
            "heating_setpoint": measured["heating_setpoint"],
            "co2_setpoint": measured["co2_setpoint"],
            "lamp_on": np.minimum(lamp, 1.0),
            # The plant's irrigation_on permits pulses, the log's counts them.
            "irrigation_on": np.ones(len(measured)),
        },
    )
    parameters = GreenhouseParameters(lamp_capacity=LAMP_CAPACITY, lamp_photons=LAMP_PHOTONS)
    season = simulate(
        parameters, measured, setpoints, measured.time[0], measured.time[-1], seed=0, disturbances=QUIET,
        sensors=EXACT, crop="young",
    )  # fmt: skip
    ours, truth = to_grid(season.true, 3600), to_grid(measured, 3600)
    lines = [f"free run of {len(measured) / 288:.0f} days from setpoints and weather, defaults, hourly"]
    lines.append(f"{'quantity':24s} {'ours':>8s} {'measured':>9s} {'error':>7s}   (means, mean absolute error)")
    common = min(len(ours), len(truth))
    for name in (*SHOWN, "vent_wind", "energy_screen", "blackout_screen", "grow_pipe_temperature"):
        a, b = ours[name][:common], truth[name][:common]
        lines.append(f"{name:24s} {np.nanmean(a):8.1f} {np.nanmean(b):9.1f} {np.nanmean(np.abs(a - b)):7.2f}")
    if log.resources is not None:
        last = measured.time[-1]
        chosen = log.resources.day < last
        columns = log.resources.columns
        electricity = columns["electricity_peak"] + columns["electricity_off_peak"]
        for name, values, unit in (
            ("heat", columns["heat"], "MJ m-2"),
            ("electricity", electricity, "kWh m-2"),
            ("co2", columns["co2"], "kg m-2"),
        ):
            total = float(np.nansum(values[chosen]))
            lines.append(f"{name:24s} {season.total(name):8.1f} {total:9.1f} {unit} to the end of the climate log")
    harvest = log.harvests
    if harvest is not None:
        total = float(sum(np.nansum(values[harvest.day < measured.time[-1]]) for values in harvest.columns.values()))
        lines.append(f"{'fruit_fresh_weight':24s} {season.true['fruit_fresh_weight'][-1]:8.1f} {total:9.1f} kg m-2")
    lines.append("mean day, every third hour (UTC)")
    hour = (ours.time[:common] - ours.time[:common].astype("datetime64[D]")) / np.timedelta64(1, "h")
    for name in SHOWN:
        for label, values in (("ours", ours[name][:common]), ("measured", truth[name][:common])):
            lines.append(f"{name:24s} {label:8s} " + " ".join(f"{value:7.1f}" for value in _day(values, hour)))
    return lines


def _day(values: NDArray[np.float64], hour: NDArray[np.float64]) -> list[float]:
    return [float(np.nanmean(values[(hour >= start) & (hour < start + 3)])) for start in range(0, 24, 3)]
