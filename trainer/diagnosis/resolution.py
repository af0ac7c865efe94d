"""Whether the model's structure is the greenhouse's, so that errors within the hour may be trusted.

Where the structure is right, parameters fitted to errors of single rows and parameters fitted to means of hours agree
within their doubt; where masses are missing that answer within the hour, the fast errors pull the parameters elsewhere.
The specification test of Hausman (1978, Econometrica 46): the difference of both estimates against the difference of
their covariances. A greenhouse that passes tells more: its errors count row by row, and the usual differences between
greenhouses, which stand for what the balances lack, need not be allowed for.
"""

from __future__ import annotations

import numpy as np

from igrow.trainer.diagnosis import search, structure
from igrow.trainer.diagnosis.linearisation import Floats
from igrow.trainer.diagnosis.problem import Problem

LARGEST_DISAGREEMENT = 7.0
"""Mean squared difference of both estimates, over what chance makes, up to which the structure counts as right. Tuning
logs of the balances' own structure lie between 2 and 6, those of the mechanistic greenhouse between 10 and 28."""
LEAST_GAINED = 0.02
"""Directions of the parameters in which the rows tell so much more than the hours are compared (share of the prior)."""


def disagreement(hours: Problem, rows: Problem) -> float:
    """Return the mean squared difference of the parameters over what chance makes; infinite where nothing tells.

    Args:
        hours: the log with errors averaged to hours.
        rows: the same log with errors row by row.
    """
    slow, slow_doubt = _parameters(hours)
    fast, fast_doubt = _parameters(rows)
    gained, directions = np.linalg.eigh(slow_doubt - fast_doubt)
    told = gained > LEAST_GAINED
    if not told.any():
        return float("inf")
    apart = directions.T @ (slow - fast)
    return float(np.mean(apart[told] ** 2 / gained[told]))


def _parameters(problem: Problem) -> tuple[Floats, Floats]:
    """Return the fitted parameters and their covariance, in units of the prior's spread, (p,) and (p, p)."""
    fitted = search.fit(problem.grams, structure.null_model(problem)).solution
    count, spread = len(problem.parameter), problem.prior.spread
    stand = np.array([problem.line.parameters[name] for name in problem.prior.names])
    doubt = fitted.inverse[:count, :count] / np.outer(spread, spread)
    return (stand + fitted.coefficients[:count]) / spread, doubt
