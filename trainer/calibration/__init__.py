"""Calibration: the hybrid simulator's parameters from a log, their doubt, and how well it then predicts."""

from trainer.calibration.evaluation import ErrorSummary, Evaluation, evaluate
from trainer.calibration.fit import calibrate
from trainer.calibration.posterior import Posterior, prior
from trainer.calibration.split import Split, split_weeks

__all__ = [
    "ErrorSummary",
    "Evaluation",
    "Posterior",
    "Split",
    "calibrate",
    "evaluate",
    "prior",
    "split_weeks",
]
