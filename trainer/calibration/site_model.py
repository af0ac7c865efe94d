"""All that one log teaches about a site, in one go: parameters, remainder, disturbance, rules, doubt and range."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.closed_loop import closed_run
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.disturbance import DisturbanceModel, missing_fluxes
from igrow.core.simulator.hybrid.record import Record
from igrow.core.simulator.uncertainty import ErrorGrowth, TrainingRange, error_growth, training_range
from igrow.trainer.calibration.actuation import fit_actuation, refine_actuation
from igrow.trainer.calibration.correction import Correction, all_runs, apply_correction, fit_correction
from igrow.trainer.calibration.disturbance import fit_disturbance
from igrow.trainer.calibration.evaluation import evaluate, run_fluxes, starts_within
from igrow.trainer.calibration.fit import calibrate
from igrow.trainer.calibration.forecast import Combination, Predictor, fit_combination, remembering
from igrow.trainer.calibration.posterior import Posterior
from igrow.trainer.calibration.remainder import Remainder, fit_remainder

Floats = NDArray[np.float64]

RANGE_DRIVERS = (
    "outdoor_temperature",
    "global_radiation",
    "wind_speed",
    "air_temperature",
    "air_humidity",
    "air_co2",
    "heating_setpoint",
    "co2_setpoint",
    "lamp_on",
)
"""What the training range watches: weather, climate and setpoints of a plan."""
_INDEPENDENT = {24.0: 3.0, 168.0: 1.0}
"""Length of runs in hours -> independent errors that a day is worth, for the width of intervals: within a day morning,
noon and night differ; of runs of a week the errors last from day to day, and one a day is generous."""
_PENALTIES = (0.03, 0.1, 0.3, 1.0)


@dataclass(frozen=True)
class SiteModel:
    """The fitted hybrid simulator of a site."""

    posterior: Posterior
    effects: ActiveEffects
    remainder: Remainder | None
    disturbance: DisturbanceModel
    rules: Mapping[str, float]
    """Of the actuation stage."""
    growth: Mapping[str, ErrorGrowth]
    """By quantity, of runs driven by measured actuators."""
    closed_growth: Mapping[str, ErrorGrowth]
    """By quantity, of runs driven by setpoints."""
    combinations: Mapping[str, Combination]
    """By quantity, how forecasts combine both ways to run."""
    correction: Correction
    """What combined forecasts still miss."""
    combined_growth: Mapping[str, ErrorGrowth]
    """By quantity, of combined forecasts."""
    range: TrainingRange

    def added(self, record: Record) -> dict[str, Floats]:
        """Return the remainder's fluxes along a record, (n,) by channel."""
        return self.remainder.fluxes(record) if self.remainder is not None else {}

    def predictor(self, record: Record) -> Callable[[NDArray[np.int64], int], dict[str, Floats]]:
        """Return `predict(starts, steps)`: runs driven by the measured actuators."""
        values, added = self.posterior.values, self.added(record)
        states = records.observe(record, values, self.effects)
        missing = missing_fluxes(record, values, self.effects, added)

        def predict(starts: NDArray[np.int64], steps: int) -> dict[str, Floats]:
            fluxes = run_fluxes(record, values, self.effects, starts, steps, added, self.disturbance, missing)
            return records.free_run(record, states, starts, steps, values, self.effects, fluxes)

        return predict

    def closed_predictor(
        self, record: Record, setpoints: Mapping[str, Floats]
    ) -> Callable[[NDArray[np.int64], int], dict[str, Floats]]:
        """Return `predict(starts, steps)`: runs driven by setpoints and weather through the actuation stage."""
        values, added = self.posterior.values, self.added(record)
        states = records.observe(record, values, self.effects)
        missing = missing_fluxes(record, values, self.effects, added)

        def predict(starts: NDArray[np.int64], steps: int) -> dict[str, Floats]:
            fluxes = run_fluxes(record, values, self.effects, starts, steps, added, self.disturbance, missing)
            return closed_run(record, states, setpoints, starts, steps, values, self.effects, dict(self.rules), fluxes)

        return predict

    def combined_predictor(
        self, record: Record, setpoints: Mapping[str, Floats], by_actuators: Predictor, by_setpoints: Predictor
    ) -> Predictor:
        """Return `predict(starts, steps)`: both ways to run combined, what they usually miss taken off.

        `by_actuators` and `by_setpoints` are this model's `predictor` and `closed_predictor` of the same record.
        """

        def predict(starts: NDArray[np.int64], steps: int) -> Mapping[str, Floats]:
            runs = all_runs(record, by_actuators, by_setpoints, self.combinations, starts, steps)
            return apply_correction(record, setpoints, self.correction, runs, starts)

        return predict


