"""The disturbance state: what the balances missed until now, and what is to be expected of it.

No model of balances is complete. Run as an observer along the log, the stage shows in each step the flux that
was missing in each balance. Much of it comes back: at the same hour of the next day (shade, schedules, a crop
that is not the nominal one), and for some hours after it was seen (clouds of the wrong kind, a door). A forecast
adds both, as offset-free predictive control does (Pannocchia and Rawlings (2003), AIChE Journal 49, 426-437).
Only what was known at the start of a forecast enters it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.effects.definition import Values
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.balances import balances
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor, starts_within

CHANNELS: Mapping[str, str] = {
    "heat": "air_temperature",
    "vapour": "vapour_concentration",
    "co2": "co2_concentration",
}
"""Channel of `added` fluxes -> the state whose balance it enters."""
_MEMORIES = (0.7, 1.5, 3.0, 6.0)
_DECAYS = (1.0, 2.0, 4.0, 8.0, 16.0)
_CLIP = 4.0
"""Fluxes beyond this many robust spreads count as this many."""


@dataclass(frozen=True)
class DisturbanceModel:
    """How disturbances go on at a site."""

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

    def restricted(self, channels: Collection[str]) -> DisturbanceModel:
        """Return the model that expects something of these channels alone."""
        daily, recent = (
            {channel: share if channel in channels else 0.0 for channel, share in shares.items()}
            for shares in (self.daily_share, self.recent_share)
        )
        return replace(self, daily_share=daily, recent_share=recent)


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
    added_by_effects = climate.contributions(np, drivers, ahead, effects, record.step)
    fluxes = balances(np, ahead, drivers, parameters, added_by_effects).of
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
    starts: Sequence[int] | Integers,
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


def run_fluxes(
    record: Record,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    starts: Integers,
    steps: int,
    added: Mapping[str, Floats] | None,
    disturbance: DisturbanceModel | None,
    missing: Mapping[str, Floats] | None = None,
) -> dict[str, Floats]:
    """Return all fluxes beside the balances that runs from `starts` take along: known ones and expected ones.

    `missing` are the missing fluxes, where they are at hand. By channel, (n,) or (steps, s).
    """
    fluxes = dict(added or {})
    if disturbance is not None:
        seen = missing or missing_fluxes(record, parameters, effects, added)
        ahead = starts + np.arange(steps)[:, None]
        for channel, flux in expected_fluxes(record, seen, starts, steps, disturbance).items():
            fluxes[channel] = flux + (fluxes[channel][ahead] if channel in fluxes else 0.0)
    return fluxes


def observed_runs(
    record: Record,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    added: Mapping[str, Floats] | None = None,
    disturbance: DisturbanceModel | None = None,
) -> Predictor:
    """Return runs driven by the measured actuators that take along known fluxes and the disturbance seen so far."""
    states = records.observe(record, parameters, effects)
    missing = missing_fluxes(record, parameters, effects, added) if disturbance is not None else None

    def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
        fluxes = run_fluxes(record, parameters, effects, starts, steps, added, disturbance, missing)
        return records.free_run(record, states, starts, steps, parameters, effects, fluxes)

    return predict


def courses(
    record: Record, flux: Floats, begin: Integers, steps: int, model: DisturbanceModel, share: float
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
    smooth: Floats, rows: Integers, known_until: Integers, model: DisturbanceModel, step: float
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


def fit_disturbance(parts: Sequence[tuple[Record, Mask | None, Mapping[str, Floats]]]) -> DisturbanceModel:
    """Return the disturbance model that predicts missing fluxes best (least squares) over the next day.

    Args:
        parts: records, the rows that may be used (None: all), and their missing fluxes by channel, (n,).
    """
    model = DisturbanceModel()
    best: tuple[float, DisturbanceModel] | None = None
    for memory in _MEMORIES:
        trial = replace(model, memory_days=memory)
        total = 0.0
        daily, recent, decay = {}, {}, {}
        for channel in parts[0][2]:
            cost, daily[channel], recent[channel], decay[channel] = _fit_channel(parts, channel, trial)
            total += cost
        if best is None or total < best[0]:
            best = (total, replace(trial, daily_share=daily, recent_share=recent, decay_hours=decay))
    assert best is not None
    return best[1]


def helpful_channels(errors_with: Callable[[frozenset[str]], Mapping[str, float]]) -> frozenset[str]:
    """Return the channels whose expected disturbance makes predictions best, none of which it makes worse.

    Args:
        errors_with: returns the error of every quantity, on selection weeks, when these channels are expected to go on.
    """
    plain = errors_with(frozenset())
    best: tuple[float, frozenset[str]] = (float(len(plain)), frozenset())
    for count in range(1, len(CHANNELS) + 1):
        for chosen in itertools.combinations(CHANNELS, count):
            channels = frozenset(chosen)
            ratios = [error / plain[quantity] for quantity, error in errors_with(channels).items()]
            if all(ratio <= 1.0 for ratio in ratios) and sum(ratios) < best[0]:
                best = sum(ratios), channels
    return best[1]


def _fit_channel(
    parts: Sequence[tuple[Record, Mask | None, Mapping[str, Floats]]],
    channel: str,
    model: DisturbanceModel,
) -> tuple[float, float, float, float]:
    """Return (cost relative to no forecast, daily share, recent share, decay hours) of one channel."""
    targets, usual, departures, leads = [], [], [], []
    for record, rows, missing in parts:
        flux = missing[channel]
        allowed = np.ones(len(record), dtype=bool) if rows is None else rows
        steps = max(1, round(86_400.0 / record.step))
        starts = starts_within(record, allowed, steps, max(1, round(4.1 * 3600.0 / record.step)))
        if len(starts) == 0 or not np.isfinite(flux).any():
            continue
        spread = 1.4826 * float(np.nanmedian(np.abs(flux - np.nanmedian(flux)))) + 1e-12
        clipped = np.clip(flux, -_CLIP * spread, _CLIP * spread) / spread
        course, departure = courses(record, clipped, starts, steps, model, 1.0)
        width = max(1, round(1800.0 / record.step))
        whole = steps // width * width
        ahead = clipped[starts + np.arange(whole)[:, None]].reshape(-1, width, len(starts))
        known = np.isfinite(ahead)
        mean = np.where(known, ahead, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        targets.append(np.where(known.any(axis=1), mean, np.nan))
        usual.append(course[:whole].reshape(-1, width, len(starts)).mean(axis=1))
        departures.append(np.broadcast_to(departure, mean.shape))
        leads.append(
            np.broadcast_to(((np.arange(len(mean)) + 0.5) * width * record.step / 3600.0)[:, None], mean.shape)
        )
    if not targets:
        return 1.0, 0.0, 0.0, model.decay_hours[channel]
    target, course, departure, lead = (
        np.concatenate([part.ravel() for part in kind]) for kind in (targets, usual, departures, leads)
    )
    good = np.isfinite(target)
    target, course, departure, lead = target[good], course[good], departure[good], lead[good]
    best = (np.inf, 0.0, 0.0, 4.0)
    for decay in _DECAYS:
        matrix = np.stack([course, departure * np.exp(-lead / decay)], axis=1)
        shares = np.clip(np.linalg.lstsq(matrix, target, rcond=None)[0], 0.0, 1.0)
        cost = float(np.mean((target - matrix @ shares) ** 2) / np.mean(target**2))
        if cost < best[0]:
            best = (cost, float(shares[0]), float(shares[1]), decay)
    return best
