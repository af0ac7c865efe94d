"""What forecasts still miss, by a ridge regression on what is known when they are made and on the weather ahead.

The hybrid's runs and their combination (`forecast`) leave errors that hang together with the weather, the hour, the
state at the start, and with how far the run by actuators and the run by setpoints lie apart. A linear regression on
these, one for each part of the day and lead, takes that part off (model output statistics; Glahn and Lowry (1972),
J. Appl. Meteor. 11, 1203-1211). Whatever was measured in the climate after the start stays out of it; of the actuators
it knows what the run by actuators made of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.forecasts.combination import Combination, cells, usual_error
from igrow.core.arrays import Floats, Integers
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor

_AHEAD = (
    "outdoor_temperature",
    "outdoor_humidity",
    "global_radiation",
    "wind_speed",
    "sky_temperature",
    "sun_elevation",
    "hour",
)
"""Weather and clock of the row that is forecast."""
_NOW = ("outdoor_temperature", "global_radiation", "wind_speed")
"""Weather at the start."""
_SETPOINTS = ("heating_setpoint", "co2_setpoint", "lamp_on")
_SHORT_HOURS = 2.0
"""Leads up to which the state at the start tells much, so that the regression may be freer."""
_PENALTY = (0.1, 1.0)
"""Ridge of short and of long leads, in units of the features' variance; chosen on selection weeks of AGC 2019."""
_FURTHEST = 24.0
"""Hours of lead beyond which no correction was fitted and none is made."""
_ROWS = (0, 2, 5, 8, *range(11, 288, 6))
"""Integers of a day's run, of 5 min, that a correction is fitted on: every half hour, and more of the first one."""


@dataclass(frozen=True)
class Ridge:
    """One regression."""

    centre: Floats
    """(f,)."""
    scale: Floats
    """(f,)."""
    weights: Floats
    """(f,)."""
    constant: float

    def __call__(self, features: Floats) -> Floats:
        """Return the error to expect, (n,), of features (n, f); a feature that is missing counts as usual."""
        result: Floats = self.constant + _standard(features, self.centre, self.scale) @ self.weights
        return result


OutputStatistics = Mapping[str, Mapping[int, Ridge]]
"""By quantity and regime: part of the day (0 to 3), and 4 more for leads beyond `_SHORT_HOURS`."""


@dataclass(frozen=True)
class Runs:
    """Both runs of one quantity, their usual errors, and their combination; all (steps, s)."""

    actuators: Floats
    setpoints: Floats
    usual_actuators: Floats
    usual_setpoints: Floats
    corrected_actuators: Floats
    corrected_setpoints: Floats
    combined: Floats


def all_runs(
    record: Record,
    by_actuators: Predictor,
    by_setpoints: Predictor,
    combinations: Mapping[str, Combination],
    starts: Integers,
    steps: int,
) -> dict[str, Runs]:
    """Return the runs from each start by quantity."""
    one, other = by_actuators(starts, steps), by_setpoints(starts, steps)
    usual_one = usual_error(record, by_actuators, starts, steps)
    usual_other = usual_error(record, by_setpoints, starts, steps)
    place = cells(record, starts, steps)
    result = {}
    for name, how in combinations.items():
        first = one[name] + how.actuators_share[place] * usual_one[name]
        second = other[name] + how.setpoints_share[place] * usual_other[name]
        weight = how.setpoints_weight[place]
        both = (1.0 - weight) * first + weight * second
        result[name] = Runs(one[name], other[name], usual_one[name], usual_other[name], first, second, both)
    return result


def fit_output_statistics(
    record: Record, setpoints: Mapping[str, Floats], runs: Mapping[str, Runs], starts: Integers
) -> OutputStatistics:
    """Return what runs of a day usually miss, from what they missed from `starts`."""
    result: dict[str, dict[int, Ridge]] = {}
    leads = np.array([row for row in _ROWS if row < len(next(iter(runs.values())).combined)])
    regime = _regimes(record, starts, leads)
    for name, of_name in runs.items():
        error = record.measured[name][starts + 1 + leads[:, None]] - of_name.combined[leads]
        table = _features(record, setpoints, name, of_name, starts, leads)
        result[name] = {}
        for number in np.unique(regime):
            here = (regime == number) & np.isfinite(error)
            if here.sum() > 3 * table.shape[-1]:
                result[name][int(number)] = _fitted(table[here], error[here], _PENALTY[int(number > 3)])
    return result


