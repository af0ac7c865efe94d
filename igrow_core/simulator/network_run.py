"""Free runs of the network simulator in numpy, hour by hour: many seasons side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from igrow_core.simulator.network import HOURS, NetworkSimulator, Stage, advance, initial_memory

Values = NDArray[np.float64]


def day_ends(hours: int) -> NDArray[np.int64]:
    """Return the last row of each day of 24 rows, the last day cut where the run ends."""
    return np.minimum(np.arange(HOURS, hours + HOURS, HOURS), hours) - 1


def free_run(simulator: NetworkSimulator, known: Mapping[str, Values], hour: Values) -> dict[str, Values]:
    """Run whole seasons from their first hour on nothing but weather and setpoints.

    Parameters
    ----------
    known
        Name -> (runs, hours): every driver of the climate stage but the leaf area, over all hours, and the first
        hour of every state (later hours of a state are not read).
    hour
        (hours,) hour of the day.

    Returns
    -------
    Name -> (runs, hours) of every state, of par and of thermal_time (degC d since the first hour). The harvest
    stage runs by days of 24 rows; within a day its value is the one at the end of the day before.
    """
    climate, growth = simulator.climate, simulator.growth
    light = simulator.light.par(np, known["global_radiation"], known["lamp_on"])
    runs, hours = light.shape
    result = {name: np.empty((runs, hours)) for name in (*climate.states, *growth.states)}
    result |= {
        "par": light,
        "thermal_time": np.zeros((runs, hours)),
        "crop_age": np.tile(np.arange(hours) / HOURS, (runs, 1)),
    }
    for name in (*climate.states, *growth.states):
        result[name][:, 0] = known[name][:, 0]

    def at(stage: Stage, row: int) -> NDArray[np.float32]:
        values = []
        for name in stage.drivers:
            if name == "leaf_area_index":
                values.append(result[name][:, max(row - 1, 0)])
            else:
                values.append((result if name in result else known)[name][:, row])
        return np.stack(values, axis=-1).astype(np.float32)

    def state_of(stage: Stage) -> NDArray[np.float32]:
        return np.stack([result[name][:, 0] for name in stage.states], axis=-1).astype(np.float32)

    climate_state, growth_state = state_of(climate), state_of(growth)
    climate_memory = initial_memory(np, climate, at(climate, 0))
    growth_memory = initial_memory(np, growth, at(growth, 0))
    for row in range(1, hours):
        now = np.full((runs, 1), hour[row], dtype=np.float32)
        climate_state, climate_memory = advance(np, climate, climate_state, at(climate, row), climate_memory, now)
        for index, name in enumerate(climate.states):
            result[name][:, row] = climate_state[:, index]
        result["thermal_time"][:, row] = result["thermal_time"][:, row - 1] + result["air_temperature"][:, row] / HOURS
        growth_state, growth_memory = advance(np, growth, growth_state, at(growth, row), growth_memory, now)
        for index, name in enumerate(growth.states):
            result[name][:, row] = growth_state[:, index]
    result |= _harvest(simulator.harvest, result, known)
    return result


def daily_drivers(names: Sequence[str], columns: Mapping[str, Values]) -> Values:
    """Return the mean of each named column (runs, hours) over each day of 24 rows, (runs, days, n)."""
    hours = columns[names[0]].shape[1]
    ends = day_ends(hours)
    starts = np.concatenate([[0], ends[:-1] + 1])
    means = [np.add.reduceat(columns[name], starts, axis=1) / (ends - starts + 1) for name in names]
    return np.stack(means, axis=-1)


def _harvest(stage: Stage, result: Mapping[str, Values], known: Mapping[str, Values]) -> dict[str, Values]:
    drivers = daily_drivers(stage.drivers, result).astype(np.float32)
    state = np.stack([known[name][:, 0] for name in stage.states], axis=-1).astype(np.float32)
    memory = initial_memory(np, stage, drivers[:, 0])
    states = []
    for day in range(drivers.shape[1]):
        state, memory = advance(np, stage, state, drivers[:, day], memory)
        states.append(state)
    hours = result["par"].shape[1]
    ends = day_ends(hours)
    return {name: _held(np.stack(states, axis=1)[..., index], known[name][:, 0], ends, hours)
            for index, name in enumerate(stage.states)}  # fmt: skip


def _held(values: Values, first: Values, ends: NDArray[np.int64], hours: int) -> Values:
    day = np.searchsorted(ends, np.arange(hours), side="left")
    at_end = np.arange(hours) == ends[day]
    before = np.concatenate([first[:, None], values], axis=1)[:, day]
    return np.where(at_end, values[:, day], before).astype(np.float64)
