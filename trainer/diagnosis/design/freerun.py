"""The days of a log: parameters fitted to free runs on some, errors and skill on those that nothing was fitted to.

A forecast is judged by its free run, so the parameters that are shipped are those that serve it. That is what
`recalibrated` and `corrected` mean in the tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid import measurement
from igrow.core.simulator.hybrid.record import Record, complete_starts, free_run, observe
from igrow.trainer.data.log import Log
from igrow.trainer.data.splits import DaySplit, folds, split_days
from igrow.trainer.diagnosis.design import sensitivity
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.design.sensitivity import DayRuns, Linearisation
from igrow.trainer.diagnosis.knowledge import ActiveTerm, activate, clipped
from igrow.trainer.fit import solver
from igrow.trainer.fit.climate import bounds
from igrow.trainer.fit.evaluation import horizon_steps, starts_within
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.scales import CORRELATION_TIME, ERROR_SCALES, ROBUST

HORIZONS: Mapping[str, float] = {"1_step": 1500.0, "24_h": 10_800.0, "7_d": 86_400.0}
"""Of `igrow.trainer.fit.evaluation.HORIZONS`; seconds between the starts of their runs."""
SCALES = np.array([ERROR_SCALES[name] for name in measurement.PREDICTED])[:, None, None]
"""Of errors by balance, (3, 1, 1)."""
EVALUATIONS = 20
"""Points that a fit may try."""


@dataclass(frozen=True)
class FreeRuns:
    """Free runs from several starts against what was measured."""

    shown: Mapping[str, Floats]
    """By quantity, (steps, s)."""
    errors: Mapping[str, Floats]
    """Predicted minus measured, NaN where not measured or not counted, (steps, s)."""
    day: Integers
    """Day of each start, (s,)."""


@dataclass(frozen=True)
class Stage:
    """One model of the tables: deployed, recalibrated, corrected."""

    posterior: Gaussian
    terms: tuple[ActiveTerm, ...]
    patterns: Mapping[Pattern, float] = field(default_factory=dict)
    """Amplitude of what no cause explains, in units of a pattern."""
    added: Mapping[str, Floats] = field(default_factory=dict)
    """Its fluxes by channel, (n,)."""


@dataclass(frozen=True)
class LogDays:
    """A record with its split and runs: what stages are fitted to and judged on."""

    record: Record
    split: DaySplit
    runs: DayRuns
    """A day long, one from every local midnight."""
    _fitted: dict[tuple[object, ...], Gaussian] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Fits that were made, by what they were asked: of two causes each is held against the same fit without it."""

    def fit(
        self,
        prior: Gaussian,
        terms: Sequence[ActiveTerm],
        start: Mapping[str, float] | None = None,
        added: Mapping[str, Floats] | None = None,
    ) -> Gaussian:
        """Return the posterior of the parameters, fitted to the fit days beside terms.

        Args:
            prior: of the parameters.
            terms: active, held.
            start: where to begin, by name (None: the prior's mean).
            added: further fluxes by channel, (n,).

        Raises:
            DivergenceError: the model runs out of all bounds where the fit begins.
        """
        asked = (
            (prior.names, prior.mean.tobytes(), prior.covariance.tobytes()),
            tuple((one.effect, one.amplitude, tuple(one.shape.items()), one.onset) for one in terms),
            None if start is None else tuple(start.items()),
        )
        if added is not None:
            return self._fit(prior, terms, start, added)
        if asked not in self._fitted:
            self._fitted[asked] = self._fit(prior, terms, start, None)
        return self._fitted[asked]

    def _fit(
        self,
        prior: Gaussian,
        terms: Sequence[ActiveTerm],
        start: Mapping[str, float] | None,
        added: Mapping[str, Floats] | None,
    ) -> Gaussian:
        record, effects = self.record, activate(self.record, terms)
        runs = self.runs.on(self.split.fit)
        counted = runs.weight.ravel()
        low, high = bounds(prior.names)
        begin = np.array([(start or prior.values)[name] for name in prior.names])

        @solver.remembered
        def line(point: Floats) -> Linearisation:
            return sensitivity.linearise(record, runs, clipped(prior.names, point), effects, added)

        def residuals(point: Floats) -> Floats:
            return np.asarray((line(point).errors / SCALES).ravel()[counted])

        def jacobian(point: Floats) -> Floats:
            slopes = sensitivity.parameter_sensitivities(line(point), prior.names, prior.standard_deviation)
            return np.asarray((slopes / SCALES).reshape(len(slopes), -1)[:, counted].T)

        weight = record.step / CORRELATION_TIME
        return solver.solve(
            residuals, jacobian, prior, low, high, weights=weight, robust=ROBUST, start=begin, evaluations=EVALUATIONS
        ).posterior

    def run(self, stage: Stage, horizon: str = "24_h") -> FreeRuns | None:
        """Run a stage freely over a horizon and compare on held-out days; None where no run fits.

        Runs of 24 h lie on such days altogether; runs of seven days start anywhere, and count on such days alone.
        """
        record, parameters, effects = self.record, stage.posterior.values, activate(self.record, stage.terms)
        steps, every = horizon_steps(record, horizon), max(1, round(HORIZONS[horizon] / record.step))
        if steps + 1 >= len(record):
            return None
        wanted = ~self.split.fit_rows
        if horizon == "7_d":
            starts = complete_starts(record, steps, every)
            before = np.concatenate([[0], np.cumsum(wanted)])
            starts = starts[before[starts + steps] > before[starts]]
        else:
            starts = starts_within(record, wanted, steps, every)
        if len(starts) == 0:
            return None
        states = observe(record, parameters, effects)
        shown = free_run(record, states, starts, steps, parameters, effects, stage.added)
        samples = starts + 1 + np.arange(steps)[:, None]
        errors = {}
        for name in measurement.PREDICTED:
            error = shown[name] - record.measured[name][samples]
            errors[name] = np.where(wanted[samples], error, np.nan)
        return FreeRuns(shown, errors, self.split.day[starts])

    def all_held_out(self) -> LogDays:
        """Return the log with all of its days held out, to run a model on each of them."""
        return replace(self, split=replace(self.split, fit=np.zeros_like(self.split.fit)))

    def folds(self) -> tuple[LogDays, ...]:
        """Return the log with each of its days held out once, these first."""
        return tuple(replace(self, split=one) for one in folds(self.split))

    def persistence_errors(self, quantities: Iterable[str]) -> dict[str, float]:
        """Return the mean absolute error of yesterday's readings on held-out days, by quantity that has any."""
        rows = round(86_400.0 / self.record.step)
        unseen, errors = ~self.split.fit_rows[rows:], dict[str, float]()
        for quantity in quantities:
            values = self.record.measured[quantity]
            change = np.abs(values[rows:] - values[:-rows])[unseen]
            if np.isfinite(change).any():
                errors[quantity] = float(np.nanmean(change))
        return errors


