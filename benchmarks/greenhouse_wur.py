"""The mechanistic greenhouse against the virtual seasons of Wageningen's simulator (Cao et al. 2022).

Both get the same weather and the same setpoints. What the two greenhouses are made of is told by the data (lamps,
pipes, light, CO2 capacity, settings); a few parameters that it does not tell are fitted to 24 h free runs of ten
seasons, and the errors are those of the other thirty.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, Sensors, climate_state, tomato
from igrow.core.greenhouse.climate_computer import ClimateComputer
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.telemetry import Telemetry
from igrow.trainer.research.paper.wur2020 import Seasons, read_seasons

HOUR = 3600
CLIMATE = ("air_temperature", "air_humidity", "air_co2")
UNITS = {"air_temperature": "K", "air_humidity": "%", "air_co2": "ppm"}
WEATHER = ("outdoor_temperature", "outdoor_humidity", "global_radiation", "wind_speed", "sky_temperature")
SETPOINTS = ("heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on")
QUIET, EXACT = Disturbances(heat=0.0, vapour=0.0, co2=0.0), Sensors({})

GIVEN: Mapping[str, float] = {
    "lamp_capacity": 129.37,
    "lamp_photons": 1.45,
    "cover_transmission": 0.53,
    "rail_exchange": 2.17,
    "grow_exchange": 0.64,
    "boiler_capacity": 400.0,
    "co2_capacity": 0.0144,
    "fruits_per_truss": 17.0,
    "stem_density": 3.9,
}
"""What the data tell: lamp power and its light at night, light by day per radiation, heat per pipe excess, dosing."""

SETTINGS = ClimateComputer(
    heating_ramp=12.0, rail_maximum=55.0, grow_maximum=48.0, ventilation_minimum=0.1, humidity_start=101.0,
    lamp_radiation_limit=1e6, screen_under_lamps=0.0, co2_needs_light=0.0, co2_vent_stop=10.0, wind_limit=1e3,
)  # fmt: skip
"""Settings of that simulator's control as its columns show them: vents never below a tenth, screens open under lamps,
CO2 dosed day and night; the lamps' radiation limit is a column and enters the schedule."""

FITTED: Mapping[str, tuple[float, float]] = {
    "leakage": (1e-5, 3e-3),
    "vent_area": (0.02, 0.5),
    "cover_area": (0.9, 3.0),
    "equipment_capacity": (2e3, 2e5),
    "minimum_stomatal_resistance": (20.0, 400.0),
    "electron_transport": (60.0, 400.0),
    "floor_wetness": (1e-3, 1.0),
    "energy_screen_permeability": (1e-5, 3e-3),
    "construction_absorption": (0.01, 0.5),
    "soil_conductivity": (0.2, 4.0),
}
"""Fitted parameters with their bounds; the start is the default of `GreenhouseParameters`."""

CALIBRATED: Mapping[str, float] = {
    "leakage": 0.0008339,
    "vent_area": 0.05099,
    "cover_area": 1.557,
    "equipment_capacity": 5.91e4,
    "minimum_stomatal_resistance": 98.63,
    "electron_transport": 225.1,
    "floor_wetness": 0.1486,
    "energy_screen_permeability": 0.001506,
    "construction_absorption": 0.01,
    "soil_conductivity": 1.906,
}
"""Printed by `python -m benchmarks.greenhouse calibrate DATA`."""


@dataclass(frozen=True)
class Days:
    """Days of seasons, side by side: K runs of 24 hours."""

    weather: WeatherTable
    setpoints: Mapping[str, Floats]
    """(24, K): row h holds from hour h to h + 1."""
    start: Mapping[str, Floats]
    """(K,) climate and leaf area at the beginning."""
    floor: Floats
    soil: Floats
    truth: Mapping[str, Floats]
    """(24, K): means over the hour before, and daily totals (K,) as heat, electricity, co2."""
    yesterday: Mapping[str, Floats]


def load(data: Path) -> Seasons:
    """Read the forty seasons in `data`/wur2020 (or the file's own folder)."""
    folder = data / "wur2020"
    return read_seasons(folder if folder.is_dir() else data)


