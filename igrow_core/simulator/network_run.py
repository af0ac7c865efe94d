"""Free runs of the network simulator: an hour of climate and growth, a day's harvest, whole seasons side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array, Floats, Integers
from igrow.core.simulator.leaf_picking import pick
from igrow.core.simulator.network import HOURS, NetworkSimulator, Stage, advance, initial_memory


@dataclass(frozen=True)
class Carried:
    """What one step of a run hands to the next; float32, `...` is the batch."""

    climate: Array
    """(..., s) in the order of the stage's states, as are `growth` and `harvest`."""
    climate_memory: Array
    """(..., m) filters of the climate's drivers, as are the other memories of theirs."""
    growth: Array
    growth_memory: Array
    harvest: Array
    harvest_memory: Array
    thermal_time: Array
    """(..., 1) degC d since the first hour."""
    crop_age: Array
    """(..., 1) days since the first hour."""
    pickings: Array
    """(..., 1) how often leaves were picked."""


def known_inputs(simulator: NetworkSimulator) -> tuple[str, ...]:
    """Return the weather, setpoints and settings that an hour of climate and growth needs, in a fixed order."""
    names = dict.fromkeys((*simulator.climate.drivers, "global_radiation", "lamp_on"))
    return tuple(name for name in names if name != "leaf_area_index")


def day_ends(hours: int) -> Integers:
    """Return the last row of each day of 24 rows, the last day cut where the run ends."""
    return np.minimum(np.arange(HOURS, hours + HOURS, HOURS), hours) - 1


def run_hour(
    xp: Any, simulator: NetworkSimulator, carried: Carried, known: Mapping[str, Array], hour: Array
) -> tuple[Carried, dict[str, Array]]:
    """Run climate and growth for one hour.

    Args:
        known: name -> (..., 1): `known_inputs`, over the hour that ends.
        hour: (..., 1) hour of the day at its end.

    Returns:
        What the next hour needs (the harvest as it was), and name -> (..., 1) of all states, par, thermal_time and
        crop_age at the end of the hour.
    """
    climate = simulator.climate
    leaves = simulator.growth.states.index("leaf_area_index")
    values = dict(known) | {"leaf_area_index": carried.growth[..., leaves : leaves + 1]}
    drivers = xp.concat([values[name] for name in climate.drivers], axis=-1)
    state, memory = advance(xp, climate, carried.climate, drivers, carried.climate_memory, hour)
    values |= _columns(climate, state)
    values["par"] = simulator.light.par(xp, known["global_radiation"], known["lamp_on"])
    return grow_hour(xp, simulator, replace(carried, climate=state, climate_memory=memory), values, hour)


def grow_hour(
    xp: Any, simulator: NetworkSimulator, carried: Carried, values: Mapping[str, Array], hour: Array
) -> tuple[Carried, dict[str, Array]]:
    """Run growth for one hour under a climate that is known; see `run_hour`, whose second half it is."""
    growth = simulator.growth
    leaves = growth.states.index("leaf_area_index")
    values = dict(values)
    values["thermal_time"] = carried.thermal_time + values["air_temperature"] / HOURS
    values["crop_age"] = carried.crop_age + 1.0 / HOURS
    drivers = xp.concat([values[name] for name in growth.drivers], axis=-1)
    state, memory = advance(xp, growth, carried.growth, drivers, carried.growth_memory, hour)
    values |= _columns(growth, state)
    pickings = carried.pickings
    if simulator.picking is not None:
        before = carried.growth[..., leaves : leaves + 1]
        since = (values["thermal_time"], values["crop_age"])
        gone, pickings = pick(xp, simulator.picking, before, *since, hour, pickings)
        values["leaf_area_index"] = values["leaf_area_index"] - gone
        state = xp.concat([values[name] for name in growth.states], axis=-1)
    following = replace(
        carried,
        growth=state,
        growth_memory=memory,
        thermal_time=values["thermal_time"],
        crop_age=values["crop_age"],
        pickings=pickings,
    )
    return following, values