@dataclass(frozen=True)
class Refittable:
    """A stage, and how it is fitted to other days."""

    stage: Stage
    prior: Gaussian
    """That its parameters were fitted under."""
    sized: bool = False
    """The size of its last term was fitted too."""

    def turns(self, log: LogDays) -> list[Stage]:
        """Return the stage, and as it is fitted to the fit days of each further fold of the log that it was fitted to.

        From one turn to the next little moves: a Gauss-Newton step, with slopes where all of them begin, is enough.

        Raises:
            DivergenceError: the model runs out of all bounds.
        """
        record, runs, terms = log.record, log.runs, self.stage.terms
        prior, start = self.prior, self.stage.posterior.mean
        low, high = bounds(prior.names)
        line = self._along(log, terms)
        slopes = sensitivity.parameter_sensitivities(line, prior.names, prior.standard_deviation)
        if self.sized:
            *others, last = terms
            size = EFFECTS[last.effect].amplitude
            step = sensitivity.EFFECT_DIFFERENCE * size.typical
            step = step if last.amplitude + step <= size.high else -step
            nearby = replace(last, amplitude=last.amplitude + step)
            moved = (self._along(log, [*others, nearby]).errors - line.errors) / step
            slopes = np.concatenate([slopes, moved[None]])
            # So wide that the days alone tell it.
            prior = prior.beside(last.effect, last.amplitude, size.high - size.low)
            start, low, high = np.append(start, last.amplitude), np.append(low, size.low), np.append(high, size.high)
        errors, steep = (line.errors / SCALES).ravel(), (slopes / SCALES).reshape(len(slopes), -1).T
        weight, found = record.step / CORRELATION_TIME, [self.stage]
        for fold in log.folds()[1:]:
            counted = (runs.weight & fold.split.fit[runs.day][None, :, None]).ravel()
            point = solver.step(errors[counted], steep[counted], prior, low, high, start, weights=weight, robust=ROBUST)
            turned = self.stage.posterior.moved(point[: len(self.prior.names)])
            own = (*terms[:-1], replace(terms[-1], amplitude=float(point[-1]))) if self.sized else terms
            found.append(replace(self.stage, posterior=turned, terms=own))
        return found

    def _along(self, log: LogDays, terms: Sequence[ActiveTerm]) -> Linearisation:
        stage = self.stage
        effects = activate(log.record, terms)
        return sensitivity.linearise(log.record, log.runs, stage.posterior.values, effects, stage.added)