def split(seasons: Seasons) -> tuple[list[int], list[int]]:
    """Return rows of the ten seasons to fit and of those to report, by name."""
    order = sorted(range(len(seasons.names)), key=lambda row: seasons.names[row])
    return order[:10], order[10:]


def requested(seasons: Seasons, row: int) -> dict[str, Floats]:
    """Return the setpoints of one season, (hours,), lamps put off above the radiation limit of the hour."""
    values = {name: seasons.columns[name][row] for name in SETPOINTS}
    dim = seasons.columns["global_radiation"][row] < seasons.columns["lamp_radiation_limit"][row]
    return values | {"lamp_on": values["lamp_on"] * dim}


def cut_days(seasons: Seasons, rows: Sequence[int], every: int) -> Days:
    """Return every `every`-th valid day of the seasons `rows`, each from its first hour."""
    first_hour = int((24 - seasons.hour[0]) % 24)
    hours = len(seasons.time)
    starts = [hour for hour in range(first_hour + 24, hours - 25, 24 * every) if seasons.valid[hour : hour + 25].all()]
    tables, index = [], []
    for day, hour in enumerate(starts):
        # An hourly row is the mean of the hour before it, so it belongs half an hour back.
        span = slice(hour - 1, hour + 26)
        count = len(seasons.time[span])
        time = (np.arange(count) - 1) * HOUR - HOUR // 2
        tables.append(
            Telemetry(
                time.astype("datetime64[s]"),
                {name: seasons.columns[name][rows[0]][span] for name in WEATHER}
                | {"outdoor_co2": np.full(count, 444.0)},
            )
        )
        index += [day] * len(rows)
    weather = WeatherTable(tables)
    weather.rows = weather.rows[:, :, index]
    picks = [(row, hour) for hour in starts for row in rows]

    def window(name: str, offset: int, length: int) -> Floats:
        return np.stack([seasons.columns[name][row][hour + offset : hour + offset + length] for row, hour in picks], 1)

    setpoints = [requested(seasons, row) for row in range(len(seasons.names))]
    heat = window("rail_pipe_heat", 1, 24) + window("grow_pipe_heat", 1, 24)
    return Days(
        weather=weather,
        setpoints={
            name: np.stack([setpoints[row][name][hour : hour + 24] for row, hour in picks], 1) for name in SETPOINTS
        },
        start={name: window(name, 0, 1)[0] for name in (*CLIMATE, "leaf_area_index", "heating_setpoint_realised")},
        floor=window("air_temperature", -12, 12).mean(axis=0),
        soil=window("air_temperature", -24, 24).mean(axis=0),
        truth={name: window(name, 1, 24) for name in CLIMATE}
        | {
            "heat": heat.sum(axis=0) * HOUR / 1e6,
            "electricity": window("lamp_power", 1, 24).sum(axis=0) / 1e3,
            "co2": window("co2_dosing", 1, 24).sum(axis=0) * HOUR,
        },
        yesterday={name: window(name, -23, 24) for name in CLIMATE},
    )


def free_run(days: Days, parameters: GreenhouseParameters, copies: int = 1) -> dict[str, Floats]:
    """Run all days at once; returns hourly means (24, K) of the climate and daily totals (K,).

    With `copies`, K is that many times the number of days, and `parameters` hold arrays of that length.
    """

    def spread(values: Floats) -> Floats:
        return np.tile(values, copies)

    table = WeatherTable.__new__(WeatherTable)
    table.start, table.end = days.weather.start, days.weather.end
    table.rows = np.tile(days.weather.rows, (1, 1, copies))
    start = {name: spread(values) for name, values in days.start.items()}
    count = len(start["air_temperature"])
    outdoor = table.at(0.0).outdoor_temperature
    rest = climate_state.initial(np, start["air_temperature"], start["air_humidity"], start["air_co2"], outdoor)
    state = rest._replace(
        floor=spread(days.floor), soil_1=spread(days.soil), soil_2=spread(days.soil), soil_3=spread(days.soil)
    )
    crop = tomato.mature_crop(parameters, np.ones(count), start["leaf_area_index"])
    plant = Plant(
        parameters, table, 0.0, count=count, crop=crop, initial=state, computer=SETTINGS, disturbances=QUIET,
        sensors=EXACT,
    )  # fmt: skip
    plant.state.control = plant.state.control._replace(heating_setpoint=start["heating_setpoint_realised"])
    result: dict[str, Floats] = {name: np.empty((24, count)) for name in CLIMATE}
    setpoints = {name: np.tile(values, (1, copies)) for name, values in days.setpoints.items()}
    for hour in range(24):
        command = {name: values[hour] for name, values in setpoints.items()}
        sums = {name: np.zeros(count) for name in CLIMATE}
        for _ in range(6):
            plant.advance(600.0, command)
            truth = plant.truth(command)
            for name in CLIMATE:
                sums[name] += truth[name] / 6.0
        for name in CLIMATE:
            result[name][hour] = sums[name]
    totals = plant.state.totals
    return result | {
        "heat": totals["boiler_in"] / 1e6,
        "electricity": totals["electricity"] / 3.6e6,
        "co2": totals["co2_dosed"],
    }


