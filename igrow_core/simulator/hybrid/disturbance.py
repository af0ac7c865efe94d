"""The disturbance state: what the balances missed until now, and what is to be expected of it.

No model of balances is complete. Run as an observer along the log, the stage shows in each step the flux that
was missing in each balance. Much of it comes back: at the same hour of the next day (shade, schedules, a crop
that is not the nominal one), and for some hours after it was seen (clouds of the wrong kind, a door). A forecast
adds both, as offset-free predictive control does (Pannocchia and Rawlings (2003), AIChE Journal 49, 426-437).
Only what was known at the start of a forecast enters it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from igrow.core.effects.definition import Values
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record

Floats = NDArray[np.float64]

CHANNELS: Mapping[str, str] = {
    "heat": "air_temperature",
    "vapour": "vapour_concentration",
    "co2": "co2_concentration",
}
"""Channel of `added` fluxes -> the state whose balance it enters."""


@dataclass(frozen=True)
class DisturbanceModel:
    """How disturbances go on; fitted to a site by `igrow.trainer.calibration.disturbance`."""

    memory_days: float = 3.0
    """Days after which a past day has lost 63 % of its weight in the daily course."""
    most_days: int = 10
    """Days that are looked back."""
    smoothing_hours: float = 1.0
    """Width over which the daily course is smoothed."""
    recent_hours: float = 2.0
    """Hours before the start over which the present departure from the daily course is averaged."""
    daily_share: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(CHANNELS, 0.8))
    """Part of the daily course that is expected again, by channel."""
    recent_share: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(CHANNELS, 0.6))
    """Part of the present departure that is still there as the forecast begins, by channel."""
    decay_hours: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(CHANNELS, 4.0))
    """Hours in which the departure loses 63 %, by channel."""


def missing_fluxes(
    record: Record, parameters: Values, effects: ActiveEffects, added: Mapping[str, Floats] | None = None
) -> dict[str, Floats]:
    """Return the flux that was missing in each balance from each row to the next, by channel, (n,).

    NaN where it cannot be told: gaps, and the last row. Heat W m-2; vapour and CO2 kg m-2 s-1. Fluxes in `added`
    (by channel, (n,)) count as known.
    """
    states = records.observe(record, parameters, effects)
    count = len(record)
    inputs = dict(record.inputs)
    ahead = dict(states)
    substeps = max(1, round(record.step / records.SUBSTEP))
    drivers = climate.derive(np, ahead, inputs, parameters, record.lamp_efficacy)
    fluxes = climate.balances(np, ahead, drivers, parameters, climate.contributions(np, drivers, ahead, effects))
    for _ in range(substeps):
        ahead = climate.advance(
            np,
            ahead,
            inputs,
            parameters,
            effects,
            seconds=record.step / substeps,
            lamp_efficacy=record.lamp_efficacy,
            added=added,
        )
    seen = {
        "heat": np.isfinite(record.measured["air_temperature"]),
        "vapour": np.isfinite(record.measured["air_humidity"]) & np.isfinite(record.measured["air_temperature"]),
        "co2": np.isfinite(record.measured["air_co2"]),
    }
    missing = {}
    for channel, state in CHANNELS.items():
        _, conductance, capacity = fluxes[state]
        gain = np.broadcast_to(conductance / -np.expm1(-record.step * conductance / capacity), (count,))
        result = np.full(count, np.nan)
        good = seen[channel][1:] & seen[channel][:-1] & record.usable[:-1]
        error = (states[state][1:] - np.broadcast_to(ahead[state], (count,))[:-1]) * gain[:-1]
        result[:-1] = np.where(good, error, np.nan)
        missing[channel] = result
    return missing


def expected_fluxes(
    record: Record,
    missing: Mapping[str, Floats],
    starts: Sequence[int] | NDArray[np.int64],
    steps: int,
    model: DisturbanceModel,
) -> dict[str, Floats]:
    """Return what is to be expected of the missing fluxes after each start, by channel, (steps, s).

    Args:
        record: the log; rows after a start are not used for it.
        missing: from `missing_fluxes`.
        starts: rows, (s,).
        steps: rows ahead.
        model: how disturbances go on.
    """
    begin = np.asarray(starts, dtype=np.int64)
    hours = (np.arange(steps) + 0.5) * record.step / 3600.0
    result = {}
    for channel, flux in missing.items():
        course, departure = courses(record, flux, begin, steps, model, model.daily_share[channel])
        fading = model.recent_share[channel] * np.exp(-hours / model.decay_hours[channel])
        result[channel] = model.daily_share[channel] * course + fading[:, None] * departure[None, :]
    return result


def courses(
    record: Record, flux: Floats, begin: NDArray[np.int64], steps: int, model: DisturbanceModel, share: float
) -> tuple[Floats, Floats]:
    """Return the daily course of a missing flux after each start, (steps, s), and the departure before it, (s,).

    The departure is the mean over `recent_hours` of the flux less `share` times its own daily course.
    """
    smooth = _smoothed(flux, model, record.step)
    ahead = begin[None, :] + np.arange(steps)[:, None]
    course = _daily_course(smooth, ahead, begin, model, record.step)
    back = max(1, round(model.recent_hours * 3600.0 / record.step))
    before = begin[None, :] - 1 - np.arange(back)[:, None]
    usual = share * _daily_course(smooth, before, begin - back, model, record.step)
    departure = np.where(before >= 0, flux[np.maximum(before, 0)], np.nan) - usual
    known = np.isfinite(departure)
    mean: Floats = np.where(known, departure, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return course, mean


def _smoothed(flux: Floats, model: DisturbanceModel, step: float) -> Floats:
    """Return a centred running mean over `smoothing_hours`, gaps left out, (n,)."""
    half = _half_width(model, step)
    known = np.isfinite(flux)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, flux, 0.0))])
    number = np.concatenate([[0], np.cumsum(known)])
    rows = np.arange(len(flux))
    first, last = np.maximum(rows - half, 0), np.minimum(rows + half + 1, len(flux))
    count = number[last] - number[first]
    mean: Floats = np.where(count > 0, (total[last] - total[first]) / np.maximum(count, 1), np.nan)
    return mean


def _half_width(model: DisturbanceModel, step: float) -> int:
    return max(0, round(0.5 * model.smoothing_hours * 3600.0 / step))


def _daily_course(
    smooth: Floats, rows: NDArray[np.int64], known_until: NDArray[np.int64], model: DisturbanceModel, step: float
) -> Floats:
    """Return the weighted mean over earlier days at the hour of each row, (k, s), from rows before `known_until`."""
    day = round(86_400.0 / step)
    half = _half_width(model, step)
    total = np.zeros(rows.shape)
    weights = np.zeros(rows.shape)
    furthest = int(np.ceil(rows.shape[0] / day)) + model.most_days
    for back in range(1, furthest + 1):
        past = rows - back * day
        age = (known_until[None, :] - past) / day
        value = np.where(past >= 0, smooth[np.maximum(past, 0)], np.nan)
        usable = np.isfinite(value) & (past + half < known_until[None, :]) & (age <= model.most_days)
        weight = np.where(usable, np.exp(-age / model.memory_days), 0.0)
        total += weight * np.where(usable, value, 0.0)
        weights += weight
    return total / np.maximum(weights, 1e-9)
