"""A log as it drives the hybrid stage, the states it implies, and free runs from any of its instants.

Row k of a record holds the measurements at its time, and the inputs from that time to the next row's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from igrow.core import gaps
from igrow.core.arrays import Array, Floats, Integers, Mask, Times
from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Values
from igrow.core.simulator.hybrid import climate, measurement
from igrow.core.simulator.hybrid.balances import affected_drivers, below_the_air
from igrow.core.simulator.hybrid.climate import ActiveEffects, Forcing, memory_name

SUBSTEP = 900.0
"""Longest step of the balances in seconds."""
_AT_ONCE = 16_384
"""Elements of an array that is computed for many steps at once."""


@dataclass(frozen=True)
class Record:
    """A log on a regular grid of n rows."""

    time: Times
    step: float
    """Seconds between rows."""
    inputs: Mapping[str, Floats]
    """What drives the balances and the effects from each row to the next, by name, (n,), without gaps."""
    measured: Mapping[str, Floats]
    """`measurement.PREDICTED` by name, (n,), NaN where missing."""
    usable: Mask
    """The inputs of this row were measured, or bridged over a short gap, (n,)."""
    missing: tuple[str, ...]
    """Inputs that the log lacks."""
    lamp_efficacy: float
    """umol J-1."""

    def __len__(self) -> int:
        return len(self.time)

    def slice(self, first: int, last: int) -> Record:
        """Return rows first <= k < last."""
        return replace(
            self,
            time=self.time[first:last],
            inputs={name: values[first:last] for name, values in self.inputs.items()},
            measured={name: values[first:last] for name, values in self.measured.items()},
            usable=self.usable[first:last],
        )

    def coarser(self, factor: int) -> Record:
        """Return a record of every `factor`-th row, its inputs the means from there to the next."""
        whole = len(self) // factor * factor
        first = slice(0, whole, factor)
        return replace(
            self,
            time=self.time[first],
            step=self.step * factor,
            inputs={name: values[:whole].reshape(-1, factor).mean(axis=1) for name, values in self.inputs.items()},
            measured={name: values[first] for name, values in self.measured.items()},
            usable=np.asarray(self.usable[:whole].reshape(-1, factor).all(axis=1)),
        )

    def since(self, onset: np.datetime64 | None) -> Record:
        """Return the record with ``elapsed_days`` counted from `onset` (None: from the first row)."""
        start = self.time[0] if onset is None else onset
        elapsed = (self.time - start).astype("timedelta64[s]").astype(np.float64) / 86_400.0
        return replace(self, inputs=dict(self.inputs) | {"elapsed_days": np.maximum(elapsed, 0.0)})


def observe(record: Record, parameters: Values, effects: ActiveEffects) -> dict[str, Floats]:
    """Return the states that the log implies, by name, (n,): the measured ones without sensor faults, the rest run.

    The temperatures of floor and soil and the memories of effects follow the measured air; over a gap in the
    measurements the last value stands. Parameters are floats or arrays of shape (n,); or of shape (m, 1) for m
    variants at once, and then both temperatures have shape (m, n).
    """
    clean = {name: bridge(values, len(record), smooth=True)[0] for name, values in record.measured.items()}
    for name, stand_in in (("air_humidity", 75.0), ("air_co2", 500.0)):
        clean[name] = np.where(np.isfinite(clean[name]), clean[name], stand_in)
    if any(EFFECTS[name].kind == "sensor" for name in effects):
        raw_state = climate.initial_state(np, clean, record.inputs, parameters, effects, record.lamp_efficacy)
        raw_drivers = climate.derive(np, raw_state, record.inputs, parameters, record.lamp_efficacy)
        _run_memories(record, raw_state, raw_drivers, effects)
        errors = measurement.sensor_errors(np, raw_drivers, raw_state, effects)
        clean = {name: values - errors.get(name, 0.0) for name, values in clean.items()}
    state = climate.initial_state(np, clean, record.inputs, parameters, effects, record.lamp_efficacy)
    state["mass_temperature"], state["soil_temperature"] = _run_below(record, state, parameters)
    if any(EFFECTS[name].memory is not None for name in effects):
        drivers = climate.derive(np, state, record.inputs, parameters, record.lamp_efficacy)
        _run_memories(record, state, drivers, effects)
    shape = (len(record),)
    return {name: np.broadcast_to(v, np.broadcast_shapes(np.shape(v), shape)) for name, v in state.items()}


def uptake(record: Record, parameters: Values, effects: ActiveEffects) -> tuple[Floats, Floats]:
    """Return the CO2 that the crop takes up, kg m-2 s-1, and the air's temperature, degC, both (n,), as a log has them.

    Effects count: light that is lost and assimilation that a crop cannot do, and sensors that are off.
    """
    state = observe(record, parameters, effects)
    drivers = climate.derive(np, state, record.inputs, parameters, record.lamp_efficacy)
    added = climate.contributions(np, drivers, state, effects, record.step)
    return affected_drivers(np, drivers, added)["assimilation"], state["air_temperature"]


@np.errstate(over="ignore", invalid="ignore")
def free_run(
    record: Record,
    states: Mapping[str, Floats],
    starts: Sequence[int] | Integers,
    steps: int,
    parameters: Values,
    effects: ActiveEffects,
    added: Mapping[str, Floats] | None = None,
) -> dict[str, Floats]:
    """Run the stage freely from several instants of a record, driven by its inputs.

    Args:
        record: with n rows.
        states: from `observe`, (n,) each, or (m, n).
        starts: rows to start from, (s,); start + steps must be less than n.
        steps: rows to run.
        parameters: floats, or arrays of shape (m, 1) for m variants at once.
        effects: the active effects; their values are floats, (m, 1), or functions of time as (n,) or (m, n).
        added: further fluxes by channel: (n,), or (steps, s) for fluxes that differ from start to start.

    Returns:
        What the sensors would show at rows start + 1 ... start + steps, by quantity, (steps, s) or (steps, m, s); no
        finite number, and no warning, where a run leaves all bounds.
    """
    begin = np.asarray(starts, dtype=np.int64)
    substeps = max(1, round(record.step / SUBSTEP))
    course = _forcing_of(record, begin, steps, parameters)
    extra = {channel: np.asarray(flux) for channel, flux in (added or {}).items()}
    state: dict[str, Array] = {name: values[..., begin] for name, values in states.items()}
    shown: dict[str, list[Floats]] = {name: [] for name in measurement.PREDICTED}
    outer, active = next(course), _at_rows(effects, begin, len(record))
    drivers = climate.with_state(np, state, outer, parameters)
    for k in range(steps):
        row = begin + k
        fluxes = {channel: flux[row] if flux.ndim == 1 else flux[k] for channel, flux in extra.items()}
        for part in range(substeps):
            if part > 0:
                drivers = climate.with_state(np, state, outer, parameters)
            true = _corrected(outer, drivers, state, parameters, active)
            state = climate.step(np, state, true, parameters, active, seconds=record.step / substeps, added=fluxes)
        # What the sensors show at a row is what the next step begins with.
        outer, active = next(course), _at_rows(effects, row + 1, len(record))
        drivers = climate.with_state(np, state, outer, parameters)
        for name, values in measurement.measured(np, drivers, state, active).items():
            shown[name].append(values)
    return {name: np.stack(np.broadcast_arrays(*values)) for name, values in shown.items()}


def complete_starts(record: Record, steps: int, every: int) -> Integers:
    """Return the rows, `every` apart, from which `steps` rows can be run on usable inputs.

    The climate must have been measured in the start row itself.
    """
    known = record.usable.copy()
    bad = np.concatenate([[0], np.cumsum(~known)])
    starts = np.arange(0, len(record) - steps, every)
    whole = bad[starts + steps] - bad[starts] == 0
    measured_at_start = np.all([np.isfinite(values[starts]) for values in _given(record)], axis=0)
    chosen: Integers = starts[whole & measured_at_start]
    return chosen


def _given(record: Record) -> list[Floats]:
    return [values for values in record.measured.values() if np.isfinite(values).any()]


def _forcing_of(record: Record, begin: Integers, steps: int, parameters: Values) -> Iterator[Forcing]:
    """Yield what no state changes at each step of runs from rows `begin`, the last one's end too."""
    variants = max((np.shape(value)[0] for value in parameters.values() if np.ndim(value) > 1), default=0)
    # As many steps at once as the processor's cache holds: arrays of few elements cost as much as long ones.
    block = max(1, _AT_ONCE // (max(variants, 1) * max(len(begin), 1)))
    for first in range(0, steps + 1, block):
        rows = begin + np.arange(first, min(first + block, steps + 1))[:, None]
        if variants:
            rows = rows[:, None, :]
        inputs = {name: values[rows] for name, values in record.inputs.items()}
        outer = climate.forcing(np, inputs, parameters, record.lamp_efficacy)
        yield from (outer.at(k) for k in range(len(rows)))


def _corrected(outer: Forcing, drivers: Values, state: Values, parameters: Values, effects: ActiveEffects) -> Values:
    """Take the pipe sensors' error out of the drivers that were derived from the inputs, where one is active."""
    if "pipe_temperature_offset" not in effects:
        return drivers
    pipes = measurement.correct_inputs(np, outer.pipes, drivers, state, effects)
    return climate.with_state(np, state, outer.with_pipes(pipes), parameters)


def _at_rows(effects: ActiveEffects, rows: Integers, count: int) -> ActiveEffects:
    """Pick the rows of values that are functions of time."""
    return {
        effect: {
            name: value[..., rows] if isinstance(value, np.ndarray) and value.shape[-1:] == (count,) else value
            for name, value in values.items()
        }
        for effect, values in effects.items()
    }


def bridge(values: Floats, longest: int, *, smooth: bool) -> tuple[Floats, Mask]:
    """Fill gaps (linearly or by the last value) and tell which rows were measured or lay in a gap of <= longest."""
    return (gaps.interpolated if smooth else gaps.held)(values), gaps.short_gaps(values, longest)


def _run_below(record: Record, state: Values, parameters: Values) -> tuple[Floats, Floats]:
    """Run the balances of floor and soil under the measured air; return both temperatures."""
    parts = below_the_air(state, climate.radiation_inside(np, record.inputs, parameters), parameters)
    flux, conductance, capacity = parts["mass_temperature"]
    _, soil_conductance, soil_capacity = parts["soil_temperature"]
    # The floor is drawn to `aim`, less by so much as the soil is colder than where both stand now.
    pulled = parameters["soil_heat_transfer"] / conductance
    aim = state["mass_temperature"] + flux / conductance - pulled * state["soil_temperature"]
    share = 1.0 - np.exp(-record.step * conductance / capacity)
    soil_share = 1.0 - np.exp(-record.step * soil_conductance / soil_capacity)
    shape = np.broadcast_shapes(np.shape(aim), np.shape(share), (len(record),))
    # Start where both would be that have long been under this air.
    rows = max(1, round(86_400.0 / record.step))
    aims, pulls = (np.broadcast_to(one, shape).T for one in (aim, pulled))
    below = aims[:rows].mean(axis=0) / (1.0 - pulls[0])
    shares, soil_shares = (np.broadcast_to(one, shape).T for one in (share, soil_share))
    mass, soil = _chained(below, aims, pulls, shares, soil_shares)
    return mass.T, soil.T


def _chained(below: Floats, aims: Floats, pulls: Floats, shares: Floats, soil_shares: Floats) -> tuple[Floats, Floats]:
    """Return the courses of two temperatures, (n, ...), of which each step goes a share of the way to its aim.

    Stretches of the way run side by side, each from nothing and from a kelvin of either; then one leads to the next.

    Args:
        below: where both begin, (...).
        aims: where the first is drawn to, less what the other pulls, (n, ...).
        pulls: by the other, of its temperature, (n, ...).
        shares: of the way that the first goes in a step, (n, ...).
        soil_shares: of its way to the first that the other goes, (n, ...).
    """
    count, shape = len(aims), aims.shape[1:]
    length = math.isqrt(count) + 1
    stretches = -(-count // length)

    def side_by_side(values: Floats) -> Floats:
        padded = np.concatenate([values, np.zeros((stretches * length - count, *shape))])
        return np.ascontiguousarray(padded.reshape(stretches, length, 1, *shape).swapaxes(0, 1))

    share, soil_share = side_by_side(shares), side_by_side(soil_shares)
    driven, pull = side_by_side(shares * aims), side_by_side(shares * pulls)
    kept, soil_kept = 1.0 - share, 1.0 - soil_share
    # From nothing with what drives it, from a kelvin of the first, from a kelvin of the other.
    mass, soil = np.zeros((length + 1, stretches, 3, *shape)), np.zeros((length + 1, stretches, 3, *shape))
    mass[0, :, 1], soil[0, :, 2] = 1.0, 1.0
    for k in range(length):
        mass[k + 1] = kept[k] * mass[k] + pull[k] * soil[k]
        mass[k + 1, :, 0] += driven[k, :, 0]
        soil[k + 1] = soil_kept[k] * soil[k] + soil_share[k] * mass[k]
    begins = np.ones((stretches, 3, *shape))
    begins[0, 1:] = below
    for place in range(stretches - 1):
        begins[place + 1, 1] = np.sum(mass[-1, place] * begins[place], axis=0)
        begins[place + 1, 2] = np.sum(soil[-1, place] * begins[place], axis=0)
    mass_course, soil_course = (np.sum(one[:-1] * begins, axis=2).swapaxes(0, 1) for one in (mass, soil))
    whole = (stretches * length, *shape)
    return mass_course.reshape(whole)[:count], soil_course.reshape(whole)[:count]


def _run_memories(record: Record, state: dict[str, Array], drivers: Values, effects: ActiveEffects) -> None:
    """Run the memories of the active effects under the measured drivers; they become arrays in `state`.

    Their shape is (n,), or (m, n) where a driver differs from variant to variant.
    """
    substeps = max(1, round(record.step / SUBSTEP))
    for effect, values in effects.items():
        memory = EFFECTS[effect].memory
        if memory is None:
            continue
        names = EFFECTS[effect].drivers
        shape = np.broadcast_shapes((len(record),), *(np.shape(drivers[name]) for name in names))
        read: dict[str, Any] = {name: np.broadcast_to(drivers[name], shape).T for name in names}
        if len(shape) == 1:
            # Floats are several times as fast as arrays of one element.
            read = {name: column.tolist() for name, column in read.items()}
        still = {name: float(np.mean(value)) for name, value in values.items()}
        course = np.empty(shape).T
        value = memory.start(np, {name: column[0] for name, column in read.items()}, still)
        for k in range(len(record)):
            course[k] = value
            now = {name: column[k] for name, column in read.items()}
            for _ in range(substeps):
                value = memory.advance(np, value, now, still, record.step / substeps)
        state[memory_name(effect)] = course.T