def fit_site(
    parts: Sequence[tuple[Record, Mapping[str, Floats], NDArray[np.bool_], NDArray[np.bool_]]],
    knowledge: Posterior,
    effects: ActiveEffects,
    *,
    actuation: bool = True,
    progress: Callable[[str], None] | None = None,
) -> SiteModel:
    """Fit all stages to logs of one kind of greenhouse.

    Args:
        parts: records with their setpoints by name, (n,), the rows to fit on, and the rows to choose and to measure
            the doubt on (selection), which no fit sees.
        knowledge: the prior of the parameters.
        effects: the active effects.
        actuation: fit the rules too.
        progress: is told what is being done.
    """
    say = progress or (lambda _line: None)
    posterior = calibrate([(record, fit) for record, _, fit, _ in parts], knowledge, effects, progress=progress)
    values = posterior.values
    lacking = [(record, fit, missing_fluxes(record, values, effects)) for record, _, fit, _ in parts]
    remainder = _choose_remainder(parts, lacking, posterior, effects)
    say("remainder on weather and clock: " + ("kept" if remainder is not None else "of no use on selection weeks"))
    known = [remainder.fluxes(record) if remainder is not None else {} for record, _, _, _ in parts]
    disturbance = fit_disturbance(
        [
            (record, fit, missing_fluxes(record, values, effects, added))
            for (record, _, fit, _), added in zip(parts, known, strict=True)
        ]
    )
    rules: dict[str, float] = {}
    if actuation:
        rules = fit_actuation([(record, setpoints, fit) for record, setpoints, fit, _ in parts], values)
        record, setpoints, fit, _ = parts[0]
        rules = refine_actuation(record, setpoints, fit, values, rules, remainder=known[0], disturbance=disturbance)
        say("actuation stage fitted in closed loop")
    table = {
        name: np.concatenate([_driver(part[0], part[1], name)[part[2]] for part in parts]) for name in RANGE_DRIVERS
    }
    model = SiteModel(
        posterior, effects, remainder, disturbance, rules, {}, {}, {}, {}, {}, training_range(_complete(table))
    )
    model = replace(model, growth=_growth([(part[0], part[3], model.predictor(part[0])) for part in parts]))
    if not actuation:
        return model
    closed = [(part[0], part[3], model.closed_predictor(part[0], part[1])) for part in parts]
    record, selection, _ = closed[0]
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, selection, steps, round(10_500.0 / record.step))
    model = replace(model, closed_growth=_growth(closed))
    if len(starts) == 0:
        return model
    by_actuators, by_setpoints = remembering(model.predictor(record)), remembering(closed[0][2])
    model = replace(model, combinations=fit_combination(record, by_actuators, by_setpoints, starts, steps))
    setpoints, fit = parts[0][1:3]

    def corrected(rows: NDArray[np.bool_]) -> SiteModel:
        begin = starts_within(record, rows, steps, round(10_500.0 / record.step))
        if len(begin) == 0:
            return model
        runs = all_runs(record, by_actuators, by_setpoints, model.combinations, begin, steps)
        return replace(model, correction=fit_correction(record, setpoints, runs, begin))

    # The doubt is that of a correction which has not seen the selection weeks; the one in use has seen all.
    doubted = corrected(fit).combined_predictor(record, setpoints, by_actuators, by_setpoints)
    return replace(corrected(fit | selection), combined_growth=_growth([(record, selection, doubted)]))


def adapt(model: SiteModel, record: Record, rows: NDArray[np.bool_], widening: float = 1.5) -> SiteModel:
    """Return a model of other compartments brought to a new one of which there are few days.

    Only the parameters move, under their posterior with standard deviations `widening` times as large; remainder and
    disturbance are kept, since a week tells nothing about them.
    """
    return replace(model, posterior=calibrate([(record, rows)], model.posterior.widened(widening), model.effects))