def parameters_of(values: Mapping[str, Any]) -> GreenhouseParameters:
    """Return the given parameters with the fitted ones."""
    return replace(GreenhouseParameters(latitude=52.0, longitude=4.5), **{**GIVEN, **values})


SEASON_STEP = 120.0
"""Step of climate and control in whole seasons, s: half the cost, and no total moves by it."""
SCALE = {"air_temperature": 1.0, "air_humidity": 5.0, "air_co2": 80.0}


def residual_rows(days: Days, thetas: Sequence[Floats]) -> Floats:
    """Return the residuals of several sets of log-parameters, (sets, residuals), from one batch."""
    length = len(days.floor)
    columns = {
        name: np.repeat([np.exp(theta[position]) for theta in thetas], length) for position, name in enumerate(FITTED)
    }
    run = free_run(days, parameters_of(columns), copies=len(thetas))
    rows = []
    for copy in range(len(thetas)):
        part = slice(copy * length, (copy + 1) * length)
        pieces = [(run[name][:, part] - days.truth[name]).ravel() / SCALE[name] / np.sqrt(24.0) for name in CLIMATE]
        pieces.append((run["heat"][part] - days.truth["heat"]) / 2.0)
        pieces.append((run["co2"][part] - days.truth["co2"]) / 0.1)
        joined = np.concatenate(pieces)
        # Beyond 2 a residual counts by its size only: single odd days must not lead.
        size = np.abs(joined)
        bounded = np.where(size > 2.0, np.sqrt(np.maximum(4.0 * size - 4.0, 0.0)), size)
        rows.append(np.sign(joined) * bounded)
    return np.stack(rows)


def calibrate(data: Path, rounds: int = 7) -> dict[str, float]:
    """Fit the parameters to every eighth day of the ten seasons by damped Gauss-Newton steps in their logarithms."""
    seasons = load(data)
    days = cut_days(seasons, split(seasons)[0], every=8)
    low, high = (np.log([bounds[side] for bounds in FITTED.values()]) for side in (0, 1))
    defaults = parameters_of({})
    theta = np.log([CALIBRATED.get(name, getattr(defaults, name)) for name in FITTED])
    damping, step = 1.0, 0.02
    best = residual_rows(days, [theta])[0]
    for number in range(rounds):
        moved = residual_rows(days, [theta + step * one for one in np.eye(len(theta))])
        jacobian = (moved - best).T / step
        normal, slope = jacobian.T @ jacobian, jacobian.T @ best
        tries = [
            np.clip(theta - np.linalg.solve(normal + factor * damping * np.diag(np.diag(normal)), slope), low, high)
            for factor in (0.03, 0.3, 3.0)
        ]
        results = residual_rows(days, tries)
        winner = int(np.argmin((results**2).sum(axis=1)))
        if (results[winner] ** 2).sum() < (best**2).sum():
            theta, best = tries[winner], results[winner]
            damping *= (0.1, 1.0, 3.0)[winner]
        else:
            damping *= 10.0
        print(f"round {number + 1}: loss {np.mean(best**2):.4f}", flush=True)
    return {name: float(np.exp(value)) for name, value in zip(FITTED, theta, strict=True)}


