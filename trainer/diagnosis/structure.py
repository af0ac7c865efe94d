"""Whether the model has the structure of its greenhouse: the test that decides how finely errors count."""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis import linear
from igrow.trainer.diagnosis.design import Design


def disagreement(hours: Design, steps: Design) -> float:
    """Return how far parameters fitted to hours and to time steps lie apart, over what chance makes.

    Where the model's structure is the greenhouse's, both agree within their standard errors; where masses are missing
    that answer within the hour, the fast errors pull the parameters away. The specification test of Hausman (1978,
    Econometrica 46, 1251-1271): the difference of both estimates against the difference of their covariances; mean
    squared over the directions in which the time steps tell more, infinite where nothing tells.

    Args:
        hours: the log with errors averaged to hours.
        steps: the same log with errors time step by time step.
    """
    slow, slow_covariance = _parameters(hours)
    fast, fast_covariance = _parameters(steps)
    gained, directions = np.linalg.eigh(slow_covariance - fast_covariance)
    told = gained > hours.rules.least_gained_variance
    if not told.any():
        return float("inf")
    apart = directions.T @ (slow - fast)
    return float(np.mean(apart[told] ** 2 / gained[told]))


def _parameters(design: Design) -> tuple[Floats, Floats]:
    """Return the fitted parameters and their covariance, in prior standard deviations, (p,) and (p, p)."""
    fitted = linear.fit(design.grams, design.null_model()).solution
    count, spread = len(design.block("parameter")), design.prior.standard_deviation
    stand = np.array([design.line.parameters[name] for name in design.prior.names])
    covariance = fitted.inverse[:count, :count] / np.outer(spread, spread)
    return (stand + fitted.coefficients[:count]) / spread, covariance
