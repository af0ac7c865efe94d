"""The found terms refitted where they are: sizes, shapes and parameters together, the noise without the effect in it.

The search linearises at a model without the effect, with the weights that its large innovations got there; a strong
effect then looks smaller than it is. Here the effect is active: amplitudes, nonlinear parameters and physical
parameters are fitted under their priors, by turns with the weights of the noise. What else is known of the greenhouse
is held at its mean: left free it would take its share of the terms.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from igrow.core.arrays import Floats, Mask
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.trainer.diagnosis.design import possible_air, sensitivity
from igrow.trainer.diagnosis.design.balances import Balances
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Fit
from igrow.trainer.diagnosis.design.noise import Whitening
from igrow.trainer.diagnosis.design.sensitivity import Linearisation
from igrow.trainer.diagnosis.knowledge import ActiveTerm, activate, clipped
from igrow.trainer.fit import solver
from igrow.trainer.fit.climate import bounds
from igrow.trainer.fit.gaussian import Gaussian

REGIMES = (("day", "night"), ("calm", "windy"), ("vents shut", "vents open"), ("first half", "second half"))
"""In each of a pair a cause has about the same size."""
_DIFFERENCE = 0.05
"""Finite difference of a knob, in its scale."""
_LEAST_SCALE = 0.2
"""Of an amplitude, in typical ones, however small it is."""
_AT_BOUND = 1e-6
"""Share of its range within which a knob lies on its bound."""


@dataclass(frozen=True)
class Refitted:
    """A term at its refitted values."""

    term: ActiveTerm
    deviation: float
    """Of the amplitude, the larger of the curvature's and of the scatter of day scores."""
    shape_deviation: dict[str, float]
    regimes: dict[str, tuple[float, float]]
    """(amplitude, standard deviation) by regime, all else held."""


@dataclass(frozen=True)
class Knob:
    """An amplitude or a nonlinear parameter of a term."""

    index: int
    """Of the term."""
    name: str
    low: float
    high: float
    scale: float
    """A typical change."""
    is_shape: bool

    def of(self, terms: Sequence[ActiveTerm]) -> float:
        """Return its value."""
        term = terms[self.index]
        return term.shape[self.name] if self.is_shape else term.amplitude

    def set(self, terms: Sequence[ActiveTerm], value: float) -> list[ActiveTerm]:
        """Return the terms with it at a value, within its bounds."""
        near = _AT_BOUND * (self.high - self.low)
        value = self.low if value < self.low + near else self.high if value > self.high - near else value
        term = terms[self.index]
        moved = (
            replace(term, shape={**term.shape, self.name: value}) if self.is_shape else replace(term, amplitude=value)
        )
        return [*terms[: self.index], moved, *terms[self.index + 1 :]]


@dataclass(frozen=True)
class _Unknowns:
    """What is refitted together: parameters, and knobs of the terms."""

    design: Design
    before: tuple[ActiveTerm, ...]
    """Terms of the model in force, held."""
    found: tuple[ActiveTerm, ...]
    """Where the terms start, and what their nonlinear parameters are held to."""
    knobs: tuple[Knob, ...]
    prior: Gaussian
    low: Floats
    high: Floats

    def terms(self, point: Floats) -> list[ActiveTerm]:
        """Return the terms at a point, (p + k,)."""
        terms = list(self.found)
        for knob, value in zip(self.knobs, point[len(point) - len(self.knobs) :], strict=True):
            terms = knob.set(terms, float(value))
        return terms

    def line(self, point: Floats) -> Linearisation:
        """Return the model at a point."""
        names = self.design.prior.names
        parameters = clipped(names, point[: len(names)])
        return sensitivity.linearise(
            self.design.line.record, self.design.line.runs, parameters, self._active(self.terms(point))
        )

    def slopes(self, point: Floats, line: Linearisation) -> Floats:
        """Return d(error)/d(parameter) and d(error)/d(knob), (p + k, 3, r, steps), about the model at a point."""
        terms, prior = self.terms(point), self.design.prior
        moved = [(self._active(other), amount) for other, amount in (_moved(terms, knob) for knob in self.knobs)]
        return sensitivity.parameter_sensitivities(line, prior.names, prior.standard_deviation, moved)

    def _active(self, terms: Sequence[ActiveTerm]) -> ActiveEffects:
        return activate(self.design.line.record, [*self.before, *terms])


