"""Training of all three network stages on seasons of equal length, with layouts that suit hourly logs."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from igrow.core.arrays import Floats, Mask
from igrow.core.simulator.network import HOURS, LightFormula, NetworkSimulator, Stage
from igrow.core.simulator.network_run import daily_drivers, day_ends
from igrow.trainer.fleet.calls import call_each
from igrow.trainer.progress import Progress, silent
from igrow.trainer.research.network.ensemble import merge
from igrow.trainer.research.network.leaf_picking import fit_picking, followed, picked_area
from igrow.trainer.training.stage import StageData, StageLayout, TrainingPlan, train_stage, untrained

CLIMATE_DRIVERS = (
    "global_radiation", "outdoor_temperature", "outdoor_humidity", "wind_speed", "sky_temperature",
    "heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on", "leaf_area_index",
)  # fmt: skip
GROWTH_DRIVERS = ("air_temperature", "air_co2", "par", "crop_age", "thermal_time")
HARVEST_DRIVERS = (
    "air_temperature", "leaf_area_index", "plant_load", "net_growth", "crop_age", "thermal_time",
)  # fmt: skip

CLIMATE = StageLayout(
    "climate", ("air_temperature", "air_humidity", "air_co2"), CLIMATE_DRIVERS, (1.0, 3.0, 24.0), (128, 128), clock=True
)
# Net growth falls in dark hours, when the crop respires more than it assimilates: it is not cumulative here.
GROWTH = StageLayout(
    "growth", ("leaf_area_index", "plant_load", "net_growth"), GROWTH_DRIVERS, (24.0, 240.0, 720.0), (64, 64)
)
HARVEST = StageLayout("harvest", ("fruit_fresh_weight",), HARVEST_DRIVERS, (5.0, 20.0), (32, 32), step=24.0)

CLIMATE_PLAN = TrainingPlan(updates=((4, 10000), (16, 5000), (48, 1500)))
GROWTH_PLAN = TrainingPlan(updates=((4, 4000), (24, 2000), (120, 600)), decay=0.3)
HARVEST_PLAN = TrainingPlan(updates=((4, 1000), (30, 600)), batch=128)


@dataclass(frozen=True)
class Layouts:
    """The three stages before training, and how each is trained."""

    climate: StageLayout = CLIMATE
    growth: StageLayout = GROWTH
    harvest: StageLayout = HARVEST
    climate_plan: TrainingPlan = CLIMATE_PLAN
    growth_plan: TrainingPlan = GROWTH_PLAN
    harvest_plan: TrainingPlan = HARVEST_PLAN
    members: int = 1
    """Networks per stage, merged into one; see `igrow.trainer.research.network.ensemble`."""


def derived(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the columns (runs, hours) with `crop_age` (days) and `thermal_time` (degC d) since the first hour."""
    temperature = columns["air_temperature"]
    age = np.broadcast_to(np.arange(temperature.shape[1]) / HOURS, temperature.shape)
    thermal = np.cumsum(temperature, axis=1) / HOURS
    return {**columns, "crop_age": age, "thermal_time": thermal - thermal[:, :1]}


def hourly_data(stage: StageLayout | Stage, columns: Mapping[str, Floats], hour: Floats, valid: Mask) -> StageData:
    """Return the data of an hourly stage; leaf area acts with its value at the start of the hour.

    `columns` (runs, hours) as from `derived`; `valid` (hours,) or (runs, hours).
    """
    drivers = []
    for name in stage.drivers:
        values = columns[name]
        if name == "leaf_area_index":
            values = np.concatenate([values[:, :1], values[:, :-1]], axis=1)
        drivers.append(values)
    states = np.stack([columns[name] for name in stage.states], axis=-1)
    jumps = None
    if "leaf_area_index" in stage.states:
        jumps = np.zeros_like(states)
        jumps[..., stage.states.index("leaf_area_index")] = -picked_area(columns["leaf_area_index"])
    known = np.broadcast_to(valid, states.shape[:2]).copy()
    return StageData(np.stack(drivers, axis=-1), states, hour, known, jumps=jumps)


