"""Actuators that a log lacks: each a candidate of its own, at the course that the climate computer's rules gave it.

Where a greenhouse has lamps, pipes or screens and the log does not tell what they did, a calibrated actuation stage
does: it knows what the computer would have done with these setpoints in this climate. How much of that course the
errors ask for is fitted beside the parameters, under what is known of these: without its pipes a greenhouse is
predicted cold, and a recalibration that makes up for them bends walls and leaks far from where the calibration left
them. An actuator is named where it is far likelier to have followed the rules than to have stood still; the search for
other causes then goes on with it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.bundle import Estimate
from igrow.core.simulator import actuation
from igrow.core.simulator.hybrid import climate, measurement, record
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.design import freerun, linear, sensitivity
from igrow.trainer.diagnosis.design.freerun import SCALES, LogDays, Stage
from igrow.trainer.diagnosis.knowledge import Knowledge, activate
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.estimate import normal_quantile
from igrow.trainer.fit.actuation import setpoint_columns
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.scales import CORRELATION_TIME
from igrow.trainer.fit.solver import DivergenceError

REPLACEABLE = (*actuation.POSITIONS, "lamp_power")
"""Actuators that move the balances; without a dose the CO2 of a log tells nothing."""
VENTS = frozenset({"vent_lee", "vent_wind"})


@dataclass(frozen=True)
class Share:
    """Of a course that the errors ask for: one is what the rules say, none is an actuator that stood still."""

    value: float
    deviation: float

    @property
    def log_odds(self) -> float:
        """Of having followed the rules against having stood still."""
        return (self.value - 0.5) / self.deviation**2

    def interval(self, rules: DecisionRules) -> Estimate:
        """Return it with its interval."""
        return Estimate.about(self.value, normal_quantile(rules) * self.deviation, "1")


@dataclass(frozen=True)
class Replaced:
    """An actuator that the log lacks and that explains what is missing."""

    actuator: str
    share: Estimate
    """Of the course that the rules give it: one is what the computer would have done."""
    skill: float
    """Share of the squared error on unseen days that it removes beyond recalibration."""
    stood_still: float
    """Probability of that against having followed the rules."""
    effect_to_noise: float


@dataclass(frozen=True)
class Completed:
    """A log whose missing actuators have been looked for."""

    days: LogDays
    """With the courses of those that were found."""
    found: tuple[Replaced, ...]
    recalibrated: Stage | None
    """Fitted to the log as it is; None where nothing was found."""


def complete(log: Log, days: LogDays, model: FittedModel, knowledge: Knowledge, rules: DecisionRules) -> Completed:
    """Return a log with the courses of those actuators that it lacks and that explain its errors, the best first."""
    known = courses(log, days.record, model)
    tried = {name: course for name, course in known.items() if np.isfinite(course).all() and np.ptp(course) > 0.0}
    plain: Stage | None = None
    found: list[Replaced] = []
    current = days
    while tried:
        name = min(tried, key=lambda name: _loss(with_inputs(current, {name: tried[name]}), knowledge))
        course = tried.pop(name)
        trial = with_inputs(current, {name: course})
        if _loss(trial, knowledge) >= _loss(current, knowledge):
            break
        try:
            share = share_of_course(current, trial, knowledge, rules)
            if share.log_odds < rules.least_actuator_odds:
                continue
            before = Stage(current.fit(knowledge.prior, knowledge.terms), knowledge.terms)
            judged = _judged(name, current, trial, before, share, knowledge, rules)
        except DivergenceError:
            continue
        if judged is None:
            continue
        plain = plain or before
        found.append(judged)
        current = trial
    return Completed(current, tuple(found), plain if found else None)


def may_hide_in_parameters(missing: Collection[str]) -> bool:
    """Tell whether an actuator is among the columns that a log lacks; a greenhouse may have one row of vents alone."""
    lacking = set(REPLACEABLE).intersection(missing)
    return bool(lacking if lacking >= VENTS else lacking - VENTS)


def courses(log: Log, seen: Record, model: FittedModel) -> dict[str, Floats]:
    """Return what the computer's rules would have done with every actuator that a log lacks, (n,) each."""
    lacking = [name for name in REPLACEABLE if name in seen.missing]
    if not lacking:
        return {}
    setpoints, _ = setpoint_columns(log.telemetry, seen, model.site)
    states = record.observe(seen, model.posterior.values, {})
    drivers = climate.derive(np, states, seen.inputs, model.posterior.values, seen.lamp_efficacy)
    shown = {name: np.broadcast_to(drivers[name], (len(seen),)) for name in (*measurement.PREDICTED, "par")}
    weather = {name: seen.inputs[name] for name in ("outdoor_temperature", "global_radiation", "wind_speed")}
    memory = {name: np.array(seen.inputs[name]) for name in actuation.POSITIONS}
    for name in lacking:
        if name.endswith("pipe_temperature"):
            memory[name] = shown["air_temperature"].copy()
    done = {name: np.zeros(len(seen)) for name in lacking}
    for row in range(len(seen)):
        set_, around, inside, before = (
            {name: values[row] for name, values in part.items()} for part in (setpoints, weather, shown, memory)
        )
        after = actuation.act(np, set_, around, inside, before, model.actuation, seconds=seen.step)
        for name in lacking:
            done[name][row] = after[name]
            if name in memory and row + 1 < len(seen):
                memory[name][row + 1] = after[name]
    return done


