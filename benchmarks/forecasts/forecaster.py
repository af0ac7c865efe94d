"""All that a log teaches about a site's forecasts: parameters, residual model, disturbance, rules, intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.forecasts.closed_loop import refine_actuation
from benchmarks.forecasts.combination import Combination, fit_combination, remembering
from benchmarks.forecasts.disturbance import (
    CHANNELS,
    DisturbanceModel,
    fit_disturbance,
    helpful_channels,
    missing_fluxes,
    observed_runs,
    run_fluxes,
)
from benchmarks.forecasts.output_statistics import (
    OutputStatistics,
    all_runs,
    corrected_runs,
    fit_output_statistics,
)
from benchmarks.forecasts.residual_model import ResidualModel, fit_residual_model
from benchmarks.forecasts.uncertainty import ErrorGrowth, growth_of_runs
from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.simulator.closed_loop import closed_run
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.actuation import fit_actuation
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import Predictor, errors_of, starts_within, summarise
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import ERROR_SCALES
from igrow.trainer.progress import Progress, silent

_PENALTIES = (0.03, 0.1, 0.3, 1.0)
_WIDENING = 1.5
"""By which the spread of other compartments' parameters is held too small for a new one."""
_STEP = 900.0
"""Seconds between the rows that parameters and rules are fitted on: several times as fast as 5 minutes."""


@dataclass(frozen=True)
class Forecaster:
    """The fitted hybrid simulator of a site."""

    posterior: Gaussian
    effects: ActiveEffects
    residual_model: ResidualModel | None
    disturbance: DisturbanceModel
    rules: Mapping[str, float]
    """Of the actuation stage."""
    growth: Mapping[str, ErrorGrowth]
    """By quantity, of runs driven by measured actuators."""
    closed_growth: Mapping[str, ErrorGrowth]
    """By quantity, of runs driven by setpoints."""
    combinations: Mapping[str, Combination]
    """By quantity, how forecasts combine both ways to run."""
    statistics: OutputStatistics
    """What combined forecasts still miss."""
    combined_growth: Mapping[str, ErrorGrowth]
    """By quantity, of combined forecasts."""

    def added(self, record: Record) -> dict[str, Floats]:
        """Return the residual model's fluxes along a record, (n,) by channel."""
        return self.residual_model.fluxes(record) if self.residual_model is not None else {}

    def predictor(self, record: Record) -> Predictor:
        """Return `predict(starts, steps)`: runs driven by the measured actuators."""
        return observed_runs(record, self.posterior.values, self.effects, self.added(record), self.disturbance)

    def closed_predictor(self, record: Record, setpoints: Mapping[str, Floats]) -> Predictor:
        """Return `predict(starts, steps)`: runs driven by setpoints and weather through the actuation stage."""
        values, added = self.posterior.values, self.added(record)
        states = records.observe(record, values, self.effects)
        missing = missing_fluxes(record, values, self.effects, added)

        def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
            fluxes = run_fluxes(record, values, self.effects, starts, steps, added, self.disturbance, missing)
            return closed_run(record, states, setpoints, starts, steps, values, self.effects, dict(self.rules), fluxes)

        return predict

    def combined_predictor(
        self, record: Record, setpoints: Mapping[str, Floats], by_actuators: Predictor, by_setpoints: Predictor
    ) -> Predictor:
        """Return `predict(starts, steps)`: both ways to run combined, what they usually miss taken off.

        `by_actuators` and `by_setpoints` are this model's `predictor` and `closed_predictor` of the same record.
        """

        def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
            runs = all_runs(record, by_actuators, by_setpoints, self.combinations, starts, steps)
            return corrected_runs(record, setpoints, self.statistics, runs, starts)

        return predict


def fit_forecaster(
    parts: Sequence[tuple[Record, Mapping[str, Floats], Mask, Mask]],
    prior: Gaussian,
    effects: ActiveEffects,
    *,
    actuation: bool = True,
    progress: Progress = silent,
) -> Forecaster:
    """Fit all stages to logs of one kind of greenhouse.

    Args:
        parts: records with their setpoints by name, (n,), the rows to fit on, and the rows to choose and to measure
            the uncertainty on (selection), which no fit sees.
        prior: the prior of the parameters.
        effects: the active effects.
        actuation: fit the rules too.
        progress: is told what is being done.
    """
    posterior = fit_climate([_working(record, fit) for record, _, fit, _ in parts], prior, effects, progress=progress)
    values = posterior.values
    lacking = [(record, fit, missing_fluxes(record, values, effects)) for record, _, fit, _ in parts]
    residual_model = _choose_residual_model(parts, lacking, posterior, effects)
    progress(
        "residual model on weather and clock: "
        + ("kept" if residual_model is not None else "of no use on selection weeks")
    )
    known = [residual_model.fluxes(record) if residual_model is not None else {} for record, _, _, _ in parts]
    disturbance = fit_disturbance(
        [
            (record, fit, missing_fluxes(record, values, effects, added))
            for (record, _, fit, _), added in zip(parts, known, strict=True)
        ]
    )
    chosen = helpful_channels(
        lambda channels: _selection_errors(parts, posterior, effects, known, disturbance.restricted(channels))
    )
    disturbance = disturbance.restricted(chosen)
    progress(f"observed disturbance goes on in: {', '.join(one for one in CHANNELS if one in chosen) or 'nothing'}")
    rules: dict[str, float] = {}
    if actuation:
        rules = fit_actuation([(record, setpoints, fit) for record, setpoints, fit, _ in parts], values)
        rules = _refined(parts[0], values, rules, residual_model, disturbance)
        progress("actuation stage fitted in closed loop")
    model = Forecaster(posterior, effects, residual_model, disturbance, rules, {}, {}, {}, {}, {})
    model = replace(model, growth=growth_of_runs([(part[0], part[3], model.predictor(part[0])) for part in parts]))
    if not actuation:
        return model
    closed = [(part[0], part[3], model.closed_predictor(part[0], part[1])) for part in parts]
    record, selection, _ = closed[0]
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, selection, steps, round(10_500.0 / record.step))
    model = replace(model, closed_growth=growth_of_runs(closed))
    if len(starts) == 0:
        return model
    by_actuators, by_setpoints = remembering(model.predictor(record)), remembering(closed[0][2])
    model = replace(model, combinations=fit_combination(record, by_actuators, by_setpoints, starts, steps))
    setpoints, fit = parts[0][1:3]

    def corrected(rows: Mask) -> Forecaster:
        begin = starts_within(record, rows, steps, round(10_500.0 / record.step))
        if len(begin) == 0:
            return model
        runs = all_runs(record, by_actuators, by_setpoints, model.combinations, begin, steps)
        return replace(model, statistics=fit_output_statistics(record, setpoints, runs, begin))

    # The uncertainty is that of a correction which has not seen the selection weeks; the one in use has seen all.
    doubted = corrected(fit).combined_predictor(record, setpoints, by_actuators, by_setpoints)
    return replace(corrected(fit | selection), combined_growth=growth_of_runs([(record, selection, doubted)]))