def run_harvest(xp: Any, stage: Stage, state: Array, memory: Array, means: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the harvest (..., s) and its filters after a day; `means` is name -> (..., 1), the means of its hours."""
    drivers = xp.concat([means[name] for name in stage.drivers], axis=-1)
    return advance(xp, stage, state, drivers, memory)


def begin(simulator: NetworkSimulator, known: Mapping[str, Floats]) -> Carried:
    """Return where runs stand at their first hour; `known` is name -> (runs, hours), see `free_run`."""
    light = simulator.light.par(np, known["global_radiation"][:, 0], known["lamp_on"][:, 0])
    zero = np.zeros((light.size, 1), dtype=np.float32)
    first = {name: values[:, 0] for name, values in known.items()}
    first |= {"par": light, "thermal_time": zero[:, 0], "crop_age": zero[:, 0]}

    def columns(names: Sequence[str]) -> NDArray[np.float32]:
        return np.stack([first[name] for name in names], axis=-1).astype(np.float32)

    stages = (simulator.climate, simulator.growth, simulator.harvest)
    states = [columns(stage.states) for stage in stages]
    memories = [initial_memory(np, stage, columns(stage.drivers)) for stage in stages]
    return Carried(
        states[0], memories[0], states[1], memories[1], states[2], memories[2],
        thermal_time=zero, crop_age=zero, pickings=zero,
    )  # fmt: skip


def free_run(simulator: NetworkSimulator, known: Mapping[str, Floats], hour: Floats) -> dict[str, Floats]:
    """Run whole seasons from their first hour on nothing but weather and setpoints.

    Args:
        known: name -> (runs, hours): `known_inputs` over all hours, and the first hour of every state (later hours of a
            state are not read).
        hour: (hours,) hour of the day.

    Returns:
        Name -> (runs, hours) of every state, of par, thermal_time (degC d since the first hour) and crop_age (d). The
        harvest stage runs by days of 24 rows; within a day its value is the one at the end of the day before.
    """
    runs, hours = known["global_radiation"].shape
    carried = begin(simulator, known)
    names = (*simulator.climate.states, *simulator.growth.states)
    result = {name: np.empty((runs, hours)) for name in (*names, "par", "thermal_time", "crop_age")}
    for name in names:
        result[name][:, 0] = known[name][:, 0]
    light = simulator.light.par(np, known["global_radiation"][:, 0], known["lamp_on"][:, 0])
    result["par"][:, 0], result["thermal_time"][:, 0], result["crop_age"][:, 0] = light, 0.0, 0.0
    _run_rows(run_hour, simulator, carried, {name: known[name] for name in known_inputs(simulator)}, hour, result)
    return result | _harvest(simulator, result, known)


def free_growth(
    simulator: NetworkSimulator, climate: Mapping[str, Floats], start: Mapping[str, float], hour: Floats
) -> dict[str, Floats]:
    """Run growth alone from the first hour under a climate that is known.

    Args:
        climate: name -> (runs, hours) of the growth stage's drivers but crop_age and thermal_time; and global_radiation
            and lamp_on.
        start: the states of growth and harvest at the first hour.

    Returns:
        Name -> (runs, hours) of the states of growth.
    """
    runs, hours = climate["air_temperature"].shape
    first = {name: np.full((runs, 1), value) for name, value in start.items()}
    given = [name for name in simulator.growth.drivers if name not in ("crop_age", "thermal_time")]
    carried = begin(simulator, {**climate, **first})
    result = {name: np.tile(first[name], (1, hours)) for name in simulator.growth.states}
    _run_rows(grow_hour, simulator, carried, {name: climate[name] for name in given}, hour, result)
    return result


def _run_rows(
    step: Callable[..., tuple[Carried, dict[str, Array]]],
    simulator: NetworkSimulator,
    carried: Carried,
    drivers: Mapping[str, Floats],
    hour: Floats,
    result: Mapping[str, Floats],
) -> None:
    """Fill `result` (runs, hours) from its second row on with what `run_hour` or `grow_hour` gives, hour by hour."""
    columns = {name: values.astype(np.float32)[..., None] for name, values in drivers.items()}
    runs = len(carried.climate)
    for row in range(1, len(hour)):
        now = np.full((runs, 1), hour[row], dtype=np.float32)
        carried, values = step(np, simulator, carried, {name: column[:, row] for name, column in columns.items()}, now)
        for name, column in result.items():
            column[:, row] = values[name][:, 0]


def _columns(stage: Stage, state: Array) -> dict[str, Array]:
    """Return the states of a stage (..., s) as name -> (..., 1)."""
    return {name: state[..., column : column + 1] for column, name in enumerate(stage.states)}


def daily_drivers(names: Sequence[str], columns: Mapping[str, Floats]) -> Floats:
    """Return the mean of each named column (runs, hours) over each day of 24 rows, (runs, days, n)."""
    hours = columns[names[0]].shape[1]
    ends = day_ends(hours)
    starts = np.concatenate([[0], ends[:-1] + 1])
    means = [np.add.reduceat(columns[name], starts, axis=1) / (ends - starts + 1) for name in names]
    return np.stack(means, axis=-1)


def _harvest(
    simulator: NetworkSimulator, result: Mapping[str, Floats], known: Mapping[str, Floats]
) -> dict[str, Floats]:
    stage = simulator.harvest
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


def _held(values: Floats, first: Floats, ends: Integers, hours: int) -> Floats:
    day = np.searchsorted(ends, np.arange(hours), side="left")
    at_end = np.arange(hours) == ends[day]
    before = np.concatenate([first[:, None], values], axis=1)[:, day]
    return np.where(at_end, values[:, day], before).astype(np.float64)
