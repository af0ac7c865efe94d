"""Actuators that a log lacks: each a candidate of its own, at the course that the climate computer's rules gave it.

Where a greenhouse has lamps, pipes or screens and the log does not tell what they did, a calibrated actuation stage
does: it knows what the computer would have done with these setpoints in this climate. An actuator is the cause where
its course takes its share off the squared error of unseen days, beyond what recalibration does without it; the search
for other causes then goes on with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.simulator import actuation
from igrow.core.simulator.hybrid import climate, measurement, record
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis import freerun, sensitivity
from igrow.trainer.diagnosis.correction import LogDays, Stage
from igrow.trainer.diagnosis.estimate import normal_quantile
from igrow.trainer.diagnosis.knowledge import Knowledge, activate
from igrow.trainer.diagnosis.result import Interval
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.actuation import setpoint_columns
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.scales import ERROR_SCALES
from igrow.trainer.fit.solver import DivergenceError

REPLACEABLE = (*actuation.POSITIONS, "lamp_power")
"""Actuators that move the balances; without a dose the CO2 of a log tells nothing."""


@dataclass(frozen=True)
class Replaced:
    """An actuator that the log lacks and that explains what is missing."""

    actuator: str
    share: Interval
    """Of the course that the rules give it: one is what the computer would have done."""
    skill: float
    """Share of the squared error on unseen days that it removes beyond recalibration."""
    p_value: float
    """Bootstrap probability that it removes none."""
    effect_to_noise: float


@dataclass(frozen=True)
class Completed:
    """A log whose missing actuators have been looked for."""

    days: LogDays
    """With the courses of those that were found."""
    found: tuple[Replaced, ...]
    recalibrated: Stage | None
    """Fitted to the log as it is; None where nothing was found."""


def complete(
    log: Log, days: LogDays, model: FittedModel, knowledge: Knowledge, rules: DecisionRules, rng: np.random.Generator
) -> Completed:
    """Return a log with the courses of those actuators that it lacks and that explain its errors, the best first."""
    tried = {name: course for name, course in courses(log, days.record, model).items() if _moves(course)}
    plain: Stage | None = None
    found: list[Replaced] = []
    current = days
    while tried:
        name = min(tried, key=lambda name: _loss(_with(current, {name: tried[name]}), knowledge))
        course = tried.pop(name)
        trial = _with(current, {name: course})
        if _loss(trial, knowledge) >= _loss(current, knowledge):
            break
        before = Stage(current.fit(knowledge.prior, knowledge.terms), knowledge.terms)
        plain = plain or before
        judged = _judged(name, current, trial, before, knowledge, rules, rng)
        if judged is None:
            continue
        found.append(judged)
        current = trial
    return Completed(current, tuple(found), plain if found else None)


def courses(log: Log, seen: Record, model: FittedModel) -> dict[str, Floats]:
    """Return what the computer's rules would have done with every actuator that a log lacks, (n,) each."""
    lacking = [name for name in REPLACEABLE if name in seen.missing]
    if not lacking:
        return {}
    setpoints, _ = setpoint_columns(log.telemetry, seen)
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


def _moves(course: Floats) -> bool:
    return bool(np.isfinite(course).all() and np.ptp(course) > 0.0)


def _with(days: LogDays, inputs: Mapping[str, Floats]) -> LogDays:
    """Return the log with actuators in the place of those that it lacks."""
    seen = days.record
    missing = tuple(name for name in seen.missing if name not in inputs)
    return replace(days, record=replace(seen, inputs={**seen.inputs, **inputs}, missing=missing))


def _errors(days: LogDays, values: Mapping[str, float], knowledge: Knowledge) -> Floats:
    """Return the errors of day runs on the fit days over their usual size, 0 where they do not count, (3, r, steps)."""
    try:
        line = sensitivity.linearise(days.record, days.runs, values, activate(days.record, knowledge.terms))
    except DivergenceError:
        return np.full(days.runs.weight.shape, np.inf)
    scale = np.array([ERROR_SCALES[name] for name in measurement.PREDICTED])[:, None, None]
    counted: Floats = np.where(days.split.fit[days.runs.day][None, :, None], line.errors / scale, 0.0)
    return counted


def _loss(days: LogDays, knowledge: Knowledge) -> float:
    return float(np.sum(np.abs(_errors(days, knowledge.posterior.values, knowledge))))


def _judged(
    name: str,
    days: LogDays,
    trial: LogDays,
    before: Stage,
    knowledge: Knowledge,
    rules: DecisionRules,
    rng: np.random.Generator,
) -> Replaced | None:
    """Return the actuator where it stands on unseen days, None where it does not."""
    try:
        after = Stage(trial.fit(knowledge.prior, knowledge.terms), knowledge.terms)
    except DivergenceError:
        return None
    old, new = days.run(before), trial.run(after)
    if old is None or new is None:
        return None
    skill = freerun.skill(old, new)
    # A few held-out days say how much, all others whether: both models had as many parameters to fit to them.
    falls = _falls(_errors(days, before.posterior.values, knowledge), _errors(trial, after.posterior.values, knowledge))
    draws = falls[rng.integers(0, len(falls), size=(rules.bootstrap_draws, len(falls)))].mean(axis=1)
    p_value = float((1.0 + np.sum(draws <= 0.0)) / (1.0 + len(draws)))
    share = _share(days, trial, after, knowledge, rules)
    if skill < rules.clear_skill or p_value > rules.largest_actuator_p or share.low <= 0.0:
        return None
    bare = days.run(after)
    moved = 0.0 if bare is None else freerun.effect_to_noise(bare, new)
    return Replaced(name, share, skill, p_value, moved)


def _falls(before: Floats, after: Floats) -> Floats:
    """Return the fall of the squared error of every day run, (r,)."""
    falls: Floats = np.sum(before**2 - after**2, axis=(0, 2))
    return falls


def _share(days: LogDays, trial: LogDays, stage: Stage, knowledge: Knowledge, rules: DecisionRules) -> Interval:
    """Return the share of a course that explains most, by least squares, with the scatter of days as its error."""
    without = _errors(days, stage.posterior.values, knowledge)
    moved = without - _errors(trial, stage.posterior.values, knowledge)
    score, curvature = (np.sum(moved * part, axis=(0, 2)) for part in (without, moved))
    value = float(score.sum() / max(curvature.sum(), 1e-12))
    scatter = float(np.sqrt(np.sum((score - value * curvature) ** 2)) / max(curvature.sum(), 1e-12))
    reach = normal_quantile(rules) * rules.deviation_inflation * scatter
    return Interval(value, value - reach, value + reach, "1")
