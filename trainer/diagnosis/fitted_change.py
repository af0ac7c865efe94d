"""A change that time steps alone do not prove: told by fits to free runs of a day, beside all parameters.

What a calibration carries into another season can look like a sensor that is off, or like what a crop transpires at
night, as strongly as such a change itself. A free run of a day tells these apart: the effects that gain most are fitted
beside parameters that change as physics lets expect, and that which takes most off the error of days that no fit saw
must take more than it does wherever nothing has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.diagnosis import change, linear, search
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.compare import Round
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.freerun import LogDays, Refittable, Stage
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, activate
from igrow.trainer.diagnosis.linear import Fit
from igrow.trainer.diagnosis.null_gains import read_null_falls
from igrow.trainer.diagnosis.omission import DAY, fit_together
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.fit.climate import fit_climate
from igrow.trainer.fit.evaluation import errors_of, free_runs
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError

_UNMEASURED = 1e-12
"""Stands for the error of days without a measurement."""


@dataclass(frozen=True)
class Fitted:
    """A hypothesis that was fitted to free runs."""

    hypothesis: Hypothesis
    errors: Floats
    """Sums of absolute errors a day ahead without and with it on days that no fit saw, (q, 2, days)."""

    @property
    def fall(self) -> float:
        """Share of the error that goes, the mean of all quantities."""
        return float(_fall(self.errors))


def find(days: LogDays, knowledge: Knowledge, design: Design, rng: np.random.Generator) -> Round | None:
    """Return the round in which a fit names a change; None where none makes unseen days better.

    Args:
        days: of the log.
        knowledge: of the greenhouse before it.
        design: of the log.
        rng: for flips and bootstraps.
    """
    null = linear.fit(design.grams, design.null_model())
    found = best(fitted(days, knowledge, design, promising(design, rng)))
    if found is None or found.fall < read_null_falls().needed(found.hypothesis.effect):
        return None
    return _by_fits(design, null, found, rng)


def best(found: Sequence[Fitted]) -> Fitted | None:
    """Return the hypothesis that takes most off unseen days; None for none."""
    return max(found, key=lambda one: one.fall, default=None)


def _by_fits(design: Design, null: Fit, found: Fitted, rng: np.random.Generator) -> Round:
    """Return the round of a cause of which the fits say what unseen days say: single steps say less."""
    told = change.round_of(design, null, found.hypothesis, rng)
    assert told.cause is not None
    (falls,) = _drawn([found], design.rules, rng)
    return replace(told, cause=replace(told.cause, bootstrap_p=float(np.mean(falls <= 0.0))))


def settled(days: LogDays, knowledge: Knowledge, design: Design, told: Round, rng: np.random.Generator) -> Round:
    """Return a round whose cause free runs tell as well, where time steps cannot tell it from others.

    Where another of these surely makes unseen days better than it does, that is the cause if it gains what it must, or
    makes unseen days better by as much as one must that only fits tell; else there is none.

    Args:
        days: of the log.
        knowledge: of the greenhouse before it.
        design: of the log.
        told: a round with a cause.
        rng: for flips and bootstraps.
    """
    assert told.cause is not None and design.history is not None and design.history.null_gains is not None
    rules, null = design.rules, linear.fit(design.grams, design.null_model())
    first = told.cause.hypothesis
    # Of what began within the log there is no one size to fit.
    near = [] if first.term.onset is not None else rivals(design, null, first, rng)
    found = fitted(days, knowledge, design, [first, *near]) if near else []
    own = next((one for one in found if one.hypothesis.effect == first.effect), None)
    rival = best(found)
    # What makes days worse that no fit saw is no rival.
    if own is None or rival is None or rival is own or rival.fall <= 0.0:
        return told
    falls = _drawn([own, rival], rules, rng)
    if np.mean(falls[1] > falls[0]) < rules.confidence:
        return told
    other = rival.hypothesis
    if change.proven_gain(design, other) >= design.history.null_gains.needed(other.effect):
        return change.round_of(design, null, other, rng)
    if rival.fall >= read_null_falls().needed(other.effect):
        return _by_fits(design, null, rival, rng)
    return Round(design, null, null, None, ())


def rivals(design: Design, null: Fit, first: Hypothesis, rng: np.random.Generator) -> list[Hypothesis]:
    """Return the hypotheses that gain nearly as much as the first, or more, those that gain most."""
    assert design.history is not None
    rules, gain = design.rules, change.net_gain(design, first)
    least = gain - rules.confounded_within(gain)
    others = (
        one
        for one in search.score_candidates(design, null, [None], rng)
        if one.effect != first.effect and one.effect not in design.history.without
    )
    near = [one for one in others if change.net_gain(design, one) >= least]
    return sorted(near, key=lambda one: change.net_gain(design, one), reverse=True)[: rules.most_change_fits - 1]


def promising(design: Design, rng: np.random.Generator) -> list[Hypothesis]:
    """Return the effects that gain enough by physics to be fitted, that which gains most first."""
    assert design.history is not None
    null, rules = linear.fit(design.grams, design.null_model()), design.rules
    scored = search.score_candidates(design, null, [None], rng)
    asked = (one for one in scored if one.effect not in design.history.without)
    ranked = sorted(asked, key=lambda one: change.net_gain(design, one), reverse=True)
    return [
        one for one in ranked[: rules.most_change_fits] if change.net_gain(design, one) >= rules.least_fitted_change
    ]


def fitted(days: LogDays, knowledge: Knowledge, design: Design, hypotheses: Sequence[Hypothesis]) -> list[Fitted]:
    """Return the hypotheses that can be fitted, with what is left on all days, each by models fitted to others."""
    record, terms = days.record, knowledge.terms
    known = activate(record, terms)
    # Of what began within the log there is no one size beside which another could be fitted.
    if not hypotheses or any(np.ndim(value) for effect in known.values() for value in effect.values()):
        return []
    prior = knowledge.by_physics(design.rules)
    try:
        plain = Stage(fit_climate([(record, days.split.fit_rows)], prior, known), terms)
        without = Refittable(plain, prior).turns(days)
    except DivergenceError:
        return []
    found = []
    for one in hypotheses:
        try:
            named = Refittable(_fit(days, prior, terms, one), prior, sized=True).turns(days)
        except DivergenceError:
            continue
        turns = zip(days.folds(), without, named, strict=True)
        folds = [_by_day(record, ~fold.split.fit_rows, *both) for fold, *both in turns]
        # A quantity may not have been measured on the days of a fold: it is left out.
        if most := max(map(len, folds)):
            found.append(Fitted(one, np.concatenate([errors for errors in folds if len(errors) == most], axis=-1)))
    return found


def _drawn(found: Sequence[Fitted], rules: DecisionRules, rng: np.random.Generator) -> Floats:
    """Return the falls of hypotheses on bootstrap draws of days, the same days for all, (h, draws)."""
    count = found[0].errors.shape[-1]
    days = rng.integers(0, count, size=(rules.bootstrap_draws, count))
    return np.stack([_fall(one.errors[..., days]) for one in found])


def _by_day(record: Record, rows: Mask, *stages: Stage) -> Floats:
    """Return the sums of absolute errors a day ahead of two models by the day on which a run starts, (q, 2, days)."""
    models = [(one.posterior.values, activate(record, one.terms)) for one in stages]
    # A run that leaves all bounds counts as no better; what it computes on its way is no news.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        old, new = (errors_of(record, free_runs(record, *one), (DAY,), rows) for one in models)
    days = {key: np.unique(one.day, return_inverse=True)[1] for key, one in old.items()}
    sums = [
        [np.bincount(day, np.nansum(np.abs(one[key].error), axis=0)) for one in (old, new)] for key, day in days.items()
    ]
    return np.array(sums, dtype=np.float64) if sums else np.zeros((0, 2, 0))


def _fall(errors: Floats) -> Floats:
    """Return the share of the errors of days (q, 2, ..., days) that goes, the mean of all quantities, (...)."""
    if not len(errors):
        return np.zeros(errors.shape[2:-1])
    # Of days that are drawn but not measured nothing falls; of a run without a finite error neither.
    before, after = np.moveaxis(np.maximum(errors.sum(axis=-1), _UNMEASURED), 1, 0)
    with np.errstate(invalid="ignore"):
        left: Floats = np.mean(after / before, axis=0)
    return np.where(np.isfinite(left), 1.0 - left, -np.inf)


def _fit(days: LogDays, prior: Gaussian, terms: tuple[ActiveTerm, ...], one: Hypothesis) -> Stage:
    """Return parameters and the size of an effect, fitted together to free runs of the fit days."""
    assert isinstance(one.cause, Candidate)
    size, shape = EFFECTS[one.effect].amplitude, dict(one.cause.values)
    expected = {one.effect: float(np.clip(one.amplitude, size.low, size.high))}
    active = {**activate(days.record, terms), one.effect: shape}
    fitted = fit_together(days.record, days.split.fit_rows, prior, expected, active)
    found = ActiveTerm(one.effect, fitted.values[f"{one.effect}:{size.name}"], shape)
    return Stage(fitted.marginal(prior.names), (*terms, found))
