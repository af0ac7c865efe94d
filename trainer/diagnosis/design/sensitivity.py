"""Day-long free runs along a log: what the model misses, and how that depends on parameters and effects.

From every local midnight the model runs freely for a day, driven by what the actuators did. Errors of one step
would be cheaper, and they mislead: a simple model's fast dynamics are never quite right, the PLC answers every
disturbance within minutes, and a fit to single steps then takes that answer for physics (on the mechanistic
greenhouse it made the 24 h error five times as large). Over a day what matters is what the balances lack.

The error of a run is the disturbance, passed through the plant: along a run it is coloured, and `noise` whitens it.
Sensitivities to all parameters, effects and patterns come from batches of such runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np

from igrow.core.arrays import Array, Floats, Integers, Mask
from igrow.core.effects import EFFECTS, Effect
from igrow.core.simulator.hybrid import climate, measurement
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import SUBSTEP, Record, free_run, observe
from igrow.trainer.fit.solver import RUNAWAY, DivergenceError, is_bounded

PARAMETER_DIFFERENCE = 0.05
"""Finite difference of a parameter, in prior standard deviations."""
EFFECT_DIFFERENCE = 0.1
"""The same of a sensor effect's amplitude, in typical ones."""
DIVERGED = 200.0
"""K between predicted and measured air beyond which a run has diverged. A balance that feeds itself may climb for a day
without overflowing; no slope there says anything about a greenhouse."""
_SCALARS = SimpleNamespace(maximum=max, minimum=min, abs=abs, exp=np.exp, sqrt=np.sqrt, tanh=np.tanh)
"""The few functions that memories use, for plain floats: ten times faster than numpy's on scalars."""
_AIR_TEMPERATURE = measurement.PREDICTED.index("air_temperature")
_BATCH = 160
"""Variants run at once: more do not fit into the cache."""


@dataclass(frozen=True)
class DayRuns:
    """Where the runs of a record start, and what counts of them."""

    starts: Integers
    """Time steps of the record, (r,)."""
    steps: int
    day: Integers
    """Index of each run's local day, (r,)."""
    weight: Mask
    """Steps with inputs since the start and a measurement at the end, by balance, (3, r, steps)."""

    @property
    def samples(self) -> Integers:
        """Sample of the record that each step ends at, (r, steps)."""
        return self.starts[:, None] + 1 + np.arange(self.steps)

    def on(self, days: Mask) -> DayRuns:
        """Return the runs of some days, (days,)."""
        kept = days[self.day]
        return replace(self, starts=self.starts[kept], day=self.day[kept], weight=self.weight[:, kept])


def day_runs(record: Record, day: Integers) -> DayRuns:
    """Return one run a local day, from its first sample to the next day's.

    Args:
        record: of the log.
        day: index of the local day of each sample, (n,).
    """
    steps = round(86_400.0 / record.step)
    first = np.flatnonzero(np.diff(np.concatenate([[-1], day])) > 0)
    starts = first[first + steps < len(record)]
    ready = np.all(
        [np.isfinite(values[starts]) for values in record.measured.values() if np.isfinite(values).any()], axis=0
    )
    starts = starts[ready]
    samples = starts[:, None] + np.arange(steps)
    driven = np.cumprod(record.usable[samples], axis=1).astype(bool)
    shown = np.stack([np.isfinite(record.measured[name][samples + 1]) for name in measurement.PREDICTED])
    return DayRuns(starts, steps, day[starts], shown & driven)


@dataclass(frozen=True)
class Linearisation:
    """The model along a log at given parameters and active effects."""

    record: Record
    runs: DayRuns
    parameters: Mapping[str, float]
    effects: ActiveEffects
    shown: Floats
    """What the sensors would show, (3, r, steps), in degC, %, ppm."""
    states: Mapping[str, Floats]
    """From `observe`, (n,)."""
    drivers: Mapping[str, Array]
    """Along the measured climate, (n,)."""
    added: Mapping[str, Floats] = field(default_factory=dict)
    """Further fluxes by channel, (n,)."""

    @property
    def errors(self) -> Floats:
        """Measured minus predicted, 0 where it does not count, (3, r, steps)."""
        measured = np.stack([self.record.measured[name][self.runs.samples] for name in measurement.PREDICTED])
        return np.where(self.runs.weight, np.nan_to_num(measured) - self.shown, 0.0)

    def stays_bounded(self, slopes: Floats, spread: Floats) -> Mask:
        """Tell of each slope whether the model stays within all bounds a little further on, (k,).

        Args:
            slopes: of the errors, (k, 3, r, steps); where these do not count the model may show anything.
            spread: standard deviation, or a typical size, of what they are slopes with, (k,).
        """
        return np.asarray(is_bounded(slopes[:, self.runs.weight], spread[:, None]).all(axis=1))


