"""Forecasts made of the simulator's runs: the usual error of the hour taken off, and two ways to run it combined.

Model output statistics (Glahn and Lowry (1972), J. Appl. Meteor. 11, 1203-1211): what runs of the last days
missed at the same hour is expected again in part. Combined forecasts (Bates and Granger (1969), Operational
Research Quarterly 20, 451-468): the run driven by measured actuators knows what the PLC did, the run driven by
setpoints knows what it wants; their errors differ. Shares and weights are fitted on selection days.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.forecasts.uncertainty import DAYLIGHT
from igrow.core.arrays import Floats, Integers
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor

_DAYS = 6
"""Days that are looked back for the usual error."""
_MEMORY = 3.0
"""Days after which a past day has lost 63 % of its weight."""


_SHORT = 2.0
"""Hours up to which a lead is short: what was seen at the start still tells."""
CELLS = ("short lead by night", "short lead by day", "long lead by night", "long lead by day")


@dataclass(frozen=True)
class Combination:
    """How the forecasts of one quantity are made from runs by measured actuators and by setpoints, by `CELLS`."""

    actuators_share: Floats
    """Part of the usual error of runs by actuators that is expected again, (4,)."""
    setpoints_share: Floats
    """The same of runs by setpoints, (4,)."""
    setpoints_weight: Floats
    """Weight of the corrected run by setpoints, (4,); the other has the rest."""


def cells(record: Record, starts: Integers, steps: int) -> Integers:
    """Return which of `CELLS` each row of runs is in, (steps, s): by lead time and outdoor radiation."""
    lead = (np.arange(1, steps + 1) * (record.step / 3600.0))[:, None]
    sun = record.inputs["global_radiation"][starts + 1 + np.arange(steps)[:, None]]
    found: Integers = 2 * (lead > _SHORT).astype(np.int64) + (sun > DAYLIGHT).astype(np.int64)
    return found


def usual_error(record: Record, predict: Predictor, starts: Integers, steps: int) -> dict[str, Floats]:
    """Return what runs one to `_DAYS` days before each start missed at the same hour, by quantity, (steps, s).

    Measured minus predicted, a weighted mean; 0 where there was no run. Only rows up to the start are used.
    """
    day = round(86_400.0 / record.step)
    length = min(steps, day)
    following = 1 + np.arange(length)[:, None]
    # All days in one batch: a run costs by its steps, hardly by how many run at once.
    back = np.arange(1, _DAYS + 1)[:, None]
    there = starts - back * day >= 0
    past = np.where(there, starts - back * day, 0)
    weight = np.exp(-(back - 1) / _MEMORY)
    result = {}
    for name, predicted in predict(past.ravel(), length).items():
        if name not in record.measured:
            continue
        shape = (length, *past.shape)
        error = (record.measured[name][past.ravel() + following] - predicted).reshape(shape)
        known = np.isfinite(error) & there
        total = np.sum(np.where(known, error, 0.0) * weight, axis=1)
        result[name] = total / np.maximum(np.sum(known * weight, axis=1), 1e-9)
    repeat = np.arange(steps) % day
    return {name: error[repeat] for name, error in result.items()}


def fit_combination(
    record: Record, by_actuators: Predictor, by_setpoints: Predictor, starts: Integers, steps: int
) -> dict[str, Combination]:
    """Return the combinations that had the smallest errors from `starts` (on selection days)."""
    following = starts + 1 + np.arange(steps)[:, None]
    one, other = by_actuators(starts, steps), by_setpoints(starts, steps)
    usual_one = usual_error(record, by_actuators, starts, steps)
    usual_other = usual_error(record, by_setpoints, starts, steps)
    place = cells(record, starts, steps)
    result = {}
    for name, values in record.measured.items():
        measured = values[following]
        if not np.isfinite(measured).any():
            continue
        table = np.zeros((3, len(CELLS)))
        for cell in range(len(CELLS)):
            here = np.isfinite(measured) & (place == cell)
            wanted = measured[here]
            first = _share(wanted - one[name][here], usual_one[name][here])
            second = _share(wanted - other[name][here], usual_other[name][here])
            error_one = wanted - one[name][here] - first * usual_one[name][here]
            error_other = wanted - other[name][here] - second * usual_other[name][here]
            # measured = one + weight (other - one): a regression of error_one on error_one - error_other.
            table[:, cell] = first, second, _share(error_one, error_one - error_other)
        result[name] = Combination(*table)
    return result


def remembering(predict: Predictor) -> Predictor:
    """Return the predictor with a memory of what it was asked, for tables that ask the same twice."""
    known: dict[tuple[bytes, int], Mapping[str, Floats]] = {}

    def remembered(starts: Integers, steps: int) -> Mapping[str, Floats]:
        key = (starts.tobytes(), steps)
        if key not in known:
            known[key] = predict(starts, steps)
        return known[key]

    return remembered


def _share(target: Floats, regressor: Floats) -> float:
    """Return the least-squares factor of `regressor`, within 0 to 1."""
    power = float(np.sum(regressor**2))
    return float(np.clip(np.sum(target * regressor) / power, 0.0, 1.0)) if power > 0.0 else 0.0
