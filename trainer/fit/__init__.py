"""Fits: the simulator's parameters from a log, what is known of them, and how well it then predicts.

`solver` is under every fit of a simulated model; `igrow.trainer.calibration` leads from a log through all of them.
"""

from igrow.trainer.fit.evaluation import ErrorSummary, Evaluation, evaluate
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel

__all__ = ["ErrorSummary", "Evaluation", "FittedModel", "Gaussian", "evaluate"]
