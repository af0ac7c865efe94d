"""A diagnosis made ready: the log linearised at the deployed model, filtered to innovations, summed up by day."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import DaySplit as Split
from igrow.trainer.diagnosis import candidates, drivers, gram, innovations, linearisation
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.drivers import Pattern
from igrow.trainer.diagnosis.gram import DailyGrams
from igrow.trainer.diagnosis.innovations import Whitening
from igrow.trainer.diagnosis.linearisation import Floats, Linearisation
from igrow.trainer.diagnosis.prior import Prior, drift

HOUR = 3600.0
LONG_DAYS = 42
"""Days from which on a log is long: crop and season then change within it."""
SEASON_DAYS = 84.0
"""Time in which a parameter may drift by `prior.DRIFT` to either side of its mean."""
ROUNDS = 3
"""Alternations between parameters and the colour of the disturbances."""


@dataclass(frozen=True)
class Problem:
    """Everything the search works on."""

    line: Linearisation
    split: Split
    prior: Prior
    whitening: Whitening
    balances: tuple[int, ...]
    """Rows of the errors that the log can tell, of 0, 1, 2."""
    candidates: tuple[Candidate, ...]
    patterns: tuple[Pattern, ...]
    untestable: tuple[str, ...]
    columns: Floats
    """All columns as means over intervals, 0 where they do not count, before whitening, (q, b, r, intervals)."""
    observed: NDArray[np.bool_]
    """Intervals that count, (r, intervals)."""
    grams: DailyGrams
    """Of `columns`, whitened."""
    parameter: range
    """Columns of the parameters."""
    candidate: range
    """Columns of the candidates."""
    ageing: range
    """Columns that shift the beginning of a candidate that ages."""
    pattern: range
    """Columns of the patterns."""
    known: range
    """The column of the misfit that the calibration knew already (empty where it is not known)."""
    usual: range
    """Columns of how greenhouses and weathers usually differ and, in a long log, of how parameters drift."""
    expected: Floats
    """The known and the usual misfits as errors, not whitened, (known + usual, 3, r, steps)."""
    interval: float
    """Seconds over which errors are averaged."""
    usual_size: Mapping[str, float]
    """Amplitude, by effect, that a log with nothing missing usually shows."""

    @property
    def elsewhere(self) -> bool:
        """What the model misses of this greenhouse when all is well is not known: it was calibrated on another one."""
        return len(self.known) == 0

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Runs on days for fitting, (r, 1)."""
        runs: NDArray[np.bool_] = self.split.fit[self.line.runs.day][:, None]
        return runs

    def whitened(self, whitening: Whitening) -> Problem:
        """Return the problem as another noise shows it."""
        products = gram.daily_products(whitening(self.columns), self.line.runs.day, self.split.days)
        return replace(self, whitening=whitening, grams=DailyGrams(products, self.split.fit))


def averaged(values: Floats, step: float, interval: float) -> Floats:
    """Return means over intervals along the last axis, (..., steps) to (..., intervals).

    Within the hour a greenhouse answers to a flux as its fast masses do (leaves, cover, the sensor's housing), which
    the balances may not have; the mean of an hour hardly depends on them.

    Args:
        values: by step.
        step: its length, s.
        interval: s; one step at least.
    """
    block = max(1, round(interval / step))
    count = values.shape[-1] // block
    means: Floats = values[..., : count * block].reshape(*values.shape[:-1], count, block).mean(axis=-1)
    return means


def counted_intervals(line: Linearisation, balances: tuple[int, ...], interval: float) -> NDArray[np.bool_]:
    """Tell which intervals have an error in every balance at hand in each of their rows, (r, intervals)."""
    rows = np.all(line.runs.weight[list(balances)], axis=0)
    counted: NDArray[np.bool_] = averaged(rows.astype(np.float64), line.record.step, interval) > 1.0 - 1e-9
    return counted


def recalibrate(
    start: Linearisation, split: Split, prior: Prior, misfit: Floats, interval: float, rounds: int = ROUNDS
) -> tuple[Linearisation, Whitening, tuple[int, ...]]:
    """Fit parameters under their prior and the noise to the fit days, by turns.

    Args:
        start: the model at the prior's mean.
        split: days to fit.
        prior: of the parameters.
        misfit: what is known to be missing, added to the errors, (3, r, steps).
        interval: seconds over which errors are averaged.
        rounds: of turns.

    Returns the linearisation at the fitted parameters, the whitening and the balances at hand.
    """
    names = prior.names
    parameters = dict(prior.mean)
    line, runs = start, start.runs
    balances = tuple(row for row in range(3) if runs.weight[row].mean() > 0.2)
    fitted = split.fit[runs.day][:, None]
    observed = counted_intervals(line, balances, interval)
    step = line.record.step
    chosen = list(balances)
    whitening = fit_noise(averaged((line.errors + misfit)[chosen], step, interval), observed, fitted)
    for _ in range(rounds):
        columns = linearisation.parameter_columns(line, names, prior.spread)
        stack = np.concatenate([(line.errors + misfit)[None], columns])[:, chosen]
        stack = averaged(stack, step, interval) * observed
        flat = (whitening(stack) * fitted).reshape(len(stack), -1)
        products = flat @ flat.T
        # The prior's mean is where the search began, not where this round stands.
        away = np.array([parameters[name] - prior.mean[name] for name in names])
        matrix = products[1:, 1:] + prior.precision
        right = -products[1:, 0] - prior.precision @ away
        change = np.linalg.solve(matrix, right)
        parameters = prior.clip(
            {name: parameters[name] + float(part) for name, part in zip(names, change, strict=True)}
        )
        line = linearisation.linearise(line.record, runs, parameters, line.effects)
        whitening = fit_noise(averaged((line.errors + misfit)[chosen], step, interval), observed, fitted, whitening)
    return line, whitening, balances