def daily_data(stage: StageLayout | Stage, columns: Mapping[str, Floats]) -> StageData:
    """Return the data of the daily stage: the day's mean of drivers, the states at its end.

    A day is 24 rows. The first row of the result stands for the moment before the first day.
    """
    drivers = daily_drivers(stage.drivers, columns)
    ends = day_ends(columns[stage.states[0]].shape[1])
    states = np.stack([columns[name] for name in stage.states], axis=-1)
    states = np.concatenate([states[:, :1], states[:, ends]], axis=1)
    drivers = np.concatenate([drivers[:, :1], drivers], axis=1)
    shape = states.shape[:2]
    return StageData(drivers, states, np.zeros(shape[1]), np.ones(shape, dtype=bool))


def fit_light(columns: Mapping[str, Floats]) -> LightFormula:
    """Fit par (umol m-2 s-1) by least squares as a linear function of radiation and lamps over all hours."""
    radiation, lamp = columns["global_radiation"].ravel(), columns["lamp_on"].ravel()
    matrix = np.stack([radiation, lamp, np.ones_like(lamp)], axis=-1)
    solution, *_ = np.linalg.lstsq(matrix, columns["par"].ravel(), rcond=None)
    return LightFormula(float(solution[0]), float(solution[1]), float(solution[2]))


def train_simulator(
    columns: Mapping[str, Floats],
    hour: Floats,
    valid: Mask,
    layouts: Layouts | None = None,
    seed: int = 0,
    progress: Progress = silent,
    workers: int = 1,
) -> NetworkSimulator:
    """Train the three stages on seasons of equal length.

    Args:
        columns: name -> (runs, hours): weather, setpoints, climate, growth and `fruit_fresh_weight` without gaps.
        hour: (hours,) hour of the day.
        valid: (hours,) or (runs, hours); the others are not learned from.
        layouts: of the stages; None: `Layouts`.
        seed: of weights and windows.
        progress: is told what is being done, in lines.
        workers: processes that train members side by side; the result does not depend on it.
    """
    chosen = layouts or Layouts()
    light = fit_light(columns)
    # Growth learns from the light that it will be given in a free run.
    formula = light.par(np, columns["global_radiation"], columns["lamp_on"])
    full = derived({**columns, "par": formula})
    crop = {**full, "leaf_area_index": followed(full["leaf_area_index"])}
    stages = (
        (chosen.climate, hourly_data(chosen.climate, full, hour, valid), chosen.climate_plan),
        (chosen.growth, hourly_data(chosen.growth, crop, hour, valid), chosen.growth_plan),
        (chosen.harvest, daily_data(chosen.harvest, crop), chosen.harvest_plan),
    )
    tasks = [
        (untrained(stage, data, seed + member), data, replace(plan, seed=seed + member))
        for stage, data, plan in stages
        for member in range(chosen.members)
    ]
    if workers > 1:
        trained = []
        with tempfile.TemporaryDirectory() as folder:
            for stage in call_each(_train_alone, tasks, Path(folder), workers=workers):
                trained.append(stage)
                progress(f"{len(trained)} of {len(tasks)} networks trained")
    else:
        trained = [train_stage(*task, progress) for task in tasks]
    climate, growth, harvest = (
        merge(trained[first : first + chosen.members]) for first in range(0, len(tasks), chosen.members)
    )
    picking = fit_picking(full["leaf_area_index"], full["thermal_time"], hour)
    return NetworkSimulator(climate, growth, harvest, light, picking)


def _train_alone(task: tuple[Stage, StageData, TrainingPlan]) -> Stage:
    """Train in a process that shares its machine with others."""
    torch.set_num_threads(1)
    return train_stage(*task)
