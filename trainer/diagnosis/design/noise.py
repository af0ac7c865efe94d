"""The colour of a site's disturbances, and the filter that turns errors of free runs into innovations.

Along a free run the error is the disturbance (an autocorrelated flux) after its way through the plant, plus sensor
noise: a short autoregressive moving-average process per balance. Its prediction-error form is the steady-state
observer (Ljung 1999, System Identification, ch. 7); fitting it by maximum likelihood is fitting the observer's gain
and the disturbance's colour to the site. The same filter applied to all sensitivities turns ordinary into
generalised least squares. Every run starts afresh, so the filter does too.

Tails are taken as Student's t (Lange, Little and Taylor 1989, J. Am. Stat. Assoc. 84): rare large disturbances
then count little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from igrow.core.arrays import Floats, Mask

FREEDOM = 5.0
"""Degrees of freedom of Student's t."""
ORDER = 2
"""Number of first-order disturbances: a fast and a slow one."""
_LARGEST_ROOT = 0.92
"""At 15 minutes a correlation time of a day: what is slower is not a disturbance but a wrong model."""


@dataclass(frozen=True)
class NoiseFilter:
    """One balance's filter from errors of runs to innovations: numerator / denominator in the delay z^-1."""

    numerator: Floats
    denominator: Floats
    raw: tuple[float, ...]
    """Where the next fit may begin."""

    def __call__(self, values: Floats) -> Floats:
        """Filter along the last axis."""
        return np.asarray(lfilter(self.numerator, self.denominator, values, axis=-1))


@dataclass(frozen=True)
class Whitening:
    """Filters of all balances, the joint covariance of their innovations, and the weight of each sample."""

    filters: tuple[NoiseFilter, ...]
    root: Floats
    """Inverse Cholesky factor of the covariance of innovations, (b, b)."""
    weight: Floats
    """Square root of each sample's weight, 0 where it does not count, (r, steps)."""

    def __call__(self, values: Floats) -> Floats:
        """Turn errors or sensitivities, (c, b, r, steps), into weighted white noise of the same shape."""
        filtered = np.stack([one(values[:, balance]) for balance, one in enumerate(self.filters)], axis=1)
        return np.asarray(np.tensordot(self.root, filtered, axes=(1, 1)).swapaxes(0, 1) * self.weight)


def fit_filter(errors: Floats, counted: Mask, start: NoiseFilter | None = None) -> NoiseFilter:
    """Fit the filter of one balance by maximum likelihood under Student's t.

    Args:
        errors: of runs, (r, steps), 0 where not observed.
        counted: samples that count, (r, steps).
        start: where to begin.
    """
    normal = np.clip(errors / _scale(errors[counted]), -12.0, 12.0)
    raw = (
        np.concatenate([np.linspace(2.0, 4.5, ORDER), np.linspace(0.5, 3.0, ORDER + 1)])
        if start is None
        else np.asarray(start.raw)
    )
    for _ in range(3):
        scale = _t_scale(_filtered(normal, raw)[counted])

        def deviance(values: Floats, scale: float = scale) -> Floats:
            return _deviance(_filtered(normal, values)[counted] / scale)

        def slopes(values: Floats, scale: float = scale) -> Floats:
            innovation = _filtered(normal, values)
            moved = np.stack([one[counted] for one in _filter_slopes(innovation, values)], axis=1)
            return _deviance_slope(innovation[counted] / scale)[:, None] * moved / scale

        before = raw
        raw = np.asarray(least_squares(deviance, raw, slopes, (-3.0, 9.0), max_nfev=12, ftol=1e-5, xtol=1e-3).x)
        if np.max(np.abs(raw - before)) < 0.02:
            break
    return filter_of(tuple(float(value) for value in raw))


def fit_whitening(errors: Floats, counted: Mask, filters: tuple[NoiseFilter, ...]) -> Whitening:
    """Return the whitening for given filters: covariance and weights by a few rounds of reweighting.

    Args:
        errors: (b, r, steps), 0 where not observed.
        counted: samples that count, (r, steps).
        filters: one a balance.
    """
    innovations = np.stack([one(errors[balance]) for balance, one in enumerate(filters)])
    chosen = innovations[:, counted]
    size = len(filters)
    covariance = np.diag([_scale(values) ** 2 for values in chosen])
    for _ in range(10):
        scaled = np.linalg.inv(np.linalg.cholesky(covariance))
        distance = np.sum((scaled @ chosen) ** 2, axis=0)
        weight = (FREEDOM + size) / (FREEDOM + distance)
        covariance = (chosen * weight) @ chosen.T / chosen.shape[1]
    root: Floats = np.linalg.inv(np.linalg.cholesky(covariance)).astype(np.float64)
    return extend(Whitening(filters, root, np.zeros(errors.shape[1:])), errors, counted)