def _drifting(columns: Floats, prior: Prior, day: NDArray[np.int64]) -> Floats:
    """Return d(error)/d(drift) of every parameter, (p, 3, r, steps): linear in time, at the size that it may have.

    Args:
        columns: d(error)/d(parameter), (p, 3, r, steps).
        prior: of the parameters.
        day: of each run, (r,).
    """
    middle = 0.5 * (day[0] + day[-1])
    course = (day - middle) / (0.5 * SEASON_DAYS)
    size = np.array([drift(name, prior.mean[name]) for name in prior.names])
    drifting: Floats = columns * size[:, None, None, None] * course[:, None]
    return drifting


def _combined(line: Linearisation, longitude: float, lists: Sequence[Mapping[str, float]]) -> Floats:
    """Return the columns of lists of amplitudes by key, (lists, 3, r, steps)."""
    if not lists:
        return np.zeros((0, *line.shown.shape))
    found = candidates.candidate_columns(line)
    names, columns = drivers.pattern_columns(line, longitude)
    keys = (*map(candidate_key, found.candidates), *map(pattern_key, names))
    amplitudes = np.array([[one.get(key, 0.0) for key in keys] for one in lists])
    combined: Floats = np.tensordot(amplitudes, np.concatenate([found.columns, columns]), axes=1)
    return combined


def fit_noise(
    errors: Floats, observed: NDArray[np.bool_], fitted: NDArray[np.bool_], start: Whitening | None = None
) -> Whitening:
    """Fit colour and scale of the disturbances to errors on the fit days.

    Args:
        errors: of the balances at hand, (b, r, intervals).
        observed: intervals that count, (r, intervals).
        fitted: runs on days for fitting, (r, 1).
        start: where to begin.
    """
    errors = errors * observed
    counted = observed & fitted
    starts = start.filters if start else (None,) * len(errors)
    filters = tuple(
        innovations.fit_filter(row, counted, start=begin) for row, begin in zip(errors, starts, strict=True)
    )
    whitening = innovations.fit_whitening(errors, counted, filters)
    # Held-out rows are filtered and weighted too: the fit leaves them out by day.
    return innovations.extend(whitening, errors, observed)


def prepare(
    record: Record,
    split: Split,
    prior: Prior,
    effects: ActiveEffects,
    longitude: float,
    known: Mapping[str, float],
    usual: Sequence[Mapping[str, float]] = (),
    without: Collection[str] = (),
    interval: float = HOUR,
    usual_size: Mapping[str, float] | None = None,
) -> Problem:
    """Recalibrate, then linearise everything that may be missing.

    Args:
        record: of the log.
        split: its days.
        prior: of the parameters.
        effects: active already.
        longitude: degrees east, for the calendar.
        known: the misfit of the calibration, amplitude by key (`structure`).
        usual: how greenhouses and weathers differ though nothing is missing, each in amplitudes by key (`usual`).
        without: effects that are no candidates.
        interval: seconds over which errors are averaged.
        usual_size: amplitude, by effect, that a log with nothing missing usually shows.
    """
    runs = linearisation.day_runs(record, split.day)
    line = linearisation.linearise(record, runs, prior.mean, effects)
    expected = _combined(line, longitude, [known, *usual] if known else usual)
    misfit = expected[0] if known else np.zeros_like(line.shown)
    line, whitening, balances = recalibrate(line, split, prior, misfit, interval)
    chosen = list(balances)
    observed = counted_intervals(line, balances, interval)
    base = linearisation.parameter_columns(line, prior.names, prior.spread)
    if split.days > LONG_DAYS:
        expected = np.concatenate([expected, _drifting(base, prior, runs.day)])
    found = candidates.candidate_columns(line, without)
    names, pattern = drivers.pattern_columns(line, longitude)
    parts = [
        line.errors[None],
        base,
        found.columns,
        found.ageing,
        pattern,
        expected[: 1 if known else 0],
        expected[1 if known else 0 :],
    ]
    edges = np.cumsum([0] + [len(part) for part in parts])
    columns = np.concatenate([averaged(part[:, chosen], record.step, interval) * observed for part in parts])
    products = gram.daily_products(whitening(columns), runs.day, split.days)
    spans = [range(int(edges[k]), int(edges[k + 1])) for k in range(1, len(parts))]
    parameter, candidate, ageing, patterned, first_known, usually = spans
    return Problem(
        line=line,
        split=split,
        prior=prior,
        whitening=whitening,
        balances=balances,
        candidates=found.candidates,
        patterns=names,
        untestable=found.untestable,
        columns=columns,
        observed=observed,
        grams=DailyGrams(products, split.fit),
        parameter=parameter,
        candidate=candidate,
        ageing=ageing,
        pattern=patterned,
        known=first_known,
        usual=usually,
        expected=expected,
        interval=interval,
        usual_size=usual_size or {},
    )


def candidate_key(candidate: Candidate) -> str:
    """Return the name of a candidate in a list of known misfits."""
    return ":".join([candidate.effect, *(f"{name}={value:g}" for name, value in candidate.shape)])


def pattern_key(pattern: Pattern) -> str:
    """Return the name of a pattern in a list of known misfits."""
    return f"{pattern.channel}:{pattern.when}"


def parameter_shift(problem: Problem) -> Floats:
    """Return where the fitted parameters stand against the prior's mean, (p,)."""
    return np.array([problem.line.parameters[name] - problem.prior.mean[name] for name in problem.prior.names])


def as_mapping(names: tuple[str, ...], values: Floats) -> Mapping[str, float]:
    """Return values by name."""
    return dict(zip(names, map(float, values), strict=True))
