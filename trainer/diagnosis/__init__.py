"""Diagnosis: from the residual of a log to the cause that the model lacks, and the corrected model.

    result = diagnose(log, model)
    print(result.summary())

In the order in which they are read: `knowledge` (what is known before the log), `diagnosed_days`, `freerun` (the days
of a log, and models that are fitted to some and judged on others), `circumstances` (what a log lets be asked: its
`crop`, its `actuators`, what `open_vents` show), `sensitivity` (day runs of the model, and how they depend on
everything), `candidates`, `noise`, `recalibration`, `design` (errors and candidates in named blocks), `linear` and
`search` (a scan of all candidates), `rounds` (one cause after the other), `compare` (the best of them beside their own
noise) or, where the greenhouse's own calibration log taught what is missing even then, `amplitudes`, `history`,
`null_gains` and `change` (what has changed since; `cross_validation` asks unseen days where time steps tell nothing or
not which, `unexplained` what has no name, `parameter_change` the parameters, `omission` what it lacked from the first
day), `estimate`, `refit` (size, beginning, confounded causes), `confirmation` (the same by free runs), `correction`
(what stands on unseen days; `parameter_or_causes` where both explain the log), `shipping` (the model that is shipped),
`unseen_errors`, `evidence`, `wording`, `result`, `answers` (what parts of a log tell beside each other). `rules` holds
every threshold, `nuisance` what greenhouses show though nothing is missing, `sharing` what one tells others.
docs/method.md tells why.
"""

from igrow.trainer.diagnosis.diagnose import diagnose
from igrow.trainer.diagnosis.history import history_of
from igrow.trainer.diagnosis.nuisance import NuisanceSubspace, discrepancy_of, read_nuisance
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
    "NuisanceSubspace",
    "diagnose",
    "discrepancy_of",
    "examine",
    "history_of",
    "learned_from",
    "read_nuisance",
]
