"""Calibration: the hybrid simulator's parameters from a log, their doubt, and how well it then predicts."""

from igrow.trainer.calibration.evaluation import ErrorSummary, Evaluation, evaluate
from igrow.trainer.calibration.fit import calibrate
from igrow.trainer.calibration.posterior import Posterior, prior
from igrow.trainer.data.splits import WeekSplit as Split
from igrow.trainer.data.splits import split_weeks

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