def linearise(
    record: Record,
    runs: DayRuns,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    added: Mapping[str, Floats] | None = None,
) -> Linearisation:
    """Run the model once along a log; `added` are further fluxes by channel, (n,).

    Raises:
        DivergenceError: a prediction that counts is off by more than any greenhouse's, or the air's by `DIVERGED`.
    """
    states = observe(record, parameters, effects)
    shown = free_run(record, states, runs.starts, runs.steps, parameters, effects, added)
    drivers = climate.derive(np, states, record.inputs, parameters, record.lamp_efficacy)
    line = Linearisation(record, runs, parameters, effects, _stacked(shown), states, drivers, added or {})
    errors = line.errors
    # No comparison holds of what is no number.
    if not ((np.abs(errors) < RUNAWAY).all() and (np.abs(errors[_AIR_TEMPERATURE]) <= DIVERGED).all()):
        raise divergence(effects)
    return line


def divergence(effects: ActiveEffects) -> DivergenceError:
    """Return what is said of a model that runs out of all bounds with these effects."""
    active = f" with {', '.join(effects)}" if effects else ""
    return DivergenceError(
        f"the model{active} runs out of all bounds on this log: calibrate it on this greenhouse first"
    )


def parameter_sensitivities(
    line: Linearisation, names: Sequence[str], spread: Floats, others: Sequence[tuple[ActiveEffects, float]] = ()
) -> Floats:
    """Return d(error)/d(parameter), (len(names) + len(others), 3, r, steps), by finite differences.

    Args:
        line: where to differentiate.
        names: of the parameters.
        spread: prior standard deviation of each, (len(names),).
        others: values of the line's effects in further variants, and by how much what they vary differs.
    """
    value, count = np.array([line.parameters[name] for name in names]), len(names)
    step = PARAMETER_DIFFERENCE * spread
    high = np.array([PARAMETERS[name].high for name in names])
    step = np.where(value + step > high, -step, step)
    variants = np.concatenate([value + np.diag(step), np.tile(value, (len(others), 1))])
    varied = {**line.parameters, **{name: variants[:, k : k + 1] for k, name in enumerate(names)}}
    # Memories of processes run along the log as they are: one course of drivers, not one a variant.
    remembering = {one.name for one in EFFECTS.values() if one.kind == "process" and one.memory is not None}
    plain = {name: values for name, values in line.effects.items() if name not in remembering}
    states = dict(observe(line.record, varied, plain))
    states |= {name: values for name, values in line.states.items() if name not in states}
    effects = line.effects
    if others:
        observed = [observe(line.record, line.parameters, active) for active, _ in others]
        states = {name: _joined(values, [one[name] for one in observed], count) for name, values in states.items()}
        effects = {
            name: {key: _joined(now, [active[name][key] for active, _ in others], count) for key, now in values.items()}
            for name, values in effects.items()
        }
    shown = free_run(line.record, states, line.runs.starts, line.runs.steps, varied, effects, line.added)
    amounts = np.array([*step, *(amount for _, amount in others)])
    return np.asarray(-(_batched(shown, len(amounts), line) - line.shown) / amounts[:, None, None, None])


def bounded_parameter_sensitivities(line: Linearisation, names: Sequence[str], spread: Floats) -> Floats:
    """Return `parameter_sensitivities`, (len(names), 3, r, steps), of a model that stays within all bounds with them.

    Raises:
        DivergenceError: it does not, with one of the parameters a little further on.
    """
    slopes = parameter_sensitivities(line, names, spread)
    if not line.stays_bounded(slopes, spread).all():
        raise divergence(line.effects)
    return slopes


def _joined(first: Array, others: Sequence[Array], count: int) -> Array:
    """Return a value of `count` variants and of others after them, (count + others, 1 or n); as it is if all have it.

    Args:
        first: of the `count` variants, a float or (n,); or (count + others, n), of which the last rows are replaced.
        others: of each other, a float or (n,).
        count: of the variants.
    """
    if np.ndim(first) < 2 and all(np.array_equal(one, first) for one in others):
        return first
    before = first[:count] if np.ndim(first) == 2 else [first] * count
    return np.stack(np.broadcast_arrays(*(np.atleast_1d(one) for one in (*before, *others))))


def parameter_secant(line: Linearisation, names: Sequence[str], amount: float, share: bool) -> Floats:
    """Return the change of the errors with a change of parameters, over its amount, (3, r, steps).

    Args:
        line: where the parameters are what they were.
        names: of the parameters.
        amount: of the change, of each parameter; within its bounds.
        share: the amount is a share of each.
    """
    varied = dict(line.parameters)
    for name in names:
        now = line.parameters[name]
        moved = now + amount * (now if share else 1.0)
        varied[name] = float(np.clip(moved, PARAMETERS[name].low, PARAMETERS[name].high))
    states = observe(line.record, varied, line.effects)
    shown = free_run(line.record, states, line.runs.starts, line.runs.steps, varied, line.effects, line.added)
    return np.asarray(-(_stacked(shown) - line.shown) / amount)


def sensor_sensitivities(line: Linearisation, sensors: Sequence[tuple[Effect, Mapping[str, float]]]) -> Floats:
    """Return d(error)/d(amplitude), (s, 3, r, steps), of sensor effects of given shapes that are not active."""
    columns = np.zeros((len(sensors), *line.shown.shape))
    # What only adds to what the sensors of the air show can be run side by side.
    plain = [
        index
        for index, (effect, _) in enumerate(sensors)
        if not effect.shapes and set(effect.measured) <= set(measurement.PREDICTED)
    ]
    for group in (plain, *([index] for index in range(len(sensors)) if index not in plain)):
        if group:
            columns[group] = _sensor_batch(line, [sensors[index] for index in group])
    return columns