def _moved(terms: Sequence[ActiveTerm], knob: Knob) -> tuple[list[ActiveTerm], float]:
    """Return the terms with a knob a little further on, and by how much."""
    value = knob.of(terms)
    step = _DIFFERENCE * (knob.scale if knob.is_shape else max(abs(value), knob.scale))
    # At a bound one of both steps is held back.
    other = max((knob.set(terms, value + sign * step) for sign in (1, -1)), key=lambda one: abs(knob.of(one) - value))
    return other, knob.of(other) - value


def refit(design: Design, named: Fit, terms: Sequence[ActiveTerm], before: Sequence[ActiveTerm]) -> list[Refitted]:
    """Refit terms together.

    Args:
        design: that they were found in.
        named: the fit of the search, with the last of these terms; its parameters are where the refit starts.
        terms: found, in any order.
        before: terms of the model in force, held.

    Raises:
        DivergenceError: the model runs out of all bounds with these terms.
    """
    rules, prior, balances = design.rules, design.prior, design.balances
    unknowns = _unknowns(design, terms, before)
    size = len(prior.names)
    misfit = design.known.misfit
    # Where the search left off.
    point = unknowns.prior.mean.copy()
    point[:size] = named.solution.coefficients[:size] + [design.line.parameters[name] for name in prior.names]
    point = np.clip(point, unknowns.low, unknowns.high)
    whitening: Whitening | None = None
    line = solver.remembered(unknowns.line)
    # A round begins where the one before it ended.
    sensitivities = solver.remembered(lambda point: unknowns.slopes(point, line(point)))
    for _ in range(rules.refit_rounds):
        # The noise is fitted about the model as it now stands.
        whitening = design.fit_noise(balances(line(point).errors[None])[0] + misfit, whitening)
        view = _View(whitening, balances, design.fitted)

        def residuals(point: Floats, view: _View = view) -> Floats:
            return view.flat(balances(line(point).errors[None]) + misfit)[:, 0]

        def jacobian(point: Floats, view: _View = view) -> Floats:
            return view.flat(balances(sensitivities(point)))

        solution = solver.solve(
            residuals, jacobian, unknowns.prior,
            low=unknowns.low, high=unknowns.high, start=point, evaluations=rules.refit_evaluations,
        )  # fmt: skip
        moved = np.abs(solution.posterior.mean - point) / solution.posterior.standard_deviation
        point = solution.posterior.mean
        if np.all(moved[size:] < rules.refit_settled):
            break
    return _refitted(unknowns, solution, view)


@dataclass(frozen=True)
class _View:
    """How errors are seen: whitened, on fit days alone."""

    whitening: Whitening
    balances: Balances
    fitted: Mask

    def flat(self, values: Floats) -> Floats:
        """Turn errors that count, (k, b, r, steps), into white rows of a least-squares problem, (n, k)."""
        return np.asarray(self.whitening(values) * self.fitted).reshape(len(values), -1).T


def _unknowns(design: Design, terms: Sequence[ActiveTerm], before: Sequence[ActiveTerm]) -> _Unknowns:
    knobs = []
    for index, term in enumerate(terms):
        definition = EFFECTS[term.effect]
        size, record = definition.amplitude, design.line.record
        acts = None if term.onset is None else record.time >= term.onset
        reach = possible_air.amplitude_bounds(definition, record, acts)
        knobs.append(Knob(index, size.name, *reach, _LEAST_SCALE * abs(size.typical), False))
        for one in definition.shapes:
            knobs.append(
                Knob(index, one.name, one.low, one.high, design.rules.nonlinear_spread * (one.high - one.low), True)
            )
    prior = twins_held(design.prior, terms, design.rules.twin_drift)
    low, high = bounds(prior.names)
    # An amplitude is free; a nonlinear parameter is held to what the search found.
    spread = np.array([one.scale if one.is_shape else one.high - one.low for one in knobs])
    start = np.array([np.clip(one.of(terms), one.low, one.high) for one in knobs])
    names = (*prior.names, *(f"{terms[one.index].effect}:{one.name}" for one in knobs))
    joint = Gaussian(names, np.concatenate([prior.mean, start]), block_diag(prior.covariance, np.diag(spread**2)))
    return _Unknowns(
        design,
        tuple(before),
        tuple(terms),
        tuple(knobs),
        joint,
        np.concatenate([low, [one.low for one in knobs]]),
        np.concatenate([high, [one.high for one in knobs]]),
    )


