"""What a fitted site promises about energy, how certainly, against what was measured: daily totals and coverage."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from benchmarks.forecasts.forecaster import Forecaster
from benchmarks.forecasts.uncertainty import ErrorGrowth
from igrow.core.arrays import Floats, Mask
from igrow.core.simulator.closed_loop import pipe_heat
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor, starts_within

_DAYS = 6
"""Days that are looked back for how much more or less was used than predicted."""
TOTALS = {
    "heat (MJ m-2)": ("heat", 0.0864),
    "ventilation (m3 m-2)": ("ventilation", 86_400.0),
    "lamp electricity (kWh m-2)": ("lamp_power", 0.024),
    "CO2 (kg m-2)": ("co2_dosing", 24.0),
}
"""Daily total -> what it is the mean of over a run, and the factor to its unit."""


def daily_totals(
    record: Record, setpoints: Mapping[str, Floats], model: Forecaster, rows: Mask, begin: Mask | None = None
) -> dict[str, Floats]:
    """Return daily totals predicted from setpoints and measured, by name, (2, days).

    The prediction is scaled by what was used over what was predicted in the `_DAYS` days before. Days begin at each
    24 h that lies whole within `rows` (and starts within `begin`). Heat and ventilation are measured through pipes
    and vents, with the same coefficients as the prediction: there is no meter for them.
    """
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, rows, steps, steps)
    if begin is not None:
        starts = starts[begin[starts]]
    if len(starts) == 0 or not model.rules:
        return {}
    predict = model.closed_predictor(record, setpoints)
    predicted = predict(starts, steps)
    back = np.arange(1, _DAYS + 1)[:, None] * steps
    there = starts - back >= 0
    past = np.where(there, starts - back, 0)
    earlier = predict(past.ravel(), steps)
    values = model.posterior.values
    states = records.observe(record, values, model.effects)
    drivers = climate.derive(np, states, record.inputs, values, record.lamp_efficacy)
    measured = {
        "heat": pipe_heat(drivers, values),
        "ventilation": drivers["ventilation"],
        "lamp_power": record.inputs["lamp_power"],
        "co2_dosing": record.inputs["co2_dosing"],
    }
    ahead = starts + np.arange(steps)[:, None]
    result = {}
    for name, (source, factor) in TOTALS.items():
        if source in record.missing:
            continue
        expected = np.where(there, earlier[source].mean(axis=0).reshape(past.shape), 0.0).sum(axis=0)
        used = measured[source][past[None] + np.arange(steps)[:, None, None]].mean(axis=0)
        used = np.where(there, used, 0.0).sum(axis=0)
        # Two days' worth of "no error" keeps the factor near one where little was used.
        steady = 2.0 * float(np.mean(measured[source])) + 1e-12
        today = predicted[source].mean(axis=0) * (used + steady) / (expected + steady)
        result[name] = factor * np.stack([today, measured[source][ahead].mean(axis=0)])
    return result


def coverage(
    record: Record,
    predictors: Mapping[str, tuple[Predictor, Mapping[str, ErrorGrowth]]],
    rows: Mask,
    begin: Mask | None = None,
    every: float = 11_100.0,
) -> dict[tuple[str, str], tuple[float, float]]:
    """Return how many measurements lay within the 90 % intervals, and how many there were.

    By (name of the predictor, "quantity horizon"): at 1 h, over 24 h, over 7 days.

    Args:
        record: the log.
        predictors: with the error growth of each quantity, by name.
        rows: a run counts only if all its rows are among these, (n,).
        begin: rows at which runs may start, (n,); None: all.
        every: seconds between starts.
    """
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for how, (predict, growth) in predictors.items():
        for horizon, hours in (("1_h", 1.0), ("24_h", 24.0), ("7_d", 168.0)):
            steps = round(hours * 3600.0 / record.step)
            starts = starts_within(record, rows, steps, max(1, round(every / record.step)))
            if begin is not None:
                starts = starts[begin[starts]]
            if len(starts) == 0:
                continue
            following = starts + 1 + np.arange(steps)[:, None]
            lead: Floats = np.arange(1.0, steps + 1.0)[:, None] * (record.step / 3600.0)
            sun = record.inputs["global_radiation"][following]
            for quantity, predicted in predict(starts, steps).items():
                if quantity not in growth or quantity not in record.measured:
                    continue
                low, high = growth[quantity].interval(predicted, lead, sun)
                measured = record.measured[quantity][following]
                if horizon == "1_h":
                    low, high, measured = low[-1:], high[-1:], measured[-1:]
                known = np.isfinite(measured)
                inside = (measured >= low) & (measured <= high)
                found[how, f"{quantity} {horizon}"] = (float(inside[known].sum()), float(known.sum()))
    return found
