"""Diagnosis: from the residual of a log to the cause that the model lacks, and the corrected model.

    log --> screen --> recalibrate (parameters, colour of the disturbances) --> search over effects, shapes, beginnings
        --> what remains? --> size, interval, rivals --> does it improve unseen days? --> verdict, corrected model

`diagnose` runs it all; docs/diagnosis.md tells why each step is there and how well it does.
"""

from igrow.trainer.diagnosis.deployed import Deployed, from_manifest, from_posterior, from_site, learn_misfit
from igrow.trainer.diagnosis.diagnose import CorrectedModel, Evidence, diagnose
from igrow.trainer.diagnosis.result import EXIT_CODES, Diagnosis, Finding

__all__ = [
    "EXIT_CODES",
    "CorrectedModel",
    "Deployed",
    "Diagnosis",
    "Evidence",
    "Finding",
    "diagnose",
    "from_manifest",
    "from_posterior",
    "from_site",
    "learn_misfit",
]
