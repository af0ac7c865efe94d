"""The likelihood of a model beside its own noise.

The noise of a log is fitted to what a model leaves. A cause that is not in the model stands in its noise: it widens
the scale, lengthens the colour, and has its own rows counted as outliers, so that in a search under that noise it
gains a third of what it is worth. Here each of the best causes gets the noise that is left beside it, and models
are compared by the full likelihood of Student's t (the profile likelihood: Barndorff-Nielsen and Cox 1994,
Inference and Asymptotics, ch. 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from igrow.trainer.diagnosis import gram, innovations, search
from igrow.trainer.diagnosis.gram import RESIDUAL, DailyGrams, Floats, Term
from igrow.trainer.diagnosis.innovations import Whitening
from igrow.trainer.diagnosis.problem import Problem, fit_noise
from igrow.trainer.diagnosis.search import Model

TURNS = 3
"""Alternations between coefficients and noise."""


@dataclass(frozen=True)
class Profile:
    """A model at its likeliest coefficients and noise."""

    model: Model
    amplitudes: tuple[float, ...]
    """Of the terms."""
    deviations: tuple[float, ...]
    """Their standard deviations."""
    whitening: Whitening
    by_day: Floats
    """Log-likelihood of every day, held-out ones too, (days,)."""
    penalty: float
    """Of the base, for standing away from its prior's mean."""


def profile(problem: Problem, model: Model, start: Whitening | None = None) -> Profile:
    """Fit coefficients and noise of a model by turns to the fit days.

    Args:
        problem: whose columns the model names.
        model: base and terms.
        start: noise to begin with (None: the problem's).
    """
    day = problem.line.runs.day
    stack = np.stack(
        [problem.columns[column] for column in (RESIDUAL, *model.base)] + [_column(problem, one) for one in model.terms]
    )
    size = len(model.base)
    plain = Model(
        tuple(range(1, size + 1)),
        model.precision,
        model.shift,
        tuple(Term(size + 1 + index) for index in range(len(model.terms))),
    )
    whitening = start or problem.whitening
    for _ in range(TURNS):
        products = gram.daily_products(whitening(stack), day, problem.split.days)
        fitted = search.fit(DailyGrams(products, problem.split.fit), plain)
        coefficients = fitted.solution.coefficients
        errors = np.tensordot(np.concatenate([[1.0], coefficients]), stack, axes=1)
        whitening = fit_noise(errors, problem.observed, problem.fitted, whitening)
    likelihood = np.where(problem.observed, innovations.log_likelihood(whitening, errors), 0.0).sum(axis=1)
    by_day = np.zeros(problem.split.days)
    np.add.at(by_day, day, likelihood)
    away = coefficients[:size] + model.shift
    amplitudes, deviations = (tuple(map(float, part)) for part in (fitted.amplitudes, fitted.deviations))
    return Profile(model, amplitudes, deviations, whitening, by_day, 0.5 * float(away @ model.precision @ away))


def gain(problem: Problem, full: Profile, none: Profile) -> float:
    """Return the penalised log-likelihood that a model has over another on the fit days."""
    days = (full.by_day - none.by_day)[problem.split.fit]
    return float(days.sum()) - full.penalty + none.penalty


def doubt(problem: Problem, full: Profile, none: Profile, rng: np.random.Generator) -> float:
    """Return the bootstrap probability that unseen days are not likelier under a model than under another."""
    days = (full.by_day - none.by_day)[~problem.split.fit]
    if not len(days):
        return 0.0
    means = days[rng.integers(0, len(days), size=(2000, len(days)))].mean(axis=1)
    return float(np.mean(means <= 0.0))


def _column(problem: Problem, term: Term) -> Floats:
    """Return the column of a term from its beginning on, (b, r, intervals)."""
    column: Floats = problem.columns[term.column]
    if term.onset is None:
        return column
    if term.ageing is not None:
        column = column - term.onset * problem.columns[term.ageing]
    begun: Floats = np.where((problem.line.runs.day >= term.onset)[None, :, None], column, 0.0)
    return begun