def from_few_days(record: Record, rows: NDArray[np.bool_], knowledge: Posterior) -> SiteModel:
    """Return a model of a site of which there are few days and nothing else: parameters, and usual disturbances."""
    posterior = calibrate([(record, rows)], knowledge, {})
    table = {name: _driver(record, {}, name)[rows] for name in RANGE_DRIVERS}
    return SiteModel(posterior, {}, None, DisturbanceModel(), {}, {}, {}, {}, {}, {}, training_range(_complete(table)))


def _choose_remainder(
    parts: Sequence[tuple[Record, Mapping[str, Floats], NDArray[np.bool_], NDArray[np.bool_]]],
    lacking: Sequence[tuple[Record, NDArray[np.bool_] | None, Mapping[str, Floats]]],
    posterior: Posterior,
    effects: ActiveEffects,
) -> Remainder | None:
    """Return the remainder that helps most on the selection weeks, or None where none helps."""
    usual = DisturbanceModel()

    def score(remainder: Remainder | None) -> float:
        total = 0.0
        for record, _, _, selection in parts:
            added = remainder.fluxes(record) if remainder is not None else None
            errors = evaluate(
                record, posterior, effects, ("24_h",), selection, added=added, disturbance=usual, every=18_900.0
            )
            total += sum(
                by_horizon["24_h"].mae / {"air_temperature": 0.5, "air_humidity": 3.0}.get(quantity, 35.0)
                for quantity, by_horizon in errors.items()
                if not (quantity == "air_co2" and "co2_dosing" in record.unknown)
            )
        return total

    candidates: list[Remainder | None] = [None, *(fit_remainder(lacking, penalty) for penalty in _PENALTIES)]
    return min(candidates, key=score)


def _growth(
    parts: Sequence[tuple[Record, NDArray[np.bool_], Callable[[NDArray[np.int64], int], Mapping[str, Floats]]]],
) -> dict[str, ErrorGrowth]:
    """Return the growth of errors on selection rows: a day from runs of a day, a week from runs as long as fit in."""
    pooled: dict[str, list[tuple[Floats, Floats, Floats, float]]] = {}
    for record, rows, predict in parts:
        for hours, every in ((24.0, 7500.0), (168.0, 29_700.0)):
            steps = round(hours * 3600.0 / record.step)
            starts = starts_within(record, rows, steps, max(1, round(every / record.step)))
            if len(starts) == 0:
                continue
            following = starts + 1 + np.arange(steps)[:, None]
            lead: Floats = np.arange(1.0, steps + 1.0) * (record.step / 3600.0)
            days = len(np.unique(record.time[following].astype("datetime64[D]")))
            keep = lead > 24.0 if hours > 24.0 else lead > 0.0
            for quantity, predicted in predict(starts, steps).items():
                if quantity in record.measured:
                    error = record.measured[quantity][following] - predicted
                    sun = record.inputs["global_radiation"][following]
                    independent = _INDEPENDENT[hours] * days
                    pooled.setdefault(quantity, []).append((lead[keep], error[keep], sun[keep], independent))
    growth = {}
    for quantity, pieces in pooled.items():
        parts_of_growth = [
            error_growth(error, lead, sun, independent=independent) for lead, error, sun, independent in pieces
        ]
        first = parts_of_growth[0]
        later = [one for one in parts_of_growth[1:] if one.hours[0] > first.hours[-1]]
        growth[quantity] = ErrorGrowth(
            np.concatenate([first.hours, *(one.hours for one in later)]),
            np.concatenate([first.low, *(one.low for one in later)], axis=1),
            np.concatenate([first.high, *(one.high for one in later)], axis=1),
        )
    return growth


def _driver(record: Record, setpoints: Mapping[str, Floats], name: str) -> Floats:
    for source in (record.inputs, record.measured, setpoints):
        if name in source:
            return source[name]
    return np.full(len(record), np.nan)


def _complete(table: Mapping[str, Floats]) -> dict[str, Floats]:
    known = {name: values for name, values in table.items() if np.isfinite(values).any()}
    rows = np.all([np.isfinite(values) for values in known.values()], axis=0)
    return {name: values[rows] for name, values in known.items()}