def log_days(log: Log, model: FittedModel) -> LogDays:
    """Return the record of a log as a model reads it, split into days, with its runs."""
    shift = log.best_shift(model.posterior.values) if model.alignment is None else model.alignment
    record = log.record(shift)
    split = split_days(record, log.known_site.longitude)
    return LogDays(record, split, sensitivity.day_runs(record, split.day))


def root_mean_square(values: Floats) -> float:
    """Return the root of the mean square over what is finite (NaN for nothing)."""
    return float(np.sqrt(np.nanmean(_squared(values)))) if np.isfinite(values).any() else float("nan")


def _squared(values: Floats) -> Floats:
    """Return squares; those of a run that leaves all bounds are infinite, which is no fault of whoever asks."""
    with np.errstate(over="ignore"):
        return np.square(values)


def effect_to_noise(plain: FreeRuns, corrected: FreeRuns) -> float:
    """Return ENR: RMS of what an effect moves in a 24 h free run over the RMS that stays, the largest of quantities."""
    ratios = [
        root_mean_square(corrected.shown[name] - plain.shown[name])
        / max(root_mean_square(corrected.errors[name]), 1e-9)
        for name in plain.shown
        if np.isfinite(plain.errors[name]).any()
    ]
    return max(ratios) if ratios else 0.0


def skill(before: FreeRuns, after: FreeRuns) -> float:
    """Return the fall of the squared error over its mean before, mean over quantities and days."""
    return float(skill_by_day(before, after).mean())


def cross_validated_skill(log: LogDays, before: Refittable, after: Refittable) -> float | None:
    """Return the skill on all days, each by models that were fitted to others; None where no run fits.

    What comes on few days shows on some of them, and the chance of a few unseen days counts less. Which terms the
    stages have stays as the log's fit days told it: only its own held-out days are new to that.

    Args:
        log: whose fit days both were fitted to.
        before: one of them.
        after: the other.

    Raises:
        DivergenceError: a model runs out of all bounds.
    """
    falls, both = [], [one.turns(log) for one in (before, after)]
    for number, fold in enumerate(log.folds()):
        old, new = (fold.run(stage) for stage in (turns[number] for turns in both))
        if old is not None and new is not None:
            falls.append(skill_by_day(old, new))
    return float(np.concatenate(falls).mean()) if falls else None


def skill_by_day(before: FreeRuns, after: FreeRuns) -> Floats:
    """Return the fall of the squared error on each day over the mean of all days before, mean over quantities, (d,)."""
    days = np.unique(before.day)
    by_day = np.zeros(len(days))
    quantities = [name for name in before.errors if np.isfinite(before.errors[name]).any()]
    for name in quantities:
        squared = _squared(before.errors[name])
        fall = (squared - _squared(after.errors[name])) / np.nanmean(squared)
        for index, day in enumerate(days):
            part = fall[:, before.day == day]
            by_day[index] += np.nanmean(part) / len(quantities) if np.isfinite(part).any() else 0.0
    return by_day


def mean_absolute_errors(runs: FreeRuns | None) -> dict[str, float]:
    """Return the mean absolute error of each quantity that was measured."""
    if runs is None:
        return {}
    return {name: float(np.nanmean(np.abs(error))) for name, error in runs.errors.items() if np.isfinite(error).any()}
