"""Fits: the simulator's parameters from a log, what is known of them, and how well it then predicts.

`calibrate` is the one way from a log to a fitted model; `solver` is under every fit of a simulated model.
"""

from igrow.trainer.fit.calibrate import calibrate
from igrow.trainer.fit.evaluation import ErrorSummary, Evaluation, evaluate
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel

__all__ = ["ErrorSummary", "Evaluation", "FittedModel", "Gaussian", "calibrate", "evaluate"]
