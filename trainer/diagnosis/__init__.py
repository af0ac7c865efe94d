"""Diagnosis: from the residual of a log to the cause that the model lacks, and the corrected model.

    result = diagnose(log, model)
    print(result.summary())

In the order in which they are read:

    knowledge, circumstances    what is known before the log, and what it lets be asked: its crop, what open vents show
    design/                     the log's errors along free runs, and how they depend on all that may be missing
    search/                     what has changed, or was never known: one cause after the other, its size and beginning
    validation/                 causes kept where they stand on days that no fit has seen, and the model to be shipped
    answer/                     findings and errors, in words, figures and JSON

`diagnose` is the road through them, `rules` holds every threshold, `learned/` what greenhouses in which nothing is
missing have taught, `sharing` what one greenhouse tells others of its owner.
docs/method.md tells why.
"""

from igrow.trainer.diagnosis.answer.result import EXIT_CODES, Diagnosis, Finding
from igrow.trainer.diagnosis.diagnose import diagnose
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.diagnosis.search.history import history_of
from igrow.trainer.diagnosis.search.omission import examine
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