def corrected_runs(
    record: Record,
    setpoints: Mapping[str, Floats],
    statistics: OutputStatistics,
    runs: Mapping[str, Runs],
    starts: Integers,
) -> dict[str, Floats]:
    """Return the combined forecasts with what they usually miss added, by quantity, (steps, s)."""
    result = {}
    for name, of_name in runs.items():
        forecast = of_name.combined.copy()
        steps = min(len(forecast), round(_FURTHEST * 3600.0 / record.step))
        leads = np.arange(steps)
        regime = _regimes(record, starts, leads)
        table = _features(record, setpoints, name, of_name, starts, leads)
        part = forecast[:steps]
        for number, ridge in statistics.get(name, {}).items():
            here = regime == number
            part[here] += ridge(table[here])
        result[name] = forecast
    return result


def _features(
    record: Record, setpoints: Mapping[str, Floats], name: str, runs: Runs, starts: Integers, leads: Integers
) -> Floats:
    """Return the features of rows `leads` after the starts' next ones, (leads, s, f); leads of a day at most."""
    inputs, day, hour = record.inputs, round(86_400.0 / record.step), round(3600.0 / record.step)
    target = starts + 1 + leads[:, None]
    yesterday = np.maximum(target - day, 0)
    sun, azimuth = inputs["global_radiation"], np.radians(inputs["sun_azimuth"][target])
    clock = inputs["hour"][target] * (np.pi / 12.0)
    recent = [sun[np.maximum(target - back, 0)] for back in range(0, hour, max(1, hour // 4))]
    columns: list[Floats] = [
        np.asarray((leads[:, None] + 1.0) * (record.step / 3600.0), dtype=np.float64),
        *(inputs[one][target] for one in _AHEAD),
        *(inputs[one][starts] for one in _NOW),
        np.mean(recent, axis=0),
        *(values[starts] for values in record.measured.values()),
        sun[yesterday],
        inputs["outdoor_temperature"][yesterday],
        *(setpoints[one][target] for one in _SETPOINTS),
        runs.combined[leads],
        (runs.corrected_actuators - runs.combined)[leads],
        (runs.corrected_setpoints - runs.combined)[leads],
        runs.usual_actuators[leads],
        runs.usual_setpoints[leads],
        (runs.actuators - runs.combined)[leads],
        (runs.setpoints - runs.combined)[leads],
        # Of leads of a day at most, the same hour of the day before lies before the start.
        record.measured[name][yesterday] - runs.combined[leads],
        np.sin(clock),
        np.cos(clock),
        np.sin(2.0 * clock),
        np.cos(2.0 * clock),
        sun[target] * np.sin(azimuth),
        sun[target] * np.cos(azimuth),
        sun[target] ** 2,
        sun[target] - sun[yesterday],
    ]
    for values in record.measured.values():
        columns += [values[starts] - values[np.maximum(starts - back, 0)] for back in (hour, day)]
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def _regimes(record: Record, starts: Integers, leads: Integers) -> Integers:
    """Return the regime of each row, (leads, s)."""
    quarter = (record.inputs["hour"][starts + 1 + leads[:, None]] // 6.0).astype(np.int64)
    long = (leads + 1) * record.step / 3600.0 > _SHORT_HOURS
    result: Integers = np.minimum(quarter, 3) + 4 * long[:, None].astype(np.int64)
    return result


def _fitted(features: Floats, error: Floats, penalty: float) -> Ridge:
    centre = np.nanmean(features, axis=0)
    scale = np.nanstd(features, axis=0) + 1e-6
    table, mean = _standard(features, centre, scale), float(error.mean())
    normal = table.T @ table / len(table) + penalty * np.eye(table.shape[1])
    weights = np.linalg.solve(normal, table.T @ (error - mean) / len(table))
    return Ridge(centre, scale, np.asarray(weights, dtype=np.float64), mean)


def _standard(features: Floats, centre: Floats, scale: Floats) -> Floats:
    """Return features in standard deviations; beyond three of them a linear function knows nothing."""
    return np.nan_to_num(np.clip((features - centre) / scale, -3.0, 3.0))