def adapt(model: Forecaster, record: Record, rows: Mask) -> Forecaster:
    """Return a model of other compartments brought to a new one of which there are few days.

    Only the parameters move, under their posterior with standard deviations `_WIDENING` times as large; residual
    model and disturbance are kept, since a week tells nothing about them.
    """
    known = model.posterior
    prior = Gaussian(known.names, known.mean, known.covariance * _WIDENING**2)
    return replace(model, posterior=fit_climate([_working(record, rows)], prior, model.effects))


def from_few_days(record: Record, rows: Mask, prior: Gaussian) -> Forecaster:
    """Return a model of a site of which there are few days and nothing else: parameters, and usual disturbances."""
    posterior = fit_climate([_working(record, rows)], prior)
    return Forecaster(posterior, {}, None, DisturbanceModel(), {}, {}, {}, {}, {}, {})


def _working(record: Record, rows: Mask) -> tuple[Record, Mask]:
    """Return a record on the step that models are fitted on, and which of its rows may be used."""
    factor = max(1, int(_STEP // record.step))
    whole = len(rows) // factor * factor
    return record.coarser(factor), np.asarray(rows[:whole].reshape(-1, factor).all(axis=1))


def _refined(
    part: tuple[Record, Mapping[str, Floats], Mask, Mask],
    parameters: Mapping[str, float],
    rules: Mapping[str, float],
    residual_model: ResidualModel | None,
    disturbance: DisturbanceModel,
) -> dict[str, float]:
    """Return the rules refitted in closed loop, with what the forecasts take along."""
    fine, setpoints, fit, _ = part
    record, rows = _working(fine, fit)
    factor = round(record.step / fine.step)
    coarse = {
        name: values[: len(record) * factor].reshape(-1, factor).mean(axis=1) for name, values in setpoints.items()
    }
    added = residual_model.fluxes(record) if residual_model is not None else {}

    def fluxes(along: Record, starts: Integers, steps: int) -> Mapping[str, Floats]:
        return run_fluxes(along, parameters, {}, starts, steps, added, disturbance)

    return refine_actuation(record, coarse, parameters, rules, rows=rows, fluxes=fluxes)


def _choose_residual_model(
    parts: Sequence[tuple[Record, Mapping[str, Floats], Mask, Mask]],
    lacking: Sequence[tuple[Record, Mask | None, Mapping[str, Floats]]],
    posterior: Gaussian,
    effects: ActiveEffects,
) -> ResidualModel | None:
    """Return the residual model that helps most on the selection weeks, or None where none helps."""
    usual = DisturbanceModel()

    def score(residual_model: ResidualModel | None) -> float:
        added = [residual_model.fluxes(record) if residual_model is not None else {} for record, _, _, _ in parts]
        return sum(_selection_errors(parts, posterior, effects, added, usual).values())

    candidates: list[ResidualModel | None] = [None, *(fit_residual_model(lacking, penalty) for penalty in _PENALTIES)]
    return min(candidates, key=score)


def _selection_errors(
    parts: Sequence[tuple[Record, Mapping[str, Floats], Mask, Mask]],
    posterior: Gaussian,
    effects: ActiveEffects,
    added: Sequence[Mapping[str, Floats]],
    disturbance: DisturbanceModel,
) -> dict[str, float]:
    """Return the 24 h error of every quantity on selection weeks, in `ERROR_SCALES`, the sum of all parts."""
    total: dict[str, float] = {}
    for (record, _, _, selection), known in zip(parts, added, strict=True):
        predict = observed_runs(record, posterior.values, effects, known, disturbance)
        errors = summarise([errors_of(record, predict, ("24_h",), selection, every=18_900.0)])
        for quantity, by_horizon in errors.items():
            # Without the dose CO2 tells nothing.
            if not (quantity == "air_co2" and "co2_dosing" in record.missing):
                total[quantity] = total.get(quantity, 0.0) + by_horizon["24_h"].mae / ERROR_SCALES[quantity]
    return total