def twins_held(prior: Gaussian, terms: Sequence[ActiveTerm], share: float) -> Gaussian:
    """Return a prior in which the parameters that terms are more of hardly move: else they would take the terms over.

    In a greenhouse whose history is known they have drifted by far less than a term that was found.

    Args:
        prior: of all parameters.
        terms: that were found.
        share: of their standard deviations that such parameters keep.
    """
    twins = {twin for one in terms for twin in EFFECTS[one.effect].resembles}
    kept = np.array([share if name in twins else 1.0 for name in prior.names])
    return Gaussian(prior.names, prior.mean, prior.covariance * np.outer(kept, kept))


def _refitted(unknowns: _Unknowns, solution: solver.Solution, view: _View) -> list[Refitted]:
    """Return terms, deviations and regimes at the minimum."""
    knobs, design, point = unknowns.knobs, unknowns.design, solution.posterior.mean
    shape = (-1, len(design.line.runs.day), view.balances.observed.shape[1])
    # The scatter of what each day would move the point by (sandwich estimator).
    daily = np.einsum("brik,bri->rk", solution.jacobian.reshape(*shape, len(point)), solution.residuals.reshape(shape))
    influence = (daily @ solution.posterior.covariance)[design.fitted[:, 0]]
    scatter = np.sqrt(np.sum((influence - influence.mean(axis=0)) ** 2, axis=0))
    deviation = np.maximum(solution.posterior.standard_deviation, scatter)[-len(knobs) :]
    terms = unknowns.terms(point)
    found = []
    for index, term in enumerate(terms):
        own = {knob.name: k for k, knob in enumerate(knobs) if knob.index == index}
        size = EFFECTS[term.effect].amplitude.name
        slope = solution.jacobian[:, len(point) - len(knobs) + own[size]].reshape(shape)
        found.append(
            Refitted(
                term,
                float(deviation[own[size]]),
                {name: float(deviation[k]) for name, k in own.items() if name != size},
                _regimes(unknowns, view, solution.residuals.reshape(shape), slope, term.amplitude),
            )
        )
    return found


def _regimes(
    unknowns: _Unknowns, view: _View, residual: Floats, slope: Floats, amplitude: float
) -> dict[str, tuple[float, float]]:
    """Return (amplitude, standard deviation) refitted on the samples of each regime, all else held.

    Residual and slope of the amplitude are white, (b, r, steps).
    """
    line, rules = unknowns.design.line, unknowns.design.rules
    samples, inputs = line.runs.samples - 1, line.record.inputs
    wind, vents = inputs["wind_speed"][samples], (inputs["vent_lee"] + inputs["vent_wind"])[samples]
    day, still = inputs["global_radiation"][samples] > rules.daylight, wind <= np.median(wind)
    shut = vents < rules.vents_open
    early = np.broadcast_to((line.runs.starts <= np.median(line.runs.starts))[:, None], samples.shape)
    masks = dict(zip(itertools.chain(*REGIMES), (day, ~day, still, ~still, shut, ~shut, early, ~early), strict=True))
    whole = float(np.sum(slope**2))
    found = {}
    for name, mask in masks.items():
        curvature = float(np.sum((slope * mask) ** 2))
        # A regime in which the effect hardly shows tells nothing of it.
        if curvature > rules.regime_information * whole:
            change = -float(np.sum(slope * residual * mask)) / curvature
            found[name] = (amplitude + change, curvature**-0.5)
    return found