def table(data: Path) -> list[str]:
    """Return the lines of the report on the thirty seasons that were not fitted."""
    seasons = load(data)
    rows = split(seasons)[1]
    days = cut_days(seasons, rows, every=2)
    lines = [f"24 h free runs on {len(days.floor)} days of {len(rows)} seasons not fitted, hourly, mean absolute error"]
    lines.append(f"{'quantity':18s} {'defaults':>10s} {'calibrated':>11s} {'persistence':>12s} {'bias':>8s}  unit")
    plain, fitted = free_run(days, parameters_of({})), free_run(days, parameters_of(CALIBRATED))
    for name in CLIMATE:
        truth = days.truth[name]
        errors = [float(np.abs(run[name] - truth).mean()) for run in (plain, fitted)]
        held = float(np.abs(days.yesterday[name] - truth).mean())
        bias = float((fitted[name] - truth).mean())
        lines.append(f"{name:18s} {errors[0]:10.2f} {errors[1]:11.2f} {held:12.2f} {bias:8.2f}  {UNITS[name]}")
    for name, unit in (("heat", "MJ m-2"), ("electricity", "kWh m-2"), ("co2", "kg m-2")):
        truth = days.truth[name]
        off = np.abs(fitted[name] - truth) / np.maximum(truth, 1e-9)
        lines.append(
            f"{name:18s} mean of a day {fitted[name].mean():8.3f}, Wageningen {truth.mean():8.3f} {unit}; "
            f"median day off by {100.0 * float(np.median(off)):.0f} %"
        )
    return lines + season_table(seasons, rows)


def season_table(seasons: Seasons, rows: Sequence[int]) -> list[str]:
    """Return the lines on whole seasons from planting: totals of resources and yield."""
    hours = len(seasons.time)
    weather = Telemetry(
        (np.arange(hours) * HOUR - HOUR // 2).astype("datetime64[s]"),
        {name: seasons.columns[name][rows[0]] for name in WEATHER} | {"outdoor_co2": np.full(hours, 444.0)},
    )
    start = HOUR
    parameters = parameters_of(CALIBRATED)
    count = len(rows)
    plant = Plant(
        stack([parameters]), WeatherTable(weather), float(start), count=count, crop="young", computer=SETTINGS,
        disturbances=QUIET, sensors=EXACT, tick=SEASON_STEP, scan=SEASON_STEP,
    )  # fmt: skip
    setpoints = [requested(seasons, row) for row in rows]
    for hour in range(1, hours - 2):
        plant.advance(HOUR, {name: np.array([one[name][hour] for one in setpoints]) for name in SETPOINTS})
    totals, values = plant.state.totals, plant.truth({})
    true = {
        "heat": sum(seasons.columns[name][rows].sum(axis=1) for name in ("rail_pipe_heat", "grow_pipe_heat"))
        * HOUR
        / 1e6,
        "electricity": seasons.columns["lamp_power"][rows].sum(axis=1) / 1e3,
        "co2": seasons.columns["co2_dosing"][rows].sum(axis=1) * HOUR,
        "yield": seasons.columns["fruit_fresh_weight"][rows][:, -1],
        "growth": seasons.columns["net_growth"][rows][:, -1],
    }
    ours = {
        "heat": totals["boiler_in"] / 1e6,
        "electricity": totals["electricity"] / 3.6e6,
        "co2": totals["co2_dosed"],
        "yield": values["fruit_fresh_weight"],
        "growth": values["net_growth"],
    }
    lines = [f"whole seasons of {hours} h from planting, {count} seasons, mean (least to most)"]
    for name, unit in (
        ("heat", "MJ m-2"), ("electricity", "kWh m-2"), ("co2", "kg m-2"), ("growth", "kg m-2 dry"),
        ("yield", "kg m-2"),
    ):  # fmt: skip
        a, b = ours[name], true[name]
        order = float(np.corrcoef(np.argsort(np.argsort(a)), np.argsort(np.argsort(b)))[0, 1])
        lines.append(
            f"{name:12s} ours {a.mean():8.2f} ({a.min():.2f} to {a.max():.2f}), Wageningen {b.mean():8.2f} "
            f"({b.min():.2f} to {b.max():.2f}) {unit}; rank correlation {order:.2f}"
        )
    return lines