def fit_noise(errors: Floats, observed: Mask, fitted: Mask, start: Whitening | None = None) -> Whitening:
    """Fit colour and scale of the disturbances to errors on the fit days.

    Args:
        errors: of the balances at hand, (b, r, steps).
        observed: time steps that count, (r, steps).
        fitted: runs on days for fitting, (r, 1).
        start: where to begin.
    """
    errors = errors * observed
    counted = observed & fitted
    starts = start.filters if start else (None,) * len(errors)
    filters = tuple(fit_filter(one, counted, start=begin) for one, begin in zip(errors, starts, strict=True))
    whitening = fit_whitening(errors, counted, filters)
    # Samples of held-out days are filtered and weighted too: the fit leaves them out by day.
    return extend(whitening, errors, observed)


def rescaled(filters: tuple[NoiseFilter, ...], errors: Floats, observed: Mask, fitted: Mask) -> Whitening:
    """Return the whitening of known colour: covariance and weights alone are fitted; arguments as in `fit_noise`."""
    errors = errors * observed
    return extend(fit_whitening(errors, observed & fitted, filters), errors, observed)


def filter_of(raw: tuple[float, ...]) -> NoiseFilter:
    """Return the filter of raw coefficients."""
    return NoiseFilter(*_coefficients(np.asarray(raw)), raw)


def extend(whitening: Whitening, errors: Floats, counted: Mask) -> Whitening:
    """Return the whitening with weights for other samples than it was fitted on."""
    distance = _distance(whitening, errors)
    weight = np.where(counted, np.sqrt((FREEDOM + len(errors)) / (FREEDOM + distance)), 0.0)
    return replace(whitening, weight=weight)


def _distance(whitening: Whitening, errors: Floats) -> Floats:
    """Return the squared Mahalanobis distance of the innovations of errors (b, r, steps) from 0, (r, steps)."""
    innovations = np.stack([one(errors[balance]) for balance, one in enumerate(whitening.filters)])
    return np.asarray(np.sum(np.tensordot(whitening.root, innovations, axes=1) ** 2, axis=0))


def _roots(raw: Floats) -> Floats:
    """Return the zeros of the filter, which take the disturbance's poles out, and then its own poles."""
    return np.asarray(_LARGEST_ROOT * np.tanh(0.5 * raw))


def _coefficients(raw: Floats) -> tuple[Floats, Floats]:
    """Return numerator and denominator."""
    roots = _roots(raw)
    numerator: Floats = np.poly(roots[:ORDER]).astype(np.float64)
    denominator: Floats = np.poly(roots[ORDER:]).astype(np.float64)
    return numerator, denominator


def _filtered(values: Floats, raw: Floats) -> Floats:
    return np.asarray(lfilter(*_coefficients(raw), values))


def _filter_slopes(innovation: Floats, raw: Floats) -> list[Floats]:
    """Return the slope of the innovations (r, steps) in each raw coefficient: a root's own factor, differentiated."""
    roots = _roots(raw)
    by_raw = 0.5 * (_LARGEST_ROOT - roots**2 / _LARGEST_ROOT)
    by_raw[:ORDER] *= -1.0
    return [lfilter([0.0, size], [1.0, -root], innovation) for size, root in zip(by_raw, roots, strict=True)]


def _deviance(innovation: Floats) -> Floats:
    """Return the signed root of minus twice the log-likelihood of innovations in units of their scale, (n,)."""
    return np.asarray(np.copysign(np.sqrt((FREEDOM + 1.0) * np.log1p(innovation**2 / FREEDOM)), innovation))


def _deviance_slope(innovation: Floats) -> Floats:
    """Return its slope in the innovations, (n,)."""
    deviance = _deviance(innovation)
    level = np.full_like(innovation, np.sqrt(FREEDOM / (FREEDOM + 1.0)))
    ratio = np.divide(innovation, deviance, out=level, where=deviance != 0.0)
    return np.asarray((FREEDOM + 1.0) / (FREEDOM + innovation**2) * ratio)


def _t_scale(innovation: Floats) -> float:
    """Return the scale of Student's t by a few rounds of reweighting."""
    scale2 = _scale(innovation) ** 2
    for _ in range(5):
        weight = (FREEDOM + 1.0) / (FREEDOM + innovation**2 / scale2)
        scale2 = max(float(np.mean(weight * innovation**2)), 1e-12)
    return float(np.sqrt(scale2))


def _scale(values: Floats) -> float:
    """Return a robust standard deviation (from the median absolute value)."""
    return max(1.4826 * float(np.median(np.abs(values))), 1e-3 * float(np.std(values)), 1e-9)
