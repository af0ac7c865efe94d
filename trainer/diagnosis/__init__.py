"""Diagnosis: from the residual of a log to the cause that the model lacks, and the corrected model.

    result = diagnose(log, model)
    print(result.summary())

In the order in which they are read: `knowledge` (what is known before the log), `diagnosed_days`, `freerun` (the days
of a log, and models that are fitted to some and judged on others), `circumstances` (what a log lets be asked: its
`crop`, its `actuators`, what `open_vents` show), `sensitivity` (day runs of the model, and how they depend on
everything), `candidates`, `noise`, `balances`, `design` (errors and candidates in named blocks), `linear` and `search`
(a scan of all candidates), `amplitudes`, `history`, `null_gains` and `change` (what has changed since the calibration,
or was never known; `cross_validation` asks unseen days where time steps tell nothing or not which, `unexplained` what
has no name, `parameter_change` the parameters, `omission` what the model lacked from the first day), `rounds` (one
cause after the other), `estimate`, `refit` (size, beginning, confounded causes), `confirmation` (the same by free
runs), `correction` (what stands on unseen days; `parameter_or_causes` where both explain the log), `shipping` (the
model that is shipped), `unseen_errors`, `evidence`, `wording`, `result`, `answers` (what parts of a log tell beside
each other). `rules` holds every threshold, `sharing` what one greenhouse tells others.
docs/method.md tells why.
"""

from igrow.trainer.diagnosis.diagnose import diagnose
from igrow.trainer.diagnosis.history import history_of
from igrow.trainer.diagnosis.omission import examine
from igrow.trainer.diagnosis.result import EXIT_CODES, Diagnosis, Finding
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.diagnosis.sharing import learned_from

__all__ = [
    "DEFAULT",
    "EXIT_CODES",
    "DecisionRules",
    "Diagnosis",
    "Finding",
    "diagnose",
    "examine",
    "history_of",
    "learned_from",
]