def with_inputs(days: LogDays, inputs: Mapping[str, Floats]) -> LogDays:
    """Return the log with actuators, (n,) each, in the place of those that it lacks."""
    seen = days.record
    missing = tuple(name for name in seen.missing if name not in inputs)
    return replace(days, record=replace(seen, inputs={**seen.inputs, **inputs}, missing=missing))


def _loss(days: LogDays, knowledge: Knowledge) -> float:
    """Return the sum of the absolute errors of day runs on the fit days, over their usual size."""
    values, effects = knowledge.posterior.values, activate(days.record, knowledge.terms)
    try:
        line = sensitivity.linearise(days.record, days.runs, values, effects)
    except DivergenceError:
        return float("inf")
    return float(np.sum(np.abs(line.errors / SCALES) * days.split.fit[days.runs.day][None, :, None]))


def share_of_course(days: LogDays, trial: LogDays, knowledge: Knowledge, rules: DecisionRules) -> Share:
    """Return the share of a course that is fitted beside the parameters, about those of the calibration.

    Args:
        days: the log without the course.
        trial: the log with it.
        knowledge: of the greenhouse; its prior of the parameters counts.
        rules: how much wider than the scatter of days the deviation is.

    Raises:
        DivergenceError: the model runs out of all bounds on one of the two.
    """
    prior, values = knowledge.prior, knowledge.posterior.values
    counted = days.runs.weight & trial.runs.weight
    bare, dressed = (
        sensitivity.linearise(one.record, one.runs, values, activate(one.record, knowledge.terms))
        for one in (days, trial)
    )
    slopes = sensitivity.bounded_parameter_sensitivities(dressed, prior.names, prior.standard_deviation)
    columns = np.concatenate([bare.errors[None], slopes, (dressed.errors - bare.errors)[None]])
    weighted = np.where(counted, columns / SCALES, 0.0) * np.sqrt(days.record.step / CORRELATION_TIME)
    grams = linear.DailyGrams(linear.daily_products(weighted, days.runs.day, days.split.days), days.split.fit)
    moved = prior.mean - np.array([values[name] for name in prior.names])
    base = tuple(range(1, len(slopes) + 1))
    course = linear.Term(len(slopes) + 1)
    fitted = linear.fit(grams, linear.LinearModel(base, prior.precision, moved, (course,)))
    deviation = rules.deviation_inflation * linear.deviation_by_day(grams, fitted)
    return Share(float(fitted.amplitudes[-1]), deviation)


def _judged(
    name: str, days: LogDays, trial: LogDays, before: Stage, share: Share, knowledge: Knowledge, rules: DecisionRules
) -> Replaced | None:
    """Return the actuator with what it does on unseen days, None where there are none; may raise DivergenceError."""
    after = Stage(trial.fit(knowledge.prior, knowledge.terms), knowledge.terms)
    old, new, bare = days.run(before), trial.run(after), days.run(after)
    if old is None or new is None or bare is None:
        return None
    stood_still = float(1.0 / (1.0 + np.exp(share.log_odds)))
    moved = freerun.effect_to_noise(bare, new)
    return Replaced(name, share.interval(rules), freerun.skill(old, new), stood_still, moved)