def _sensor_batch(line: Linearisation, sensors: Sequence[tuple[Effect, Mapping[str, float]]]) -> Floats:
    count = len(sensors)
    small = np.array([EFFECT_DIFFERENCE * effect.amplitude.typical for effect, _ in sensors])
    own = list(np.diag(small)[..., None]) if count > 1 else small.tolist()
    faults = {
        effect.name: {effect.amplitude.name: size, **shape} for (effect, shape), size in zip(sensors, own, strict=True)
    }
    active: ActiveEffects = {**line.effects, **faults}
    states = observe(line.record, line.parameters, active)
    shown = free_run(line.record, states, line.runs.starts, line.runs.steps, line.parameters, active, line.added)
    return np.asarray(-(_batched(shown, count, line) - line.shown) / small[:, None, None, None])


def unit_fluxes(line: Linearisation, effect: Effect, shape: Mapping[str, float]) -> dict[str, Array]:
    """Return what a process effect of amplitude one adds to each channel along the measured climate, (n,) each."""
    values = {effect.amplitude.name: 1.0, **shape}
    memory = run_memory(effect, values, line.drivers, line.record.step) if effect.memory is not None else None
    count = len(line.record)
    return {
        channel: np.broadcast_to(np.asarray(flux, dtype=np.float64), (count,))
        for channel, flux in effect.contribution(np, line.drivers, values, memory).items()
    }


def flux_sensitivities(line: Linearisation, fluxes: Sequence[tuple[Mapping[str, Array], float]]) -> Floats:
    """Return d(error)/d(amplitude), (f, 3, r, steps), of fluxes into the balances.

    Args:
        line: where to linearise.
        fluxes: for each, the flux by channel at amplitude one, (n,), and a small amplitude to run it at.
    """
    parts = [_flux_batch(line, fluxes[first : first + _BATCH]) for first in range(0, len(fluxes), _BATCH)]
    count = len(line.runs.starts)
    return np.concatenate(parts) if parts else np.zeros((0, 3, count, line.runs.steps))


def _flux_batch(line: Linearisation, fluxes: Sequence[tuple[Mapping[str, Array], float]]) -> Floats:
    record, runs = line.record, line.runs
    channels = sorted({channel for flux, _ in fluxes for channel in flux})
    zero = np.zeros(len(record))
    samples = runs.starts + np.arange(runs.steps)[:, None]
    added = {
        channel: np.stack([small * flux.get(channel, zero)[samples] for flux, small in fluxes], axis=1)
        for channel in channels
    }
    shown = free_run(record, line.states, runs.starts, runs.steps, line.parameters, line.effects, added)
    small = np.array([size for _, size in fluxes])
    return np.asarray(-(_batched(shown, len(fluxes), line) - line.shown) / small[:, None, None, None])


def run_memory(effect: Effect, values: Mapping[str, float], drivers: Mapping[str, Array], step: float) -> Floats:
    """Return the memory of an effect as it acts in every step along the drivers, (n,)."""
    memory = effect.memory
    assert memory is not None
    count = max(np.size(drivers[name]) for name in effect.drivers)
    columns = [np.broadcast_to(drivers[name], (count,)).tolist() for name in effect.drivers]
    substeps = max(1, round(step / SUBSTEP))
    course, part = np.empty(count), step / substeps
    names = effect.drivers
    now = dict(zip(names, (column[0] for column in columns), strict=True))
    value = float(memory.start(_SCALARS, now, values))
    for k, cells in enumerate(zip(*columns, strict=True)):
        now = dict(zip(names, cells, strict=True))
        total = 0.0
        for _ in range(substeps):
            acts = memory.advance(_SCALARS, value, now, values, 0.5 * part) if memory.within_step else value
            total += acts
            value = memory.advance(_SCALARS, value, now, values, part)
        course[k] = total / substeps
    return course


def _stacked(shown: Mapping[str, Floats]) -> Floats:
    return np.stack([shown[name].T for name in measurement.PREDICTED])


def _batched(shown: Mapping[str, Floats], count: int, line: Linearisation) -> Floats:
    """Return what `count` variants show, (count, 3, r, steps)."""
    shape = (line.runs.steps, count, len(line.runs.starts))
    # What no variant moves has no axis of variants.
    tables = [shown[name] if shown[name].ndim == 3 else shown[name][:, None] for name in measurement.PREDICTED]
    stacked = np.stack([np.broadcast_to(table, shape) for table in tables])
    return np.asarray(stacked.transpose(2, 0, 3, 1))


def is_measured(record: Record, effect: Effect) -> bool:
    """Tell whether the log has any of what a sensor effect falsifies: there may be rail pipes and no grow pipe."""
    falsified = effect.measured
    return not falsified or any(
        bool(np.isfinite(record.measured[name]).any()) if name in record.measured else name not in record.missing
        for name in falsified
    )
